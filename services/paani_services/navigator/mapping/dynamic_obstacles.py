"""What moves on the water, and how fast: from where boxes stood in the pictures remembered. Pure.

A thing's places are fitted with a constant velocity. What cannot be told from standing stands.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.mapping.observation import BOX_COLUMNS, FOOT_STEPS, Box, Sight
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera, hull_top
from paani_services.navigator.mapping.occupancy_grid import CELLS, Grid, Moving
from paani_services.navigator.mapping.projection import Lens, lens_at, ranges_m, rays, together

ROW = 1.0 / 240.0  # of the picture's height: how exactly a box's lower end is known
HULL_ROWS = 2.0  # and a hull's, which the mask ends: half a row of 64, and so for as long as it takes to the next
PLACE_M, ACROSS_ROWS = 0.05, 2.3  # and everything else of its place, near and far
OF_WIDTH = 0.03  # what shows of a thing changes with the side it shows
SIGNIFICANT = 4.0  # standard deviations of a velocity that is no chance
STILL_MPS = 0.08  # slower things stand: Q6's drift covers them
DRIFT_FIT_S, DRIFT_MPS = 8.0, 0.3  # what drifts goes a metre meanwhile, and no faster
DRIFT_DEVIATION_MPS = 0.05  # measured; a hull shows other parts of itself as it is passed
FIXES, SPAN_S = 3, 0.7  # fewer or shorter say nothing
FIXES_HZ = 5.0  # errors of pictures that follow faster are the same
LOST_S = 1.0  # five pictures
EXPECTED = 5.0  # degrees of freedom
USUAL_MPS = 0.7  # of what moves: how far the fit goes from rest without evidence
GATE_M, GATE_MPS = 0.5, 1.2  # between two places of one thing: its size, and how fast it may be
CUT = 4  # a box that comes this near to the picture's sides [1/512] may go on beyond

Symmetric = tuple[float, float, float]  # a 2 x 2 matrix: east-east, east-north, north-north
Pair = tuple[float, float]


class Fix(NamedTuple):
    """Where a thing stood in one picture, east and north [m], and what that is worth: the inverse of its covariance.

    box: which, as in `Moving` of the grid. at_s: from now, negative. along_m: standard deviation of its range.
    outline: points where it meets the water, from left to right. ends: whether the picture shows its left, its right
    one; whole: both.
    """

    box: tuple[int, int]
    label: Label
    at_s: float
    place_m: Pair
    weight: Symmetric
    along_m: float
    outline: tuple[F64, F64]
    ends: tuple[bool, bool]

    @property
    def whole(self) -> bool:
        """Not cut by the picture's sides."""
        return all(self.ends)


class Motion(NamedTuple):
    """Velocity, and its standard deviation in the direction in which that is larger."""

    east_mps: float
    north_mps: float
    deviation_mps: float


class Fit(NamedTuple):
    """A velocity, and the inverse of its covariance times it, which says how far from chance it is.

    deviation_mps: as in `Motion`.
    """

    velocity_mps: Pair
    pull: Pair
    deviation_mps: float

    @property
    def certainty(self) -> float:
        """Standard deviations between it and rest, squared."""
        return self.velocity_mps[0] * self.pull[0] + self.velocity_mps[1] * self.pull[1]


class Mover(NamedTuple):
    """A thing that moves: its outline now [n], the room to keep around it, its motion, when last seen, whole or adrift.

    boxes: what it has left behind; where it was within `free_s` of when it was last seen stays occupied.
    """

    east_m: F64
    north_m: F64
    room_m: float
    motion: Motion
    age_s: float
    boxes: Moving

    @property
    def is_sure(self) -> bool:
        """It moves for certain; a person who may swim has a deviation alone."""
        return any(self.motion[:2])


def movers(sights: tuple[Sight, ...], now_us: int, camera: Camera, config: PlannerConfig) -> tuple[Mover, ...]:
    """Everything that moved for certain when it was last seen whole, vessels adrift, and people in sight.

    sights: oldest first.
    """
    found = []
    for track in _tracks(sights, now_us, camera, config):
        whole = [fix for fix in track if fix.whole]
        motion, last = motion_of(whole, config.fit_s), whole[-1] if whole else track[-1]
        if motion is None and track[-1].label is Label.VESSEL:
            motion, last = _drift_of(track, whole), track[-1]
        if motion is None:
            if track[-1].label is Label.PERSON and len(track) > 1 and -track[-1].at_s <= config.occupied_s:
                found.append(_person(track, config))
            continue
        found.append(
            Mover(
                last.outline[0] - last.at_s * motion.east_mps,
                last.outline[1] - last.at_s * motion.north_mps,
                config.person_near_m if last.label is Label.PERSON else config.vessel_near_m,
                motion,
                -last.at_s,
                frozenset(fix.box for fix in track if fix.at_s < track[-1].at_s - config.free_s),
            )
        )
    return tuple(found)


def _drift_of(track: list[Fix], whole: list[Fix]) -> Motion | None:
    """Of a vessel, over `DRIFT_FIT_S`: of its middle; of the surer end where too few pictures show it whole."""
    fitted = _lately_fitted(whole, track[-1].at_s)
    if fitted is None:
        ends = [_lately_fitted(_placed_at_end(track, end), track[-1].at_s) for end in (0, 1)]
        fitted = max((fit for fit in ends if fit is not None), key=lambda fit: fit.certainty, default=None)
    motion = _unless_chance(fitted)
    if motion is None or math.hypot(*motion[:2]) > DRIFT_MPS:
        return None
    return motion._replace(deviation_mps=max(motion.deviation_mps, DRIFT_DEVIATION_MPS))


def _lately_fitted(fixes: list[Fix], last_s: float) -> Fit | None:
    return _fitted(fixes, DRIFT_FIT_S) if fixes and last_s - fixes[-1].at_s <= DRIFT_FIT_S else None


def _placed_at_end(track: list[Fix], end: int) -> list[Fix]:
    """The fixes that show its left end, 0, or its right one, 1: placed there."""
    return [
        fix._replace(place_m=(float(fix.outline[0][-end]), float(fix.outline[1][-end])))
        for fix in track
        if fix.ends[end]
    ]


def _person(track: list[Fix], config: PlannerConfig) -> Mover:
    """A person seen more than once, who may stand or swim anywhere: as fast as the fixes do not rule out, cut ones too.

    Where they are stays occupied.
    """
    fitted, last = _fitted(track, config.fit_s), track[-1]
    fastest_mps = config.person_mps
    if fitted is not None:
        fastest_mps = min(fastest_mps, math.hypot(*fitted.velocity_mps) + fitted.deviation_mps)
    return Mover(*last.outline, config.person_near_m, Motion(0.0, 0.0, fastest_mps), -last.at_s, frozenset())


def is_denied(mover: Mover, grid: Grid) -> bool:
    """Out of sight for `LOST_S`, and the last pictures show water all over where it should be: it did not go on."""
    if mover.age_s < LOST_S:
        return False
    column = np.floor((mover.east_m - grid.west_m) / CELL_M).astype(np.int64)
    row = np.floor((mover.north_m - grid.south_m) / CELL_M).astype(np.int64)
    on_grid = (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    return bool(on_grid.all() and grid.free[row, column].all())


def motion_of(fixes: list[Fix], fit_s: float) -> Motion | None:
    """The velocity over the last `fit_s`; None where it may be chance."""
    return _unless_chance(_fitted(fixes, fit_s))


def _unless_chance(fitted: Fit | None) -> Motion | None:
    if fitted is None or fitted.certainty < SIGNIFICANT * SIGNIFICANT or math.hypot(*fitted.velocity_mps) < STILL_MPS:
        return None
    return Motion(*fitted.velocity_mps, fitted.deviation_mps)


def _fitted(fixes: list[Fix], fit_s: float) -> Fit | None:
    """The weighted least squares' velocity over the last `fit_s`, drawn towards rest; None of too few fixes.

    With place and velocity as unknowns the normal equations are [W, T; T, S] [p; v] = [a; b], each a 2 x 2 matrix:
    (S - T W^-1 T) v = b - T W^-1 a.
    """
    fixes = [fix for fix in fixes if fixes[-1].at_s - fix.at_s <= fit_s]
    span_s = fixes[-1].at_s - fixes[0].at_s if fixes else 0.0
    if len(fixes) < FIXES or span_s < SPAN_S:
        return None
    weights = times = squares = (0.0, 0.0, 0.0)
    places = moments = (0.0, 0.0)
    first = fixes[0]
    for fix in fixes:
        t_s = fix.at_s - first.at_s
        pull = _times(fix.weight, (fix.place_m[0] - first.place_m[0], fix.place_m[1] - first.place_m[1]))
        weights, times = _plus(weights, 1.0, fix.weight), _plus(times, t_s, fix.weight)
        squares = _plus(squares, t_s * t_s, fix.weight)
        places = (places[0] + pull[0], places[1] + pull[1])
        moments = (moments[0] + t_s * pull[0], moments[1] + t_s * pull[1])
    inverse = _inverse(weights)
    drawn = _times(times, _times(inverse, places))
    pull = (moments[0] - drawn[0], moments[1] - drawn[1])
    told = _plus(squares, -1.0, _between(times, inverse))
    # Pictures that follow fast, and places that lie further off the line than they should, tell less; others more.
    fast = min(1.0, (1.0 + FIXES_HZ * span_s) / len(fixes))
    share = fast / _misfit(fixes, _times(_inverse(told), pull), inverse, places, times)
    rest = 1.0 / (USUAL_MPS * USUAL_MPS)
    covariance = _inverse(_plus((rest, 0.0, rest), share, told))
    pull = (share * pull[0], share * pull[1])
    return Fit(_times(covariance, pull), pull, math.sqrt(max(covariance[0], covariance[2])))


def _misfit(fixes: list[Fix], velocity: Pair, inverse: Symmetric, places: Pair, times: Symmetric) -> float:
    """Squared residuals over variances, for each degree of freedom: 1 where the errors are as expected.

    `EXPECTED` more that are so keep it from what a few fixes show by chance.
    """
    moved = _times(times, velocity)
    start = _times(inverse, (places[0] - moved[0], places[1] - moved[1]))
    total, first = 0.0, fixes[0]
    for fix in fixes:
        t_s = fix.at_s - first.at_s
        off = (
            fix.place_m[0] - first.place_m[0] - start[0] - t_s * velocity[0],
            fix.place_m[1] - first.place_m[1] - start[1] - t_s * velocity[1],
        )
        pull = _times(fix.weight, off)
        total += off[0] * pull[0] + off[1] * pull[1]
    return (total + EXPECTED) / (2 * len(fixes) - 4 + EXPECTED)


def _tracks(sights: tuple[Sight, ...], now_us: int, camera: Camera, config: PlannerConfig) -> list[list[Fix]]:
    """The fixes of each thing, oldest first: of one kind, the nearest to the nearest within a gate."""
    tracks: list[list[Fix]] = []
    for fixes in _fixes(sights, now_us, camera, config):
        pairs = sorted(
            (math.dist(track[-1].place_m, fix.place_m), t, f)
            for t, track in enumerate(tracks)
            for f, fix in enumerate(fixes)
            if track[-1].label is fix.label and fix.at_s - track[-1].at_s <= config.fit_s
        )
        taken: set[int] = set()
        extended: set[int] = set()
        for away_m, t, f in pairs:
            last, fix = tracks[t][-1], fixes[f]
            gate_m = GATE_M + GATE_MPS * (fix.at_s - last.at_s) + last.along_m + fix.along_m
            if t not in extended and f not in taken and away_m <= gate_m:
                tracks[t].append(fix)
                extended.add(t)
                taken.add(f)
        tracks += [[fix] for f, fix in enumerate(fixes) if f not in taken]
    return tracks


def _fixes(sights: tuple[Sight, ...], now_us: int, camera: Camera, config: PlannerConfig) -> Iterator[list[Fix]]:
    """Of each picture with boxes, where those stand whose whole outline is within reach."""
    shown = [sight for sight in sights if sight.boxes and sight.at_us <= now_us]
    if not shown:
        return
    lenses = [lens_at(sight.station, camera.calibration, sight.aspect) for sight in shown]
    lens = together([own for sight, own in zip(shown, lenses, strict=True) for _ in sight.boxes])
    boxes = [box for sight in shown for box in sight.boxes]
    left, right = (np.array(sides)[:, None] for sides in ([box.left for box in boxes], [box.right for box in boxes]))
    u = (left + (right - left) * ((np.arange(BOX_COLUMNS) + 0.5) / BOX_COLUMNS)) / FOOT_STEPS
    v = np.array([box.ends for box in boxes]) / FOOT_STEPS
    given = rays(lens, u, np.minimum(v, hull_top(camera.hull, u)))
    range_m = ranges_m(lens, given, config.mover_range_m)
    east_m: F64 = lens.at_m[0] + range_m * given.east
    north_m: F64 = lens.at_m[1] + range_m * given.north
    reached = set(np.flatnonzero(np.isfinite(range_m).all(axis=1)).tolist())
    row = 0
    for sight, own in zip(shown, lenses, strict=True):
        at_s = (sight.at_us - now_us) * 1e-6
        found = []
        for number, box in enumerate(sight.boxes, row):
            if number in reached:
                key, outline = (sight.at_us, number - row), (east_m[number], north_m[number])
                found.append(_fix(key, box, at_s, own, camera.calibration.height_m, outline))
        row += len(sight.boxes)
        yield found


def _fix(key: tuple[int, int], box: Box, at_s: float, lens: Lens, height_m: float, outline: tuple[F64, F64]) -> Fix:
    """One row of the picture is range^2 / height times its angle along the ray; across, much less."""
    camera_m, row_rad = (float(lens.at_m[0]), float(lens.at_m[1])), ROW / float(lens.focal[1])
    easts, norths = (axis.tolist() for axis in outline)
    place_m = (sum(easts) / BOX_COLUMNS, sum(norths) / BOX_COLUMNS)
    away_m = max(math.dist(place_m, camera_m), PLACE_M)
    wide_m = OF_WIDTH * math.dist((easts[0], norths[0]), (easts[-1], norths[-1]))
    end_rad = row_rad if box.is_small else HULL_ROWS * row_rad
    along_m = PLACE_M + wide_m + end_rad * away_m * away_m / height_m
    across_m = PLACE_M + wide_m + ACROSS_ROWS * row_rad * away_m
    east, north = (place_m[0] - camera_m[0]) / away_m, (place_m[1] - camera_m[1]) / away_m
    along, across = 1.0 / (along_m * along_m), 1.0 / (across_m * across_m)
    weight = (
        along * east * east + across * north * north,
        (along - across) * east * north,
        along * north * north + across * east * east,
    )
    foot = box.low < FOOT_STEPS - CUT
    ends = (foot and box.left > CUT, foot and box.right < FOOT_STEPS - CUT)
    return Fix(key, box.label, at_s, place_m, weight, along_m, outline, ends)


def _times(a: Symmetric, b: Pair) -> Pair:
    return (a[0] * b[0] + a[1] * b[1], a[1] * b[0] + a[2] * b[1])


def _plus(a: Symmetric, scale: float, b: Symmetric) -> Symmetric:
    return (a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2])


def _inverse(a: Symmetric) -> Symmetric:
    scale = 1.0 / (a[0] * a[2] - a[1] * a[1])
    return (scale * a[2], -scale * a[1], scale * a[0])


def _between(a: Symmetric, b: Symmetric) -> Symmetric:
    """The symmetric a b a."""
    first, second = _times(b, (a[0], a[1])), _times(b, (a[1], a[2]))
    return (a[0] * first[0] + a[1] * first[1], a[0] * second[0] + a[1] * second[1], a[1] * second[0] + a[2] * second[1])
