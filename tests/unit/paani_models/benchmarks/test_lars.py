"""The LaRS protocol on masks small enough to count by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from paani.errors import UserError
from paani_models.benchmarks.lars import (
    COLOURS,
    OBSTACLE,
    SKY,
    WATER,
    LarsTally,
    Segment,
    Truth,
    read_names,
    read_prediction,
    read_segments,
    read_truth,
    to_lars_classes,
    write_prediction,
)
from tests.unit.paani_models.datasets.public_sets import write_picture

HEIGHT, WIDTH, SHORE = 60, 80, 20
BOAT, BOAT_ID = (slice(40, 44), slice(30, 40)), 11


def truth() -> Truth:
    """Rows 0..19 shore, below it water with a boat of 4 x 10 px."""
    semantic = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    semantic[:SHORE] = OBSTACLE
    semantic[BOAT] = OBSTACLE
    panoptic = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    panoptic[..., 0] = np.where(semantic == WATER, 3, 1)
    panoptic[BOAT] = (BOAT_ID, 1, 0)
    segments = (Segment(1, 1), Segment(3, 3), Segment(BOAT_ID + 256, BOAT_ID))
    return Truth(semantic, panoptic, segments)


def figures(predicted: np.ndarray) -> dict[str, float]:
    tally = LarsTally()
    tally.add(predicted, truth())
    return tally.figures()


def test_a_perfect_mask() -> None:
    found = figures(truth().semantic)
    assert (found["miou"], found["mu"], found["pr"], found["re"], found["f1"], found["q"]) == (100,) * 6


def test_classes_without_a_pixel_are_left_out_of_the_mean() -> None:
    found = figures(truth().semantic)
    assert math.isnan(found["iou_sky"])
    assert found["miou"] == 100


def test_a_shore_three_rows_low_costs_water_edge_accuracy() -> None:
    """The edge band is 5 rows to either side of row 20: of its 10 rows, 3 are wrong."""
    predicted = truth().semantic
    predicted[SHORE : SHORE + 3] = OBSTACLE
    found = figures(predicted)
    assert found["mu"] == pytest.approx(70.0)
    obstacle = SHORE * WIDTH + 40
    assert found["iou_obstacle"] == pytest.approx(100 * obstacle / (obstacle + 3 * WIDTH))


@pytest.mark.parametrize(("pixels", "hit"), [(28, False), (29, True)])
def test_an_object_counts_above_seven_tenths_of_its_area(pixels: int, hit: bool) -> None:
    """0.7 of 40 px is 28, which is not yet enough; pixels up to 3 px beside it count too."""
    predicted = truth().semantic
    predicted[BOAT] = WATER
    patch = np.zeros(40, np.uint8)
    patch[:pixels] = 1
    predicted[38:42, 28:38] = np.where(patch.reshape(4, 10) > 0, OBSTACLE, WATER)
    assert figures(predicted)["re"] == (100.0 if hit else 0.0)


def test_false_alarms_are_blobs_well_inside_the_water() -> None:
    """Two blobs touching at a corner are one; one within 10 px of the shore is none; water stays 21 px of the boat."""
    predicted = truth().semantic
    predicted[57:59, 10:12] = OBSTACLE
    predicted[55:57, 12:14] = OBSTACLE
    predicted[25:27, 60:64] = OBSTACLE
    found = figures(predicted)
    assert found["pr"] == 50.0
    assert found["f1"] == pytest.approx(100 * 2 * 0.5 / 1.5)
    assert found["q"] == pytest.approx(found["miou"] * found["f1"] / 100)


def test_static_obstacles_hit_no_object() -> None:
    """An object beside the shore: prediction that only covers the shore next to it finds nothing."""
    here = truth()
    here.panoptic[BOAT] = (3, 0, 0)
    spot = (slice(SHORE, SHORE + 2), slice(0, 2))
    here.panoptic[spot] = (BOAT_ID, 1, 0)
    here.semantic[BOAT], here.semantic[spot] = WATER, OBSTACLE
    predicted = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    predicted[:SHORE] = OBSTACLE
    tally = LarsTally()
    tally.add(predicted, here)
    assert (tally.found, tally.missed) == (0, 1)


def test_ignored_pixels_do_not_count() -> None:
    here = truth()
    here.semantic[BOAT] = 255
    tally = LarsTally()
    tally.add(np.where(here.semantic == 255, WATER, here.semantic).astype(np.uint8), here)
    assert tally.figures()["miou"] == 100


def test_predictions_are_resized_to_the_truth() -> None:
    small = truth().semantic[::2, ::2]
    assert figures(small)["miou"] == 100


def test_totals_are_over_pixels_not_over_pictures() -> None:
    tally = LarsTally()
    wrong = np.full((HEIGHT, WIDTH), SKY, np.uint8)
    tally.add(truth().semantic, truth())
    tally.add(wrong, truth())
    assert tally.figures()["iou_water"] == 50.0
    assert tally.figures()["mu"] == 50.0


def test_our_classes_become_theirs_and_colours(tmp_path: Path) -> None:
    assert to_lars_classes(np.array([0, 1, 2], np.uint8)).tolist() == [WATER, OBSTACLE, SKY]
    ours = np.repeat(np.array([[0, 1, 2]], np.uint8), 16, 0).repeat(8, 1)
    write_prediction(tmp_path / "out", "a", ours)
    assert np.array_equal(read_prediction(tmp_path / "out" / "a.png"), to_lars_classes(ours))
    assert COLOURS == ((247, 195, 37), (41, 167, 224), (90, 75, 164))


def lars(root: Path) -> Path:
    here = truth()
    write_picture(root / "semantic_masks" / "a.png", here.semantic)
    write_picture(root / "panoptic_masks" / "a.png", here.panoptic[..., ::-1])
    (root / "image_list.txt").write_text("a\n")
    segments = [{"id": s.id, "category_id": s.category_id, "area": 1} for s in here.segments]
    panoptic = {
        "images": [{"id": 7, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 7, "segments_info": segments}],
    }
    (root / "panoptic_annotations.json").write_text(json.dumps(panoptic))
    return root


def test_the_official_layout_is_read(tmp_path: Path) -> None:
    root = lars(tmp_path)
    assert read_names(root) == ("a",)
    read, here = read_truth(root, "a", read_segments(root)), truth()
    assert np.array_equal(read.semantic, here.semantic)
    assert np.array_equal(read.panoptic, here.panoptic)
    assert read.segments == here.segments


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    root = lars(tmp_path)
    with pytest.raises(UserError, match=r"panoptic_annotations\.json: does not annotate b"):
        read_truth(root, "b", read_segments(root))
    (root / "panoptic_masks" / "a.png").unlink()
    with pytest.raises(UserError, match=r"panoptic_masks.a\.png"):
        read_truth(root, "a", read_segments(root))
    (root / "image_list.txt").write_text("")
    with pytest.raises(UserError, match=r"image_list\.txt: names no picture"):
        read_names(root)
    write_picture(tmp_path / "grey.png", np.full((20, 20, 3), 9, np.uint8))
    with pytest.raises(UserError, match=r"grey\.png: holds other colours"):
        read_prediction(tmp_path / "grey.png")
