"""Recall per track: of objects that stay in view over several frames, how many are seen once, in half, in every frame.

A true box goes on in the next frame where the nearest of its class has about its size. A detector has seen a frame of
a track where a box above its class's threshold overlaps the true one by IoU 0.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from paani.arrays import F32
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.metrics import iou_matrix
from paani_models.report.height_scores import MATCH_IOU, DetectorRun, PictureResult, Threshold, common_threshold

MIN_FRAMES = 3  # shorter ones are no track
LINK_SIDES = 1.5  # how far a centre moves from frame to frame, in mean longer sides of the two boxes
LINK_RATIO = 1.6  # of the two longer sides

Track = list[tuple[int, int]]  # frame and row of each true box


class TrackRecall(msgspec.Struct, frozen=True, kw_only=True):
    """One detector, class and source. once, half, all: shares of the tracks seen in one frame, half, all of them.

    wait_frames: median frames of a track before the first in which it is seen, those never seen left out; NaN for none.
    """

    detector: str
    kind: str
    source: str
    tracks: int
    frames: int
    once: float
    half: float
    all: float
    wait_frames: float


def link_tracks(frames: Sequence[F32]) -> list[Track]:
    """Corner boxes [n,4] of consecutive frames -> tracks of MIN_FRAMES and more, each box in one at most."""
    done: list[Track] = []
    going: list[Track] = []
    for index, boxes in enumerate(frames):
        free = set(range(len(boxes)))
        pairs = [
            (distance, number, row)
            for number, track in enumerate(going)
            for row in free
            if (distance := _link_distance(frames[index - 1][track[-1][1]], boxes[row])) <= LINK_SIDES
        ]
        followed: dict[int, int] = {}
        for _, number, row in sorted(pairs):
            if number not in followed and row in free:
                followed[number] = row
                free.remove(row)
        done += [track for number, track in enumerate(going) if number not in followed]
        going = [[*going[number], (index, row)] for number, row in followed.items()] + [[(index, r)] for r in free]
    return [track for track in (*done, *going) if len(track) >= MIN_FRAMES]


def _link_distance(before: F32, after: F32) -> float:
    """Between centres, in mean longer sides; infinite for boxes of too different a size."""
    longer = [float((box[2:] - box[:2]).max()) for box in (before, after)]
    if max(longer) > LINK_RATIO * min(longer):
        return float("inf")
    centres = [(box[2:] + box[:2]) / 2 for box in (before, after)]
    return float(np.hypot(*(centres[1] - centres[0]))) / max(1e-9, sum(longer) / 2)


def measure_tracks(
    results: Sequence[PictureResult], detectors: Sequence[DetectorRun], threshold: Threshold = common_threshold
) -> list[TrackRecall]:
    """Every source of video, class and detector that knows it."""
    rows = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        sequences: dict[tuple[str, str], list[PictureResult]] = {}
        for each in results:
            source = each.sample.source
            if source.video and label in source.annotated:
                sequences.setdefault((source.name, each.sample.sequence), []).append(each)
        for name in dict.fromkeys(source for source, _ in sequences):
            chosen = [frames for (source, _), frames in sequences.items() if source == name]
            for detector in detectors:
                seen = [s for frames in chosen for s in _seen_frames(frames, detector.name, kind, threshold(label))]
                if seen and label in detector.known:
                    rows.append(_row(detector.name, label, name, seen))
    return rows


def _seen_frames(frames: Sequence[PictureResult], detector: str, kind: int, threshold: float) -> list[list[bool]]:
    """For each track of a sequence, frame by frame, whether the detector has seen it."""
    truths = [frame.truth[frame.truth[:, 0] == kind, 1:] for frame in frames]
    hits = []
    for frame, truth in zip(frames, truths, strict=True):
        found = frame.found[detector]
        counted = found.boxes[(found.classes == kind) & (found.scores > threshold)]
        hits.append(iou_matrix(truth, counted).max(1, initial=0.0) >= MATCH_IOU)
    return [[bool(hits[index][row]) for index, row in track] for track in link_tracks(truths)]


def _row(detector: str, kind: str, source: str, seen: Sequence[Sequence[bool]]) -> TrackRecall:
    shares = np.array([np.mean(track) for track in seen])
    waits = [list(track).index(True) for track in seen if any(track)]
    return TrackRecall(
        detector=detector,
        kind=kind,
        source=source,
        tracks=len(seen),
        frames=sum(map(len, seen)),
        once=float((shares > 0).mean()),
        half=float((shares >= 0.5).mean()),
        all=float((shares == 1.0).mean()),
        wait_frames=float(np.median(waits)) if waits else float("nan"),
    )


def format_tracks(rows: Sequence[TrackRecall]) -> str:
    """One line per class, source and detector; a word where no source of video has tracks."""
    if not rows:
        return "No track of three frames in a source of video.\n"
    lines = ["Tracks of true boxes: shares seen in one frame at least, in half of the frames, in every one."]
    lines += [
        f"{r.kind:<7} {r.source:<24} {r.detector:<20} {r.tracks} tracks of {r.frames} frames:"
        f" once {r.once:.2f}, half {r.half:.2f}, all {r.all:.2f}; first seen after {r.wait_frames:.0f} frames (median)"
        for r in rows
    ]
    return "\n".join(lines) + "\n"
