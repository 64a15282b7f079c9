"""The MODS protocol on masks small enough to count by hand, and its result formats."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani_models.benchmarks.mods import (
    OBSTACLE,
    SKY,
    WATER,
    Dataset,
    Frame,
    ModsTally,
    Obstacle,
    Sequence,
    WaterEdge,
    danger_zone,
    land_mask,
    read_dataset,
    to_mods_classes,
    write_prediction,
)
from paani_models.benchmarks.mods_detection import (
    Detection,
    Results,
    as_detections,
    build_results,
    challenge_score,
    f_score,
    write_results,
)

HEIGHT, WIDTH, EDGE = 120, 200, 40
NOWHERE = np.zeros((HEIGHT, WIDTH), bool)
BOAT = Obstacle("ship", (100, 70, 20, 10), 200)
SHORE = WaterEdge((0.0, WIDTH - 1.0), (EDGE, EDGE))


def mask(edge: int = EDGE) -> np.ndarray:
    label = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    label[:edge] = OBSTACLE
    return label


def figures(label: np.ndarray, *obstacles: Obstacle, zone: np.ndarray = NOWHERE) -> dict[str, float]:
    tally = ModsTally()
    tally.add(label, Frame(id=0, image_file_name="a.jpg", obstacles=obstacles, water_edges=(SHORE,)), zone)
    return tally.figures()


def test_land_is_above_the_line() -> None:
    land = land_mask((WaterEdge((10, 20), (5, 15)),), (30, 30))
    assert land.sum(0).tolist() == [0] * 10 + list(range(5, 16)) + [0] * 9


@pytest.mark.parametrize(("lower", "hit", "error"), [(0, 100, 1), (10, 100, 9), (21, 100, 20), (22, 0, 40)])
def test_the_water_edge_is_hit_within_twenty_pixels(lower: int, hit: float, error: float) -> None:
    """The lowest obstacle row is `EDGE + lower - 1`, the true edge row EDGE; a miss costs the edge's row."""
    found = figures(mask(EDGE + lower))
    assert (found["edge_hit"], found["edge_px"]) == (hit, error)
    assert (found["overshoot"], found["undershoot"]) == (0, 100 if lower else 0)


def test_overshoot_and_undershoot_share_the_wrong_pixels() -> None:
    label = mask(EDGE - 6)
    label[: EDGE + 3, : WIDTH // 2] = OBSTACLE
    found = figures(label)
    assert found["overshoot"] == pytest.approx(100 * 6 / 9)
    assert found["undershoot"] == pytest.approx(100 * 3 / 9)


def test_no_edge_is_judged_under_an_object_that_stands_across_it() -> None:
    label = mask()
    label[:, 100:120] = WATER
    across = Obstacle("ship", (100, 30, 20, 30), 600)
    assert figures(label, across)["edge_hit"] == 100
    assert figures(label)["edge_hit"] == 100
    label[:, 60:140] = WATER
    assert figures(label)["edge_hit"] < 100


def test_without_any_obstacle_every_column_is_missed() -> None:
    found = figures(np.full((HEIGHT, WIDTH), WATER, np.uint8))
    assert (found["edge_hit"], found["edge_px"], found["overshoot"]) == (0, EDGE, 100)


@pytest.mark.parametrize(("rows", "f1"), [(4, 0.0), (5, 100.0)])
def test_an_object_is_found_at_half_of_its_area(rows: int, f1: float) -> None:
    label = mask()
    label[70 : 70 + rows, 100:120] = OBSTACLE
    assert figures(label, BOAT)["f1"] == f1


def test_alarms_by_hand() -> None:
    """Found boat, a 6 x 6 blob in open water, a 5 x 5 blob (too small), one beside the shore: TP 1, FP 1, FN 1."""
    label = mask()
    label[70:80, 100:120] = OBSTACLE
    label[100:106, 20:26] = OBSTACLE
    label[100:105, 60:65] = OBSTACLE
    label[41:42, 150:190] = OBSTACLE
    missed = Obstacle("person", (160, 100, 10, 10), 100)
    assert figures(label, BOAT, missed)["f1"] == pytest.approx(100 * 2 / 4)


def test_a_blob_much_wider_than_its_object_holds_alarms() -> None:
    """80 px wide on a boat of 20: 60 / 22 is 2.7 widths beside it, of which one is let pass."""
    label = mask()
    label[70:80, 60:140] = OBSTACLE
    tally = ModsTally()
    tally.add(label, Frame(id=0, image_file_name="a", obstacles=(BOAT,), water_edges=(SHORE,)), NOWHERE)
    assert tally.objects[0].tolist() == [1, 0, 1]


def test_small_and_negative_objects_are_not_judged() -> None:
    label = mask()
    label[100:110, 20:30] = OBSTACLE
    small, hidden = Obstacle("other", (50, 100, 4, 6), 24), Obstacle("negative", (20, 100, 10, 10), 100)
    assert math.isnan(figures(label, small, hidden)["f1"])


def test_a_frame_that_is_not_fully_annotated_has_no_alarms() -> None:
    label = mask()
    label[100:110, 20:30] = OBSTACLE
    frame = Frame(id=0, image_file_name="a", water_edges=(SHORE,), exhaustive=0)
    tally = ModsTally()
    tally.add(label, frame, NOWHERE)
    tally.add(label, msgspec.structs.replace(frame, exhaustive=1), NOWHERE, exhaustive=False)
    assert tally.objects.sum() == 0


def test_the_danger_zone_is_counted_apart() -> None:
    zone = NOWHERE.copy()
    zone[90:] = True
    label = mask()
    label[70:80, 100:120] = OBSTACLE
    missed = Obstacle("person", (160, 100, 10, 10), 100)
    found = figures(label, BOAT, missed, zone=zone)
    assert found["f1"] == pytest.approx(100 * 2 / 3)
    assert found["f1_zone"] == 0.0


def test_the_danger_zone_by_hand() -> None:
    """Level, 1 m up, 15 m ahead, focal length 600 px: 40 px below the horizon in the middle; nearer is lower."""
    camera = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    zone = danger_zone(0, 0, camera, np.zeros(5), (640, 480))
    column = zone[:, 320]
    assert int(column.argmax()) == pytest.approx(240 + 600 / 15, abs=1)
    assert column[281:].all()
    assert zone[:, 20].argmax() > column.argmax()
    further = danger_zone(0, 0, camera, np.zeros(5), (640, 480), radius_m=30)
    assert int(further[:, 320].argmax()) == pytest.approx(260, abs=1)
    tilted = danger_zone(4, 0, camera, np.zeros(5), (640, 480))
    assert tilted[:, 100].argmax() != pytest.approx(tilted[:, 540].argmax(), abs=10)
    assert danger_zone(0, 3, camera, np.zeros(5), (640, 480))[:, 320].argmax() != column.argmax()


def test_masks_are_written_as_the_benchmark_reads_them(tmp_path: Path) -> None:
    assert to_mods_classes(np.array([0, 1, 2], np.uint8)).tolist() == [WATER, OBSTACLE, SKY]
    write_prediction(tmp_path, "paani", "kope100", "00006790L.jpg", np.array([[WATER, OBSTACLE, SKY]], np.uint8))
    written = cv2.imread(str(tmp_path / "paani" / "kope100" / "00006790L.png"))
    assert written is not None
    assert written[0, :, ::-1].tolist() == [[255, 0, 0], [0, 0, 0], [0, 255, 0]]


DATASET = Dataset(
    (
        Sequence(
            id=3,
            path="/kope/frames/",
            frames=(Frame(id=0, image_file_name="a.jpg"), Frame(id=1, image_file_name="b.jpg")),
        ),
    )
)


def test_the_detection_file_names_every_frame(tmp_path: Path) -> None:
    found = {
        (3, 1): as_detections(
            ["vessel", "buoy", "person", "pier"], np.tile(np.array([[1.4, 2, 11.6, 8]], np.float32), (4, 1))
        )
    }
    path = tmp_path / "tracks.json"
    write_results(path, build_results("paani", DATASET, found))
    written = msgspec.json.decode(path.read_bytes())["dataset"]
    assert (written["name"], written["num_seq"]) == ("paani", 1)
    first, second = written["sequences"][0]["frames"]
    assert first == {"id": 0, "image_file_name": "a.jpg", "detections": []}
    assert [d["type"] for d in second["detections"]] == [0, 2, 1, 2]
    assert second["detections"][0] == {"id": 0, "type": 0, "bbox": [1, 2, 11, 6]}
    assert msgspec.json.decode(path.read_bytes(), type=Results).dataset.sequences[0].frames[1].detections[
        0
    ] == Detection(0, 0, (1, 2, 11, 6))
    assert [p.name for p in tmp_path.iterdir()] == ["tracks.json"]


def test_f_by_hand() -> None:
    """Two true boxes; one found with the wrong class, one found twice."""
    true = np.array([[0, 0, 0, 10, 10], [1, 50, 50, 60, 60]], np.float32)
    found = np.array([[0, 0, 0, 10, 10], [0, 0, 0, 10, 9], [2, 50, 50, 60, 60]], np.float32)
    assert f_score([(found, true)], by_class=True) == pytest.approx(2 * 1 / 5)
    assert f_score([(found, true)], by_class=False) == pytest.approx(2 * 2 / 5)
    nothing = np.zeros((0, 5), np.float32)
    assert f_score([(nothing, nothing)], by_class=True) == 1.0
    assert challenge_score(0.122, 0.172, 0.964) == pytest.approx(0.419, abs=5e-4)


def test_three_tenths_of_overlap_suffice() -> None:
    true = np.array([[0, 0, 0, 10, 10]], np.float32)
    for height, expected in ((3.0, 1.0), (2.9, 0.0)):
        assert f_score([(np.array([[0, 0, 0, 10, height]], np.float32), true)], by_class=True) == expected


def test_annotations_are_read_or_named(tmp_path: Path) -> None:
    path = tmp_path / "mods.json"
    path.write_bytes(msgspec.json.encode({"dataset": DATASET, "more": 1}))
    assert read_dataset(path) == DATASET
    path.write_text("{}")
    with pytest.raises(UserError, match=r"mods\.json"):
        read_dataset(path)
