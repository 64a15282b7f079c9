"""Recall per track: how boxes are linked from frame to frame, and what a detector that blinks is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paani_models.datasets.sources import Sample, Source
from paani_models.detector.metrics import Detections
from paani_models.report.height_scores import DetectorRun, PictureResult
from paani_models.report.track_recall import format_tracks, link_tracks, measure_tracks

LAKE = Source("lake", "lake", labels="labels", annotated=frozenset({"person", "buoy"}), video=True)
STILLS = Source("stills", "stills", labels="labels", annotated=frozenset({"person"}))
SEEN, BLIND = "seen", "blind"


def never(*_: object) -> Detections:
    raise AssertionError


RUNS = [DetectorRun(name, frozenset({"person"}), never) for name in (SEEN, BLIND)]


def square(x: float, side: float = 20.0) -> list[float]:
    return [x, 40.0, x + side, 40.0 + side]


def test_boxes_are_linked_by_place_and_size() -> None:
    """Two that pass on the left and right, one that ends after two frames, one that jumps, one that swells at once."""
    frames = [
        [square(0), square(100), square(200), square(300)],
        [square(10), square(90), square(200), square(400)],
        [square(20), square(80), square(200, 60.0), square(500)],
    ]
    boxes = [np.array(frame, np.float32) for frame in frames]
    assert link_tracks(boxes) == [[(0, 0), (1, 0), (2, 0)], [(0, 1), (1, 1), (2, 1)]]
    assert link_tracks([]) == []
    assert link_tracks([boxes[0], np.zeros((0, 4), np.float32), *boxes[:1] * 3])[0] == [(2, 0), (3, 0), (4, 0)]


def test_the_nearest_goes_on() -> None:
    """A newcomer between two frames does not take the track of who is nearer."""
    boxes = [np.array(frame, np.float32) for frame in ([square(0)], [square(25), square(5)], [square(10), square(30)])]
    assert link_tracks(boxes) == [[(0, 0), (1, 1), (2, 0)]]


def lake(xs: list[float], hits: list[bool], score: float, source: Source = LAKE) -> list[PictureResult]:
    """One person a frame, and a box on it where it is hit, else beside it."""
    results = []
    for index, (x, hit) in enumerate(zip(xs, hits, strict=True)):
        truth = np.array([[0, *square(x)]], np.float32)
        boxes = np.array([square(x if hit else x + 200)], np.float32)
        sample = Sample(source, "s", held_out=True, picture=Path(f"{index}.jpg"), mask=None, label=Path("p.txt"))
        box = Detections(boxes, np.array([score], np.float32), np.zeros(1, np.int64))
        none = Detections(boxes[:0], np.zeros(0, np.float32), np.zeros(0, np.int64))
        results.append(PictureResult(sample, truth, {SEEN: box, BLIND: none}))
    return results


def test_a_detector_that_blinks_has_seen_half() -> None:
    frames = lake([0, 5, 10, 15], [False, True, True, False], 0.5)
    seen, blind = measure_tracks(frames, RUNS, lambda kind: 0.4)
    assert (seen.detector, seen.tracks, seen.frames) == (SEEN, 1, 4)
    assert (seen.once, seen.half, seen.all, seen.wait_frames) == (1.0, 1.0, 0.0, 1.0)
    assert (blind.once, blind.half) == (0.0, 0.0)
    assert np.isnan(blind.wait_frames)
    assert "1 tracks of 4 frames: once 1.00, half 1.00, all 0.00" in format_tracks([seen])


@pytest.mark.parametrize(("threshold", "half"), [(0.4, 1.0), (0.5, 0.0)])
def test_only_boxes_above_the_threshold_count(threshold: float, half: float) -> None:
    frames = lake([0, 5, 10], [True, True, False], 0.5)
    assert measure_tracks(frames, RUNS, lambda kind: threshold)[0].half == half


def test_stills_have_no_tracks() -> None:
    assert measure_tracks(lake([0, 5, 10], [True] * 3, 0.5, STILLS), RUNS, lambda kind: 0.4) == []
    assert "No track" in format_tracks([])
