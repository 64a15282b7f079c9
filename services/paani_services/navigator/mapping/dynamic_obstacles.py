"""Dynamic obstacles: tracks of detected boxes on the water, and their velocities. Pure.

A constant velocity is fitted to the positions of each track by weighted least squares. An obstacle whose velocity does
not differ significantly from rest is static.
"""

import functools
import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.mapping.box_measurement import MeasuredPicture, measure_positions
from paani_services.navigator.mapping.observation import MAX_OBSERVATIONS, Observation
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera
from paani_services.navigator.mapping.occupancy_grid import (
    GRID_CELLS,
    BoxIds,
    OccupancyGrid,
    build_occupancy_grid,
)
from paani_services.navigator.mapping.velocity_fit import (
    PositionMeasurement,
    Velocity,
    VelocityEstimate,
    estimate_velocity,
    first_since,
    fit_velocity,
    velocity_if_significant,
)

DRIFT_FIT_S = 8.0  # a vessel adrift moves a metre in this time
MAX_DRIFT_MPS = 0.3  # vessels adrift are slower than this
MIN_DRIFT_DEVIATION_MPS = 0.05  # measured; a hull shows other parts of itself as it is passed
MIN_UNSEEN_S = 1.0  # five pictures
# By how much an obstacle, seen whole, may be wider or higher in one of two pictures. Measured: 98 % of pairs are alike
# within this, wrong ones among them.
MAX_SIZE_RATIO = 1.6
GATE_M, GATE_MPS = 0.5, 1.2  # validation gate between two measurements: an obstacle's size, and its highest speed
OTHER_LABEL_M = 0.5  # by which what is labelled otherwise counts as further away: the size of an obstacle
CACHED_PAIRS = 4 * MAX_OBSERVATIONS  # of pictures: a track goes on in the next picture, or a few later


class DynamicObstacle(NamedTuple):
    """A tracked obstacle with a velocity: its outline now [n], when it was last seen, and the room kept around it.

    vacated_boxes: boxes that show it where it is no more. Where it was within `free_s` of when it was last seen stays
    occupied. track_id: the advisor's track that it was last seen as; 0: unknown. label: what the detector takes it for.
    mmsi: of a vessel that is known by AIS alone; 0: seen. position_std_m: of its outline when that was known.
    """

    east_m: F64
    north_m: F64
    standoff_m: float
    velocity: Velocity
    age_s: float
    vacated_boxes: BoxIds
    track_id: int = 0
    label: Label = Label.VESSEL
    mmsi: int = 0
    position_std_m: float = 0.0

    @property
    def is_moving(self) -> bool:
        """Whether it moves for certain; a person who may swim has a standard deviation alone."""
        return any(self.velocity[:2])


def map_water(
    observations: tuple[Observation, ...],
    position_m: tuple[float, float],
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
) -> tuple[OccupancyGrid, tuple[DynamicObstacle, ...]]:
    """The grid around a position, and the dynamic obstacles, which are not on it."""
    obstacles = find_dynamic_obstacles(observations, now_us, camera, config) if config.predict else ()
    boxes: BoxIds = frozenset().union(*(obstacle.vacated_boxes for obstacle in obstacles))
    grid = build_occupancy_grid(observations, position_m, now_us, camera, config, boxes)
    return grid, tuple(obstacle for obstacle in obstacles if not is_refuted(obstacle, grid))


def find_dynamic_obstacles(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> tuple[DynamicObstacle, ...]:
    """Track obstacles through the observations, oldest first, and estimate their velocities.

    Dynamic are obstacles that moved significantly when last seen whole, vessels adrift, and people in sight, who may
    begin to swim. Everything else is static and stays on the grid.
    """
    found = []
    for track in _associate_measurements(observations, now_us, camera, config):
        complete = _latest_whole(track, max(config.fit_s, DRIFT_FIT_S))
        velocity, last = estimate_velocity(complete, config.fit_s), complete[-1] if complete else track[-1]
        label = _commonest_label(track)
        if velocity is None and label is Label.VESSEL:
            velocity, last = _estimate_drift(track, complete), track[-1]
        if velocity is None:
            age_s = (now_us - track[-1].stamp_us) * 1e-6
            if label is Label.PERSON and len(track) > 1 and age_s <= config.occupied_s:
                found.append(_possible_swimmer(track, age_s, config))
            continue
        age_s, left = (now_us - last.stamp_us) * 1e-6, track[: first_since(track, round(config.free_s * 1e6))]
        found.append(
            DynamicObstacle(
                last.outline[0] + age_s * velocity.east_mps,
                last.outline[1] + age_s * velocity.north_mps,
                config.person_near_m if label is Label.PERSON else config.vessel_near_m,
                velocity,
                age_s,
                frozenset(each.box_id for each in left),
                _latest_track_id(track),
                label,
            )
        )
    return tuple(found)


def _latest_whole(track: list[PositionMeasurement], span_s: float) -> list[PositionMeasurement]:
    """The measurements that show it whole, from `span_s` before the last of them."""
    number = next((k for k in range(len(track), 0, -1) if track[k - 1].is_whole), 0)
    first = first_since(track[:number], round(span_s * 1e6))
    return [each for each in track[first:number] if each.is_whole]


def _estimate_drift(track: list[PositionMeasurement], complete: list[PositionMeasurement]) -> Velocity | None:
    """The velocity of a vessel adrift, estimated over `DRIFT_FIT_S`.

    It is that of its middle, or, where the newest picture does not show the vessel whole, of the more certain end.
    """
    estimates = [_fit_recent(complete, track[-1].stamp_us)]
    if not track[-1].is_whole:
        estimates += [_fit_recent(_measurements_of_end(track, end), track[-1].stamp_us) for end in (0, 1)]
    known = [each for each in estimates if each is not None]
    velocity = velocity_if_significant(max(known, key=lambda each: each.squared_significance, default=None))
    if velocity is None:
        return None
    deviation_mps = max(velocity.deviation_mps, MIN_DRIFT_DEVIATION_MPS)
    if velocity.speed_mps - 2.0 * deviation_mps > MAX_DRIFT_MPS:
        return None
    return velocity._replace(deviation_mps=deviation_mps)


def _fit_recent(measurements: list[PositionMeasurement], last_us: int) -> VelocityEstimate | None:
    """The velocity over `DRIFT_FIT_S`, if the newest measurement is that recent."""
    if not measurements or (last_us - measurements[-1].stamp_us) * 1e-6 > DRIFT_FIT_S:
        return None
    return fit_velocity(measurements, DRIFT_FIT_S)


def _measurements_of_end(track: list[PositionMeasurement], end: int) -> list[PositionMeasurement]:
    """The measurements that show the left end (0) or the right end (1), with that end as their position."""
    return [
        each._replace(position_m=(float(each.outline[0][-end]), float(each.outline[1][-end])))
        for each in track
        if each.shows_ends[end]
    ]


def _possible_swimmer(track: list[PositionMeasurement], age_s: float, config: PlannerConfig) -> DynamicObstacle:
    """A person seen more than once, who may stand, or swim in any direction.

    The speed is as high as the measurements do not rule out, those cut by the picture's sides included. The cells where
    the person is seen stay occupied.
    """
    estimate, last = fit_velocity(track, config.fit_s), track[-1]
    fastest_mps = config.person_mps
    if estimate is not None:
        fastest_mps = min(fastest_mps, math.hypot(*estimate.velocity_mps) + estimate.deviation_mps)
    return DynamicObstacle(
        *last.outline,
        config.person_near_m,
        Velocity(0.0, 0.0, fastest_mps),
        age_s,
        frozenset(),
        _latest_track_id(track),
        Label.PERSON,
    )


def _commonest_label(track: list[PositionMeasurement]) -> Label:
    """What most pictures show it as; of two as common, what the newest shows it as."""
    return Counter(each.label for each in reversed(track)).most_common(1)[0][0]


def _latest_track_id(track: list[PositionMeasurement]) -> int:
    """The advisor's track of the newest measurement that has one; the association here does not depend on it."""
    return next((each.track_id for each in reversed(track) if each.track_id), 0)


def is_refuted(obstacle: DynamicObstacle, grid: OccupancyGrid) -> bool:
    """Whether the pictures show water everywhere an obstacle should be that is out of sight: it did not go on.

    That counts after `MIN_UNSEEN_S` out of sight.
    """
    if obstacle.age_s < MIN_UNSEEN_S:
        return False
    column = np.floor((obstacle.east_m - grid.west_m) / CELL_M).astype(np.int64)
    row = np.floor((obstacle.north_m - grid.south_m) / CELL_M).astype(np.int64)
    on_grid = (column >= 0) & (column < GRID_CELLS) & (row >= 0) & (row < GRID_CELLS)
    return bool(on_grid.all() and grid.free[row, column].all())


def _associate_measurements(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> list[list[PositionMeasurement]]:
    """The measurements of each obstacle, oldest first.

    Association is greedy nearest neighbour within a validation gate (Bar-Shalom, Li, Kirubarajan: "Estimation with
    Applications to Tracking and Navigation", 2001). The detector takes one hull for a vessel in this picture and for a
    buoy in the next, so another label counts as `OTHER_LABEL_M` further away; but no person is taken for a thing.
    """
    tracks: list[list[PositionMeasurement]] = []
    recent: dict[MeasuredPicture, dict[int, int]] = {}  # by picture: the track that each of its measurements ends
    fit_us = round(config.fit_s * 1e6)
    for observation in observations:
        if not observation.boxes or observation.stamp_us > now_us:
            continue
        picture = measure_positions(observation, camera, config.mover_range_m)
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
