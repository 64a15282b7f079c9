"""Association of the measurements of one obstacle over the pictures or scans that show it. Pure."""

import functools
import math
from collections.abc import Iterable, Sequence

from paani.messages import Label
from paani_services.navigator.mapping.box_measurement import MeasuredPicture
from paani_services.navigator.mapping.observation import MAX_OBSERVATIONS
from paani_services.navigator.mapping.velocity_fit import PositionMeasurement

# By how much an obstacle, seen whole, may be wider or higher in one of two pictures. Measured: 98 % of pairs are alike
# within this, wrong ones among them.
MAX_SIZE_RATIO = 1.6
GATE_M, GATE_MPS = 0.5, 1.2  # validation gate between two measurements: an obstacle's size, and its highest speed
OTHER_LABEL_M = 0.5  # by which what is labelled otherwise counts as further away: the size of an obstacle
CACHED_PAIRS = 4 * MAX_OBSERVATIONS  # of pictures: a track goes on in the next picture, or a few later


def associate_measurements(pictures: Iterable[MeasuredPicture], fit_s: float) -> list[list[PositionMeasurement]]:
    """The measurements of each obstacle, oldest first, as the pictures are; none goes on after `fit_s` unseen.

    Association is greedy nearest neighbour within a validation gate (Bar-Shalom, Li, Kirubarajan: "Estimation with
    Applications to Tracking and Navigation", 2001). The detector takes one hull for a vessel in this picture and for a
    buoy in the next, so another label counts as `OTHER_LABEL_M` further away; but no person is taken for a thing.
    """
    tracks: list[list[PositionMeasurement]] = []
    recent: dict[MeasuredPicture, dict[int, int]] = {}  # by picture: the track that each of its measurements ends
    fit_us = round(fit_s * 1e6)
    for picture in pictures:
        recent = {last: ends for last, ends in recent.items() if ends and picture.stamp_us - last.stamp_us <= fit_us}
        newest = tuple((last, tuple(ends)) for last, ends in recent.items())
        track_of = {f: recent[last].pop(number) for last, number, f in _match_nearest(newest, picture)}
        recent[picture] = track_of
        for f, each in enumerate(picture.measurements):
            if f in track_of:
                tracks[track_of[f]].append(each)
            else:
                track_of[f] = len(tracks)
                tracks.append([each])
    return tracks


@functools.lru_cache(maxsize=CACHED_PAIRS)
def _match_nearest(
    newest: tuple[tuple[MeasuredPicture, tuple[int, ...]], ...], picture: MeasuredPicture
) -> Sequence[tuple[MeasuredPicture, int, int]]:
    """The pairs of a track's newest measurement, by picture and number, and the number of the one that it goes on with.

    newest: of each earlier picture, the numbers of its measurements that are the newest of a track.
    """
    pairs = [
        (distance_m, order, number, f)
        for order, (last, numbers) in enumerate(newest)
        for number in numbers
        for distance_m, f in _find_matches(last, picture)[number]
    ]
    matched, extended, found = set[int](), set[tuple[int, int]](), []
    for _, order, number, f in sorted(pairs):
        if f not in matched and (order, number) not in extended:
            matched.add(f)
            extended.add((order, number))
            found.append((newest[order][0], number, f))
    return found


@functools.lru_cache(maxsize=CACHED_PAIRS)
def _find_matches(before: MeasuredPicture, after: MeasuredPicture) -> Sequence[Sequence[tuple[float, int]]]:
    """For each measurement of one picture, the distance as it counts and number of those of a later one in its gate."""
    within_m = GATE_M + GATE_MPS * ((after.stamp_us - before.stamp_us) * 1e-6)
    return [
        [
            (distance_m + OTHER_LABEL_M * (each.label is not last.label), f)
            for f, each in enumerate(after.measurements)
            if _may_be_one(each, last)
            and (distance_m := math.dist(last.position_m, each.position_m))
            <= within_m + last.gate_deviation_m + each.gate_deviation_m
        ]
        for last in before.measurements
    ]


def _may_be_one(each: PositionMeasurement, other: PositionMeasurement) -> bool:
    """Whether the detector may label one and the same obstacle so, and both show it about as large."""
    is_same_kind = each.label is other.label or Label.PERSON not in (each.label, other.label)
    if not (is_same_kind and each.is_whole and other.is_whole):
        return is_same_kind
    return all(
        a < MAX_SIZE_RATIO * b and b < MAX_SIZE_RATIO * a for a, b in zip(each.size_m, other.size_m, strict=True)
    )
