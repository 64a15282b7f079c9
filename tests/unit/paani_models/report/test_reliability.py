"""Reliability of scores: bins, expected calibration error, and the threshold that a class is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paani_models.datasets.sources import Sample, Source
from paani_models.detector.metrics import Detections
from paani_models.report.height_scores import DetectorRun, PictureResult, score_heights, truth_pictures
from paani_models.report.reliability import Reliability, calibration_error, format_reliability, measure_reliability

LAKE = Source("lake", "lake", labels="labels", annotated=frozenset({"person", "buoy"}))
BEACH = Source("beach", "beach", labels="labels", annotated=frozenset({"person"}), loose_boxes=True)
PLACES = np.array([[40 * i, 40, 40 * i + 30, 70] for i in range(10)], np.float32)


def never(*_: object) -> Detections:
    raise AssertionError


RUNS = [DetectorRun("own", frozenset({"person", "buoy"}), never)]


def picture(scores: list[float], right: list[bool], kind: int, sequence: str, source: Source = LAKE) -> PictureResult:
    """One box a place, of which those that are right lie on a true one; two true ones that nobody finds."""
    boxes = PLACES[: len(scores)]
    lost = np.array([[0, 200, 30, 230], [40, 200, 70, 230]], np.float32)
    true = np.vstack([boxes[np.array(right)], lost])
    truth = np.hstack([np.full((len(true), 1), kind, np.float32), true])
    sample = Sample(source, sequence, held_out=True, picture=Path("p.jpg"), mask=None, label=Path("p.txt"))
    found = Detections(boxes, np.array(scores, np.float32), np.full(len(scores), kind))
    return PictureResult(sample, truth, {"own": found})


def measure(*pictures: PictureResult) -> Reliability:
    (row,) = measure_reliability(pictures, RUNS)
    return row


def test_the_error_is_the_mean_distance_of_score_and_share_right() -> None:
    """Of four boxes at 0.85 three are right, of four at 0.25 one; a box below 0.1 is none."""
    scores = [0.85] * 4 + [0.25] * 4 + [0.05]
    right = [True, True, True, False, True, False, False, False, False]
    row = measure(picture(scores, right, 3, "a"), picture(scores, right, 3, "b"))
    assert [(b.low, b.n) for b in row.bins] == [(0.2, 8), (0.8, 8)]
    assert [b.right_frac for b in row.bins] == pytest.approx([0.25, 0.75])
    assert [b.mean_score for b in row.bins] == pytest.approx([0.25, 0.85])
    assert row.error.value == pytest.approx((0.0 + 0.1) / 2)
    assert (row.error.low, row.error.high) == pytest.approx((0.05, 0.05))  # both sequences are alike
    assert (row.boxes, row.positives) == (16, 12)
    assert "0.85->0.75 (8)" in format_reliability([row])


def test_every_bin_adds_its_distance_whichever_way_it_lies() -> None:
    """Two bins too sure and one not sure enough: 0.4 and 1.0 and 0.6 of ten boxes."""
    cells = np.array([[4.0, 3.4, 3.0], [4.0, 2.0, 1.0], [2.0, 0.4, 1.0]])
    assert calibration_error(cells) == pytest.approx(0.2)


def test_a_person_is_worth_more_false_alarms_than_a_buoy() -> None:
    """One in four is right between 0.2 and 0.3: too few for a buoy, enough for a person."""
    scores = [0.85] * 4 + [0.25] * 4
    right = [True, True, True, True, True, False, False, False]
    buoy, person = measure(picture(scores, right, 3, "a")), measure(picture(scores, right, 0, "a"))
    assert (buoy.threshold, buoy.recall, buoy.precision) == pytest.approx((0.25, 4 / 7, 1.0))
    assert (person.threshold, person.recall, person.precision) == pytest.approx((0.10, 5 / 7, 5 / 8))
    assert np.isnan(buoy.error.low)  # one sequence


def test_loose_boxes_are_no_truth() -> None:
    good, loose = picture([0.9], [True], 0, "a"), picture([0.9], [False], 0, "b", BEACH)
    assert truth_pictures([good, loose], "person") == [good]
    assert measure(good, loose).boxes == 1
    rows = {r.source: r.n for r in score_heights([good, loose], RUNS) if np.isinf(r.high_px) and r.low_px == 0.0}
    assert rows == {"lake": 3, "beach": 2, "all": 3}
    assert measure_reliability([picture([0.05], [True], 0, "a")], RUNS) == []
