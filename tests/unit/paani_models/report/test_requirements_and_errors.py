"""Error analysis of both networks, and how figures compare with their requirements."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani_models.catalogue import WEIGHTS, load_catalogue
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import IGNORE, Sample, Source, choose_sources
from paani_models.detector.metrics import Detections
from paani_models.detector.scores import ScoredBoxes
from paani_models.report.box_errors import OUTCOMES, analyse_box_errors, count_outcomes
from paani_models.report.error_tables import render_box_errors, render_mask_errors, render_requirements
from paani_models.report.experiments import (
    PRESENT_WEIGHTS,
    Experiment,
    encode_experiments,
    read_experiments,
    with_present_weights,
)
from paani_models.report.mask_errors import (
    CELLS_HW,
    MaskErrors,
    analyse_mask_errors,
    count_mask_errors,
    edge_f1,
    fill_undecided,
    round_to_cells,
    water_iou,
)
from paani_models.report.records import CleanSource, FaultCell, FaultReport, FaultTotals, image_quality_figures
from paani_models.report.requirements import REQUIREMENTS, RequirementResult, compare_with_requirements
from tests.unit.paani_models.datasets.public_sets import own_data

WATER, OBSTACLE, SKY = 0, 1, 2
HARBOUR = Source("harbour", "harbour", labels="labels", annotated=frozenset({"person", "vessel"}))


def shore() -> np.ndarray:
    """Water below row 50 of 100, obstacle above."""
    truth = np.full((100, 80), OBSTACLE, np.uint8)
    truth[50:] = WATER
    return truth


def test_mistakes_by_distance_and_height() -> None:
    """One wrong row next to the edge, one 20 px above it, and water missed at the bottom."""
    label = shore()
    label[49] = WATER
    label[30] = WATER
    label[99] = OBSTACLE
    counts, _, _, _, near, false_water, missed_water, judged = count_mask_errors(label, shore())
    assert counts.tolist() == [[49 * 80, 80, 0], [160, 48 * 80, 0], [0, 0, 0]]
    assert near.tolist() == [80, 80, 80]
    assert false_water.tolist() == [0, 0, 0, 80, 80, 0, 0, 0, 0, 0]
    assert missed_water.tolist() == [0] * 9 + [80]
    assert judged.tolist() == [800] * 10


@pytest.mark.parametrize(("row", "near"), [(47, [80, 80, 80]), (46, [0, 80, 80]), (41, [0, 0, 80]), (40, [0, 0, 0])])
def test_a_mistake_is_near_an_edge_up_to_the_whole_distance(row: int, near: list[int]) -> None:
    """The edge between rows 49 and 50 lies in both."""
    label = shore()
    label[row] = WATER
    assert count_mask_errors(label, shore())[4].tolist() == near


def test_an_undecided_band_counts_as_edge_and_is_split_along_its_middle() -> None:
    truth = shore()
    truth[40:50] = IGNORE
    assert (fill_undecided(truth)[44] == OBSTACLE).all()
    assert (fill_undecided(truth)[45] == WATER).all()
    label = shore()
    label[:40] = OBSTACLE
    label[36] = WATER
    near = count_mask_errors(label, truth)[4]
    assert near.tolist() == [0, 80, 80]
    assert (fill_undecided(np.full((4, 4), IGNORE, np.uint8)) == IGNORE).all()


def test_the_best_answer_of_cells_loses_what_is_smaller_than_a_cell() -> None:
    height, width = CELLS_HW
    truth = np.full((height * 8, width * 8), WATER, np.uint8)
    truth[: height * 4] = SKY
    assert (round_to_cells(truth) == truth).all()
    truth[-3:, :3] = OBSTACLE
    truth[height * 4 : height * 4 + 5] = SKY
    best = round_to_cells(truth)
    assert not (best == OBSTACLE).any()
    assert (best[: height * 4 + 8] == SKY).all()


@pytest.mark.slow
def test_limits_are_added_per_source(tmp_path: Path) -> None:
    samples = PictureSelection(own_data(tmp_path), ["tbiseg_dasha"], None).segmented_samples(held_out=True)
    (limits,) = analyse_mask_errors(samples, lambda _picture, shape: np.zeros(shape[:2], np.uint8))
    assert (limits.n, limits.source.name) == (4, "tbiseg_dasha")
    assert water_iou(limits.counts) == 0.5
    assert limits.wrong == limits.false_water.sum() == limits.judged.sum() // 2
    assert limits.missed_water.sum() == 0
    assert edge_f1(limits.edges) == 0.0
    assert edge_f1(limits.best_edges) > 0.9
    assert "<td>0.500</td>" in render_mask_errors([limits])


def picture(truth: list[list[float]], found: list[tuple[list[float], float, int]]) -> ScoredBoxes:
    """Rows of truth: class and corners; of found: corners, score, class."""
    boxes = np.array([box for box, _, _ in found], np.float32).reshape(-1, 4)
    scores, kinds = np.array([s for _, s, _ in found], np.float32), np.array([k for _, _, k in found], np.int64)
    sample = Sample(HARBOUR, "a", held_out=True, picture=Path("a.jpg"), mask=None, label=None)
    return ScoredBoxes(sample, Detections(boxes, scores, kinds), np.array(truth, np.float32).reshape(-1, 5))


def test_each_object_has_one_fate() -> None:
    """Five vessels: found, too low, called a person, half boxed, alone."""
    truth = [[1.0, x, 0.0, x + 10.0, 10.0] for x in (0.0, 50.0, 100.0, 150.0, 200.0)]
    found = [
        ([0.0, 0.0, 10.0, 10.0], 0.9, 1),
        ([50.0, 0.0, 60.0, 10.0], 0.2, 1),
        ([100.0, 0.0, 110.0, 10.0], 0.9, 0),
        ([150.0, 0.0, 160.0, 4.0], 0.9, 1),
    ]
    assert dict(zip(OUTCOMES, count_outcomes(picture(truth, found), 1).tolist(), strict=True)) == dict.fromkeys(
        OUTCOMES, 1
    )
    assert count_outcomes(picture([], found), 1).sum() == 0


def test_heights_stand_apart() -> None:
    """A small vessel missed and a tall one found; what is found of one height harms no other."""
    truth = [[1.0, 0.0, 0.0, 6.0, 6.0], [1.0, 100.0, 0.0, 140.0, 40.0]]
    found = [([100.0, 0.0, 140.0, 40.0], 0.8, 1), ([200.0, 0.0, 240.0, 40.0], 0.9, 1)]
    (vessel,) = analyse_box_errors([picture(truth, found)])
    rows = {row.low: row for row in vessel.rows}
    assert (rows[4.0].n, rows[4.0].found, rows[4.0].ap50) == (1, 0, 0.0)
    assert (rows[32.0].n, rows[32.0].found, rows[32.0].ap50) == (1, 1, 0.5)
    assert rows[8.0].n == 0
    assert (vessel.kind, vessel.n, vessel.count_found_between(16.0, float("inf"))) == ("vessel", 2, (1, 1))
    assert (int(vessel.right.sum()), int(vessel.wrong.sum())) == (1, 1)
    assert "not seen" in render_box_errors([vessel])


def test_drawn_pictures_stay_out() -> None:
    (rendered,) = choose_sources(["rendered"])
    item = picture([[1.0, 0.0, 0.0, 6.0, 6.0]], [])
    drawn = ScoredBoxes(
        Sample(rendered, "a", held_out=True, picture=Path("a.jpg"), mask=None, label=None), item.detections, item.truth
    )
    assert analyse_box_errors([drawn]) == []
    assert [limits.n for limits in analyse_box_errors([item, drawn])] == [1]


def dasha(false_water: int) -> MaskErrors:
    (source,) = choose_sources(["tbiseg_dasha"])
    right = 1000 - false_water
    counts = np.array([[1000, 0, 0], [false_water, right, 0], [0, 0, 0]], np.int64)
    best = np.array([[1000, 0, 0], [0, 1000, 0], [0, 0, 0]], np.int64)
    tenths = np.full(10, false_water // 10)
    near = np.array([0, 0, false_water // 2])
    edges = np.ones(4, np.int64)
    return MaskErrors(source, 3, counts, edges, best, edges, near, tenths, tenths * 0, tenths)


def test_a_missed_bar_states_its_measured_reason() -> None:
    (missed,) = compare_with_requirements([dasha(1000)], [])
    assert (missed.value, missed.n, missed.is_met) == (0.5, 3, False)
    assert "50.0% of pixels that are wrong, 100% are something else taken for water" in missed.limit
    assert "50% lie more than 8 px" in missed.limit
    assert "reaches 1.000" in missed.limit
    (met,) = compare_with_requirements([dasha(10)], [])
    assert (met.is_met, met.limit) == (True, "")


def test_a_missed_box_requirement_names_sizes_and_outcomes() -> None:
    (person,) = compare_with_requirements([], analyse_box_errors([picture([[0.0, 0.0, 0.0, 3.0, 6.0]], [])]))
    assert (person.requirement.metric, person.value, person.n) == ("person_ap50", 0.0, 1)
    assert "Of 1 objects under 8 px high 0 are found" in person.limit
    assert "1 not seen" in person.limit


def test_an_image_quality_requirement_is_an_upper_bound_and_names_the_worst_faults() -> None:
    cells = (FaultCell("black", 1, 60, 60, 0.1), FaultCell("glare", 5, 60, 50, 0.59), FaultCell("fog", 1, 60, 0, 0.9))
    totals = FaultTotals(false_accept_frac=10 / 120, false_reject_frac=0.0, clean_reject_frac=0.01)
    faults = FaultReport(cells, (CleanSource("boats", 200, 2), CleanSource("river", 100, 0)), totals)
    accepted, refused, clean = compare_with_requirements([], [], faults)
    assert accepted.value == pytest.approx(10 / 120, abs=1e-4)
    assert (accepted.n, accepted.is_met) == (180, False)
    assert accepted.limit == "Wrong most often: 10 of 60 in glare 5 (mean IoU 0.59)."
    assert (refused.is_met, refused.limit) == (True, "")
    assert (clean.is_met, clean.limit) == (False, "Wrong most often: 2 of 200 in boats.")
    text = render_requirements([accepted], [])
    assert "at most 0.0050" in text
    assert "0.0833" in text


def test_the_present_weights_take_their_place_in_the_record(tmp_path: Path) -> None:
    catalogue = load_catalogue()
    found = [RequirementResult(REQUIREMENTS[1], 0.9, 3, "walls")]
    present = Experiment("segmenter", catalogue["segmenter"].sha256, "averaged", ())
    mirrored = msgspec.structs.replace(present, inference="mirrored too")
    old = Experiment("segmenter", "0" * 64, "smaller", ())
    rows = with_present_weights([old, present, mirrored], catalogue, found)
    assert [row.value("iou_water", "tbiseg_dasha", 3) for row in rows] == [None, 0.9, None]
    assert rows[1].value("iou_water", "tbiseg_dasha", 4) is None
    assert rows[1].recipe == "averaged"
    assert with_present_weights([old], catalogue, found)[-1].recipe == PRESENT_WEIGHTS
    (tmp_path / "experiments.json").write_bytes(encode_experiments(rows))
    assert read_experiments(tmp_path) == rows
    assert read_experiments(tmp_path / "other") == ()
    text = render_requirements(found, rows)
    assert "averaged; mirrored too" in text
    assert "missed" in text


def test_a_malformed_record_is_named(tmp_path: Path) -> None:
    (tmp_path / "experiments.json").write_text('{"experiments":[{"net":"segmenter"}]}')
    with pytest.raises(UserError, match=r"experiments\.json: .*sha256"):
        read_experiments(tmp_path)


def test_the_shipped_record_states_every_bar_of_the_shipped_weights() -> None:
    """Also of weights that were tried, and with the pictures or boxes that each figure rests on."""
    catalogue, shipped = load_catalogue(), read_experiments(WEIGHTS)
    for bar in REQUIREMENTS:
        mine = [row for row in shipped if row.net == bar.net]
        assert len(mine) >= 3
        assert all(figure.n > 0 for row in mine for figure in row.figures)
        (present,) = [row for row in mine if row.sha256 == catalogue[bar.net].sha256 and not row.inference]
        assert (bar.metric, bar.source) in {(figure.metric, figure.source) for figure in present.figures}
        assert present.recipe != PRESENT_WEIGHTS


def test_pictures_without_water_have_a_figure_of_their_own() -> None:
    dry = CleanSource("without_water", 16, 12)
    (figure,) = image_quality_figures(FaultReport((), without_water=dry))
    assert (figure.metric, figure.source, figure.value, figure.n) == ("unfit_accepted_frac", "without_water", 0.25, 16)
    assert image_quality_figures(FaultReport((), without_water=CleanSource("without_water", 0, 0))) == []
