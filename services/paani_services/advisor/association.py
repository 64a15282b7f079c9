"""Data association: which detection belongs to which track. Pure.

Greedy matching by intersection over union, best pair first (G2). It is done twice where the boat's rotation is known:
with the last box of each track, and with that box rotated to where it must be now.
"""

from collections.abc import Sequence
from typing import NamedTuple

from paani.boxes import iou
from paani.messages import BoxXyxy


class Assignment(NamedTuple):
    """The track of each detection, by index.

    `ambiguous`: detections that overlap another track, or whose track overlaps another detection.
    """

    track_of: dict[int, int]
    ambiguous: frozenset[int]


def assign_boxes(tracks: Sequence[BoxXyxy | None], detections: Sequence[BoxXyxy], min_iou: float) -> Assignment:
    """Match detections to tracks greedily, largest overlap first (G2); a track that is None matches nothing.

    Labels are not compared, because the detector may label one object differently from frame to frame.
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
    return Assignment(track_of, frozenset(d for d, t in track_of.items() if of_track[t] + of_detection[d] > 2))


def merge_assignments(by_place: Assignment, by_prediction: Assignment) -> Assignment:
    """Merge the matches by last box and by predicted box into one: the identity that each detection continues.

    A match by predicted box wins. Where there is none, the match by last box keeps its identity and is ambiguous.
    """
    taken = set(by_prediction.track_of.values())
    left = {d: t for d, t in by_place.track_of.items() if d not in by_prediction.track_of and t not in taken}
    return Assignment(by_prediction.track_of | left, by_prediction.ambiguous | left.keys())
