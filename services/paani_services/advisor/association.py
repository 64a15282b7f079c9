"""Which box goes with which of the picture before: by overlap, and by where the boat's turning put it. Pure."""

from collections.abc import Sequence
from typing import NamedTuple

from paani.messages import BoxXyxy


class Pairs(NamedTuple):
    """Which track each detection goes with, by index; `doubtful` detections could have gone elsewhere too."""

    track_of: dict[int, int]
    doubtful: frozenset[int]


def associate(tracks: Sequence[BoxXyxy | None], detections: Sequence[BoxXyxy], min_iou: float) -> Pairs:
    """Greedy pairs, best overlap first (G2); a track that is None has no place.

    Labels are not compared: one object may change its label from frame to frame.
    """
    candidates = sorted(
        (-overlap, t, d)
        for t, track in enumerate(tracks)
        if track is not None
        for d, detection in enumerate(detections)
        if track[0] < detection[2] and detection[0] < track[2] and (overlap := iou(track, detection)) >= min_iou
    )
    track_of: dict[int, int] = {}
    paired: set[int] = set()
    for _, t, d in candidates:
        if t not in paired and d not in track_of:
            track_of[d] = t
            paired.add(t)
    of_track, of_detection = [0] * len(tracks), [0] * len(detections)
    for _, t, d in candidates:
        of_track[t] += 1
        of_detection[d] += 1
    return Pairs(track_of, frozenset(d for d, t in track_of.items() if of_track[t] + of_detection[d] > 2))


def kinship(seen: Pairs, expected: Pairs) -> Pairs:
    """Whose identity each detection goes on with, given the pairs by last place and by place after the boat's turning.

    The turning decides. Where it explains nothing, a pair by last place keeps its identity, in doubt.
    """
    taken = set(expected.track_of.values())
    left = {d: t for d, t in seen.track_of.items() if d not in expected.track_of and t not in taken}
    return Pairs(expected.track_of | left, expected.doubtful | left.keys())


def iou(a: BoxXyxy, b: BoxXyxy) -> float:
    """Intersection over union of two sound boxes."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    if width <= 0.0:
        return 0.0
    height = min(a[3], b[3]) - max(a[1], b[1])
    if height <= 0.0:
        return 0.0
    both = width * height
    return both / (area(a) + area(b) - both)


def area(box: BoxXyxy) -> float:
    """Of the picture."""
    return (box[2] - box[0]) * (box[3] - box[1])
