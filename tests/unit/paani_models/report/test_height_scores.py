"""Detectors by height of the true box: what counts in a range, and intervals over sequences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paani_models.datasets.sources import Sample, Source
from paani_models.detector.metrics import Detections, average_precision, iou_matrix, match_class, summarise_class
from paani_models.detector.scores import ScoredBoxes
from paani_models.report.box_errors import analyse_box_errors
from paani_models.report.height_scores import (
    ANY_HEIGHT_PX,
    DetectorRun,
    HeightRow,
    PictureResult,
    count_seen,
    match_in_range,
    score_heights,
)
from paani_models.report.height_table import format_height_table

RIVER = Source("river", "river", labels="labels", annotated=frozenset({"person"}))


def detections(*rows: tuple[float, float, float, float, float]) -> Detections:
    """People: score and corners."""
    table = np.array(rows, np.float32).reshape(-1, 5)
    return Detections(table[:, 1:], table[:, 0], np.zeros(len(table), np.int64))


def people(*boxes: tuple[float, float, float, float]) -> np.ndarray:
    return np.array([(0, *box) for box in boxes], np.float32).reshape(-1, 5)


def test_only_boxes_of_the_range_are_required_and_counted() -> None:
    """A small and a tall person, both found; a small and a tall box of nothing."""
    truth = people((0, 0, 10, 12), (100, 0, 140, 80))
    found = detections((0.9, 0, 0, 10, 12), (0.8, 100, 0, 140, 80), (0.7, 200, 0, 205, 10), (0.6, 300, 0, 340, 90))
    for range_px, scores in (((8.0, 16.0), (0.9, 0.7)), ((64.0, np.inf), (0.8, 0.6))):
        kept, hits, positives = match_in_range(found, truth, 0, range_px)
        assert kept == pytest.approx(scores)
        assert hits.tolist() == [True, False]
        assert positives == 1


def test_who_is_boxed_badly_is_seen_and_not_recalled() -> None:
    """Two people in one box, a box of a third, a fourth whose box is too sure of nothing, and one of another height."""
    truth = people((0, 0, 40, 80), (40, 0, 80, 80), (100, 0, 140, 80), (200, 0, 240, 80), (300, 0, 310, 12))
    found = detections((0.9, 0, 0, 80, 160), (0.8, 100, 0, 140, 80), (0.4, 200, 0, 240, 80), (0.9, 300, 0, 310, 12))
    assert count_seen(found, truth, 0, (64.0, np.inf), 0.40) == 3
    assert count_seen(found, truth, 0, (64.0, np.inf), 0.39) == 4
    assert count_seen(found, truth, 0, (8.0, 16.0), 0.40) == 1
    assert count_seen(found, truth, 1, (64.0, np.inf), 0.40) == 0
    assert count_seen(detections(), truth, 0, (64.0, np.inf), 0.40) == 0
    assert count_seen(found, people(), 0, (64.0, np.inf), 0.40) == 0


def test_a_second_box_on_one_person_is_an_alarm() -> None:
    _, hits, _ = match_in_range(
        detections((0.9, 0, 0, 10, 12), (0.8, 0, 0, 10, 11.5)), people((0, 0, 10, 12)), 0, (8.0, 16.0)
    )
    assert hits.tolist() == [True, False]


def coco_matches(found: Detections, truth: np.ndarray, low: float, high: float) -> tuple[list[float], list[bool]]:
    """COCO's rules one box at a time: true boxes out of range come last, and who takes one of them does not count."""
    is_other = [not low <= box[3] - box[1] < high for box in truth[:, 1:]]
    order, taken, scores, hits = sorted(range(len(truth)), key=lambda row: is_other[row]), set(), [], []
    for mine in sorted(range(len(found.scores)), key=lambda row: -found.scores[row]):
        best, chosen = 0.5, None
        for row in order:
            if row in taken or (chosen is not None and not is_other[chosen] and is_other[row]):
                continue
            shared = iou_matrix(found.boxes[mine : mine + 1], truth[row : row + 1, 1:])[0, 0]
            if shared >= best:
                best, chosen = shared, row
        if chosen is not None:
            taken.add(chosen)
        is_own = low <= found.boxes[mine, 3] - found.boxes[mine, 1] < high
        if is_own if chosen is None else not is_other[chosen]:
            scores.append(float(found.scores[mine]))
            hits.append(chosen is not None)
    return scores, hits


@pytest.mark.parametrize("seed", range(20))
def test_ranges_of_height_are_scored_by_cocos_rules(seed: int) -> None:
    """Crowded boxes about 16 px high, many of which lie on several people of either range; equal scores among them."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 30, (8, 2))
    truth = people(*((*corner, *(corner + rng.uniform(11, 21, 2))) for corner in corners))
    drawn = truth[rng.integers(0, 8, 20), 1:] + rng.normal(0, 1.5, (20, 4))
    found = detections(*((score, *box) for score, box in zip(rng.choice([0.3, 0.6, 0.9], 20), drawn, strict=True)))
    sample = Sample(RIVER, "a", held_out=True, picture=Path("p.jpg"), mask=None, label=None)
    (errors,) = analyse_box_errors([ScoredBoxes(sample, found, truth)])
    for band in errors.rows[2:4]:
        scores, hits = coco_matches(found, truth, band.low, band.high)
        kept, are_hits, positives = match_in_range(found, truth, 0, (band.low, band.high))
        assert (kept.tolist(), are_hits.tolist(), positives) == (pytest.approx(scores), hits, band.n)
        assert band.found == sum(hit for score, hit in zip(scores, hits, strict=True) if score > 0.40)
        expected = average_precision(np.array(scores, np.float32), np.array(hits, np.bool_), band.n)
        assert band.ap50 == pytest.approx(expected, nan_ok=True)


def results(seed: int = 0) -> tuple[list[PictureResult], list[DetectorRun]]:
    """Forty pictures of ten sequences: one detector finds what it is shown with an error, one finds nothing."""
    rng = np.random.default_rng(seed)
    pictures = []
    for index in range(40):
        corner = rng.uniform(0, 200, (2, 2))
        truth = people(*((*c, *(c + rng.uniform(10, 90, 2))) for c in corner))
        boxes = truth[:, 1:] + rng.normal(0, 4, (2, 4)).astype(np.float32)
        noisy = Detections(boxes.astype(np.float32), rng.random(2).astype(np.float32), np.zeros(2, np.int64))
        sample = Sample(RIVER, f"seq{index // 4}", held_out=True, picture=Path("p.jpg"), mask=None, label=Path("p.txt"))
        pictures.append(PictureResult(sample, truth, {"noisy": noisy, "blind": detections()}))

    def never(*_: object) -> Detections:
        raise AssertionError

    runs = [DetectorRun("noisy", frozenset({"person"}), never), DetectorRun("blind", frozenset({"person"}), never)]
    return pictures, [*runs, DetectorRun("other", frozenset({"vessel"}), never)]


def any_height(rows: list[HeightRow], detector: str) -> HeightRow:
    return next(r for r in rows if r.detector == detector and (r.low_px, r.high_px) == ANY_HEIGHT_PX)


@pytest.mark.slow
def test_over_all_heights_the_figures_are_those_of_the_manifest() -> None:
    pictures, runs = results()
    row = any_height(score_heights(pictures, runs), "noisy")
    known = summarise_class([match_class(p.found["noisy"], p.truth, 0) for p in pictures])
    assert row.n == known["n"] == 80
    assert row.recall.value < row.seen.value < 1.0
    assert row.recall.low < row.seen.low <= row.seen.value <= row.seen.high
    assert row.ap50.value == pytest.approx(known["ap50"])
    assert row.recall.value == pytest.approx(known["recall_at_0.40"])
    assert row.precision.value == pytest.approx(known["precision_at_0.40"])
    assert row.sequences == 10
    for each in (row.ap50, row.recall, row.precision):
        assert each.low < each.value < each.high


@pytest.mark.slow
def test_who_finds_nothing_has_no_precision_and_who_does_not_know_a_class_no_row() -> None:
    rows = score_heights(*results())
    assert {row.detector for row in rows} == {"noisy", "blind"}
    blind = any_height(rows, "blind")
    assert (blind.ap50.value, blind.recall.value) == (0.0, 0.0)
    assert np.isnan(blind.precision.value)
    table = format_height_table(rows)
    assert "16-32" in table
    assert ">64" in table
    assert all(len(line) < 160 for line in table.splitlines())


def test_one_sequence_has_no_interval() -> None:
    pictures, runs = results()
    row = any_height(score_heights(pictures[:4], runs), "noisy")
    assert np.isnan(row.ap50.low)
    assert not np.isnan(row.ap50.value)
