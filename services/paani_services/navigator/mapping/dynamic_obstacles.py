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
from paani_services.navigator.mapping.observation import BOX_STEPS, OUTLINE_POINTS, Observation, ObstacleBox
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera, own_hull_top
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, BoxIds, OccupancyGrid
from paani_services.navigator.mapping.projection import (
    PinholeCamera,
    pinhole_at,
    pixel_rays,
    ranges_to_water_m,
    stack_cameras,
)

BOX_EDGE_DEVIATION = 1.0 / 240.0  # of the picture's height: how exactly a box's lower end is known
HULL_EDGE_FACTOR = (
    2.0  # and a hull's, which the mask ends: half a row of 64, and so for as long as it takes to the next
)
POSITION_DEVIATION_M, CROSS_RANGE_FACTOR = 0.05, 2.3  # and everything else of its place, near and far
WIDTH_DEVIATION_FRACTION = 0.03  # what shows of a thing changes with the side it shows
MIN_SIGNIFICANCE = 4.0  # standard deviations of a velocity that is no chance
MIN_SPEED_MPS = 0.08  # slower things stand: Q6's drift covers them
DRIFT_FIT_S, MAX_DRIFT_MPS = 8.0, 0.3  # what drifts goes a metre meanwhile, and no faster
MIN_DRIFT_DEVIATION_MPS = 0.05  # measured; a hull shows other parts of itself as it is passed
MIN_MEASUREMENTS, MIN_SPAN_S = 3, 0.7  # fewer or shorter say nothing
INDEPENDENT_RATE_HZ = 5.0  # errors of pictures that follow faster are the same
MIN_UNSEEN_S = 1.0  # five pictures
PRIOR_DEGREES_OF_FREEDOM = 5.0  # degrees of freedom
PRIOR_SPEED_DEVIATION_MPS = 0.7  # of what moves: how far the fit goes from rest without evidence
GATE_M, GATE_MPS = 0.5, 1.2  # between two places of one thing: its size, and how fast it may be
BORDER_STEPS = 4  # a box that comes this near to the picture's sides [1/512] may go on beyond

SymmetricMatrix = tuple[float, float, float]  # a 2 x 2 matrix: east-east, east-north, north-north
PlaneVector = tuple[float, float]


class PositionMeasurement(NamedTuple):
    """Where a thing stood in one picture, east and north [m], and what that is worth: the inverse of its covariance.

    box: which, as in `Moving` of the grid. at_s: from now, negative. along_m: standard deviation of its range.
    outline: points where it meets the water, from left to right. ends: whether the picture shows its left, its right
    one; whole: both.
    """

    box_id: tuple[int, int]
    label: Label
    time_s: float
    position_m: PlaneVector
    information_matrix: SymmetricMatrix
    range_deviation_m: float
    outline: tuple[F64, F64]
    shows_ends: tuple[bool, bool]

    @property
    def is_whole(self) -> bool:
        """Not cut by the picture's sides."""
        return all(self.shows_ends)


class Velocity(NamedTuple):
    """Velocity, and its standard deviation in the direction in which that is larger."""

    east_mps: float
    north_mps: float
    deviation_mps: float


class VelocityEstimate(NamedTuple):
    """A velocity, and the inverse of its covariance times it, which says how far from chance it is.

    deviation_mps: as in `Motion`.
    """

    velocity_mps: PlaneVector
    information_vector: PlaneVector
    deviation_mps: float

    @property
    def squared_significance(self) -> float:
        """Standard deviations between it and rest, squared."""
        return self.velocity_mps[0] * self.information_vector[0] + self.velocity_mps[1] * self.information_vector[1]


class DynamicObstacle(NamedTuple):
    """A thing that moves: its outline now [n], the room to keep around it, its motion, when last seen, whole or adrift.

    boxes: what it has left behind; where it was within `free_s` of when it was last seen stays occupied.
    """

    east_m: F64
    north_m: F64
    standoff_m: float
    velocity: Velocity
    age_s: float
    vacated_boxes: BoxIds

    @property
    def is_moving(self) -> bool:
        """It moves for certain; a person who may swim has a deviation alone."""
        return any(self.velocity[:2])


def find_dynamic_obstacles(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> tuple[DynamicObstacle, ...]:
    """Everything that moved for certain when it was last seen whole, vessels adrift, and people in sight.

    sights: oldest first.
    """
    found = []
    for track in _associate_measurements(observations, now_us, camera, config):
        complete = [measurement for measurement in track if measurement.is_whole]
        velocity, last = estimate_velocity(complete, config.fit_s), complete[-1] if complete else track[-1]
        if velocity is None and track[-1].label is Label.VESSEL:
            velocity, last = _estimate_drift(track, complete), track[-1]
        if velocity is None:
            if track[-1].label is Label.PERSON and len(track) > 1 and -track[-1].time_s <= config.occupied_s:
                found.append(_possible_swimmer(track, config))
            continue
        found.append(
            DynamicObstacle(
                last.outline[0] - last.time_s * velocity.east_mps,
                last.outline[1] - last.time_s * velocity.north_mps,
                config.person_near_m if last.label is Label.PERSON else config.vessel_near_m,
                velocity,
                -last.time_s,
                frozenset(
                    measurement.box_id for measurement in track if measurement.time_s < track[-1].time_s - config.free_s
                ),
            )
        )
    return tuple(found)


def _estimate_drift(track: list[PositionMeasurement], complete: list[PositionMeasurement]) -> Velocity | None:
    """Of a vessel, over `DRIFT_FIT_S`: of its middle; of the surer end where too few pictures show it whole."""
    estimate = _fit_recent(complete, track[-1].time_s)
    if estimate is None:
        shows_ends = [_fit_recent(_measurements_of_end(track, end), track[-1].time_s) for end in (0, 1)]
        estimate = max(
            (end for end in shows_ends if end is not None), key=lambda end: end.squared_significance, default=None
        )
    velocity = _velocity_if_significant(estimate)
    if velocity is None or math.hypot(*velocity[:2]) > MAX_DRIFT_MPS:
        return None
    return velocity._replace(deviation_mps=max(velocity.deviation_mps, MIN_DRIFT_DEVIATION_MPS))


def _fit_recent(measurements: list[PositionMeasurement], last_s: float) -> VelocityEstimate | None:
    return (
        _fit_velocity(measurements, DRIFT_FIT_S)
        if measurements and last_s - measurements[-1].time_s <= DRIFT_FIT_S
        else None
    )


def _measurements_of_end(track: list[PositionMeasurement], end: int) -> list[PositionMeasurement]:
    """The fixes that show its left end, 0, or its right one, 1: placed there."""
    return [
        measurement._replace(position_m=(float(measurement.outline[0][-end]), float(measurement.outline[1][-end])))
        for measurement in track
        if measurement.shows_ends[end]
    ]


def _possible_swimmer(track: list[PositionMeasurement], config: PlannerConfig) -> DynamicObstacle:
    """A person seen more than once, who may stand or swim anywhere: as fast as the fixes do not rule out, cut ones too.

    Where they are stays occupied.
    """
    estimate, last = _fit_velocity(track, config.fit_s), track[-1]
    fastest_mps = config.person_mps
    if estimate is not None:
        fastest_mps = min(fastest_mps, math.hypot(*estimate.velocity_mps) + estimate.deviation_mps)
    return DynamicObstacle(
        *last.outline, config.person_near_m, Velocity(0.0, 0.0, fastest_mps), -last.time_s, frozenset()
    )


def is_refuted(obstacle: DynamicObstacle, grid: OccupancyGrid) -> bool:
    """Out of sight for `LOST_S`, and the last pictures show water all over where it should be: it did not go on."""
    if obstacle.age_s < MIN_UNSEEN_S:
        return False
    column = np.floor((obstacle.east_m - grid.west_m) / CELL_M).astype(np.int64)
    row = np.floor((obstacle.north_m - grid.south_m) / CELL_M).astype(np.int64)
    on_grid = (column >= 0) & (column < GRID_CELLS) & (row >= 0) & (row < GRID_CELLS)
    return bool(on_grid.all() and grid.free[row, column].all())


def estimate_velocity(measurements: list[PositionMeasurement], fit_s: float) -> Velocity | None:
    """The velocity over the last `fit_s`; None where it may be chance."""
    return _velocity_if_significant(_fit_velocity(measurements, fit_s))


def _velocity_if_significant(estimate: VelocityEstimate | None) -> Velocity | None:
    if (
        estimate is None
        or estimate.squared_significance < MIN_SIGNIFICANCE * MIN_SIGNIFICANCE
        or math.hypot(*estimate.velocity_mps) < MIN_SPEED_MPS
    ):
        return None
    return Velocity(*estimate.velocity_mps, estimate.deviation_mps)


def _fit_velocity(measurements: list[PositionMeasurement], fit_s: float) -> VelocityEstimate | None:
    """The weighted least squares' velocity over the last `fit_s`, drawn towards rest; None of too few fixes.

    With place and velocity as unknowns the normal equations are [W, T; T, S] [p; v] = [a; b], each a 2 x 2 matrix:
    (S - T W^-1 T) v = b - T W^-1 a.
    """
    measurements = [
        measurement for measurement in measurements if measurements[-1].time_s - measurement.time_s <= fit_s
    ]
    span_s = measurements[-1].time_s - measurements[0].time_s if measurements else 0.0
    if len(measurements) < MIN_MEASUREMENTS or span_s < MIN_SPAN_S:
        return None
    weight_sum = time_sum = square_sum = (0.0, 0.0, 0.0)
    position_sum = moment_sum = (0.0, 0.0)
    first = measurements[0]
    for measurement in measurements:
        t_s = measurement.time_s - first.time_s
        information_vector = _multiply(
            measurement.information_matrix,
            (measurement.position_m[0] - first.position_m[0], measurement.position_m[1] - first.position_m[1]),
        )
        weight_sum, time_sum = (
            _add_scaled(weight_sum, 1.0, measurement.information_matrix),
            _add_scaled(time_sum, t_s, measurement.information_matrix),
        )
        square_sum = _add_scaled(square_sum, t_s * t_s, measurement.information_matrix)
        position_sum = (position_sum[0] + information_vector[0], position_sum[1] + information_vector[1])
        moment_sum = (moment_sum[0] + t_s * information_vector[0], moment_sum[1] + t_s * information_vector[1])
    inverse = _invert(weight_sum)
    reduced = _multiply(time_sum, _multiply(inverse, position_sum))
    information_vector = (moment_sum[0] - reduced[0], moment_sum[1] - reduced[1])
    information_matrix = _add_scaled(square_sum, -1.0, _congruence(time_sum, inverse))
    # Pictures that follow fast, and places that lie further off the line than they should, tell less; others more.
    fast = min(1.0, (1.0 + INDEPENDENT_RATE_HZ * span_s) / len(measurements))
    share = fast / _reduced_chi_squared(
        measurements, _multiply(_invert(information_matrix), information_vector), inverse, position_sum, time_sum
    )
    rest = 1.0 / (PRIOR_SPEED_DEVIATION_MPS * PRIOR_SPEED_DEVIATION_MPS)
    covariance = _invert(_add_scaled((rest, 0.0, rest), share, information_matrix))
    information_vector = (share * information_vector[0], share * information_vector[1])
    return VelocityEstimate(
        _multiply(covariance, information_vector), information_vector, math.sqrt(max(covariance[0], covariance[2]))
    )


def _reduced_chi_squared(
    measurements: list[PositionMeasurement],
    velocity: PlaneVector,
    inverse: SymmetricMatrix,
    position_sum: PlaneVector,
    time_sum: SymmetricMatrix,
) -> float:
    """Squared residuals over variances, for each degree of freedom: 1 where the errors are as expected.

    `EXPECTED` more that are so keep it from what a few fixes show by chance.
    """
    moved = _multiply(time_sum, velocity)
    start = _multiply(inverse, (position_sum[0] - moved[0], position_sum[1] - moved[1]))
    total, first = 0.0, measurements[0]
    for measurement in measurements:
        t_s = measurement.time_s - first.time_s
        off = (
            measurement.position_m[0] - first.position_m[0] - start[0] - t_s * velocity[0],
            measurement.position_m[1] - first.position_m[1] - start[1] - t_s * velocity[1],
        )
        information_vector = _multiply(measurement.information_matrix, off)
        total += off[0] * information_vector[0] + off[1] * information_vector[1]
    return (total + PRIOR_DEGREES_OF_FREEDOM) / (2 * len(measurements) - 4 + PRIOR_DEGREES_OF_FREEDOM)


def _associate_measurements(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> list[list[PositionMeasurement]]:
    """The fixes of each thing, oldest first: of one kind, the nearest to the nearest within a gate."""
    tracks: list[list[PositionMeasurement]] = []
    for measurements in _measure_positions(observations, now_us, camera, config):
        pairs = sorted(
            (math.dist(track[-1].position_m, measurement.position_m), t, f)
            for t, track in enumerate(tracks)
            for f, measurement in enumerate(measurements)
            if track[-1].label is measurement.label and measurement.time_s - track[-1].time_s <= config.fit_s
        )
        taken: set[int] = set()
        extended: set[int] = set()
        for distance_m, t, f in pairs:
            last, measurement = tracks[t][-1], measurements[f]
            gate_m = (
                GATE_M
                + GATE_MPS * (measurement.time_s - last.time_s)
                + last.range_deviation_m
                + measurement.range_deviation_m
            )
            if t not in extended and f not in taken and distance_m <= gate_m:
                tracks[t].append(measurement)
                extended.add(t)
                taken.add(f)
        tracks += [[measurement] for f, measurement in enumerate(measurements) if f not in taken]
    return tracks


def _measure_positions(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> Iterator[list[PositionMeasurement]]:
    """Of each picture with boxes, where those stand whose whole outline is within reach."""
    with_boxes = [observation for observation in observations if observation.boxes and observation.stamp_us <= now_us]
    if not with_boxes:
        return
    camera_models = [
        pinhole_at(observation.pose, camera.calibration, observation.aspect_ratio) for observation in with_boxes
    ]
    camera_model = stack_cameras(
        [own for observation, own in zip(with_boxes, camera_models, strict=True) for _ in observation.boxes]
    )
    boxes = [box for observation in with_boxes for box in observation.boxes]
    left, right = (np.array(sides)[:, None] for sides in ([box.left for box in boxes], [box.right for box in boxes]))
    u = (left + (right - left) * ((np.arange(OUTLINE_POINTS) + 0.5) / OUTLINE_POINTS)) / BOX_STEPS
    v = np.array([box.waterline for box in boxes]) / BOX_STEPS
    given = pixel_rays(camera_model, u, np.minimum(v, own_hull_top(camera.ego_polygon, u)))
    range_m = ranges_to_water_m(camera_model, given, config.mover_range_m)
    east_m: F64 = camera_model.position_m[0] + range_m * given.east
    north_m: F64 = camera_model.position_m[1] + range_m * given.north
    reached = set(np.flatnonzero(np.isfinite(range_m).all(axis=1)).tolist())
    row = 0
    for observation, own in zip(with_boxes, camera_models, strict=True):
        time_s = (observation.stamp_us - now_us) * 1e-6
        found = []
        for number, box in enumerate(observation.boxes, row):
            if number in reached:
                key, outline = (observation.stamp_us, number - row), (east_m[number], north_m[number])
                found.append(_measure_position(key, box, time_s, own, camera.calibration.height_m, outline))
        row += len(observation.boxes)
        yield found


def _measure_position(
    key: tuple[int, int],
    box: ObstacleBox,
    time_s: float,
    camera_model: PinholeCamera,
    height_m: float,
    outline: tuple[F64, F64],
) -> PositionMeasurement:
    """One row of the picture is range^2 / height times its angle along the ray; across, much less."""
    camera_m, row_rad = (
        (float(camera_model.position_m[0]), float(camera_model.position_m[1])),
        BOX_EDGE_DEVIATION / float(camera_model.focal[1]),
    )
    easts, norths = (axis.tolist() for axis in outline)
    position_m = (sum(easts) / OUTLINE_POINTS, sum(norths) / OUTLINE_POINTS)
    distance_m = max(math.dist(position_m, camera_m), POSITION_DEVIATION_M)
    wide_m = WIDTH_DEVIATION_FRACTION * math.dist((easts[0], norths[0]), (easts[-1], norths[-1]))
    end_rad = row_rad if box.is_small else HULL_EDGE_FACTOR * row_rad
    range_deviation_m = POSITION_DEVIATION_M + wide_m + end_rad * distance_m * distance_m / height_m
    across_m = POSITION_DEVIATION_M + wide_m + CROSS_RANGE_FACTOR * row_rad * distance_m
    east, north = (position_m[0] - camera_m[0]) / distance_m, (position_m[1] - camera_m[1]) / distance_m
    along, across = 1.0 / (range_deviation_m * range_deviation_m), 1.0 / (across_m * across_m)
    information_matrix = (
        along * east * east + across * north * north,
        (along - across) * east * north,
        along * north * north + across * east * east,
    )
    foot = box.bottom < BOX_STEPS - BORDER_STEPS
    shows_ends = (foot and box.left > BORDER_STEPS, foot and box.right < BOX_STEPS - BORDER_STEPS)
    return PositionMeasurement(
        key, box.label, time_s, position_m, information_matrix, range_deviation_m, outline, shows_ends
    )


def _multiply(a: SymmetricMatrix, b: PlaneVector) -> PlaneVector:
    return (a[0] * b[0] + a[1] * b[1], a[1] * b[0] + a[2] * b[1])


def _add_scaled(a: SymmetricMatrix, scale: float, b: SymmetricMatrix) -> SymmetricMatrix:
    return (a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2])


def _invert(a: SymmetricMatrix) -> SymmetricMatrix:
    scale = 1.0 / (a[0] * a[2] - a[1] * a[1])
    return (scale * a[2], -scale * a[1], scale * a[0])


def _congruence(a: SymmetricMatrix, b: SymmetricMatrix) -> SymmetricMatrix:
    """The symmetric a b a."""
    first, second = _multiply(b, (a[0], a[1])), _multiply(b, (a[1], a[2]))
    return (a[0] * first[0] + a[1] * first[1], a[0] * second[0] + a[1] * second[1], a[1] * second[0] + a[2] * second[1])
