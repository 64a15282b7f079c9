"""Weighted least-squares fit of a constant velocity to the measured positions of one obstacle. Pure."""

import bisect
import math
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.messages import Label

MIN_SIGNIFICANCE = 4.0  # standard deviations between rest and a velocity that is not chance
MIN_SPEED_MPS = 0.08  # slower obstacles are static: the drift of Q6 covers them
MIN_MEASUREMENTS, MIN_SPAN_S = 4, 0.7  # fewer, or over a shorter time, give no velocity: three lie on a line by chance
INDEPENDENT_RATE_HZ = 5.0  # measurements that follow faster have the same errors
PRIOR_DEGREES_OF_FREEDOM = 5.0  # of the reduced chi-squared
PRIOR_SPEED_DEVIATION_MPS = 1.5  # of what moves: barges go up to 2.2 m/s, rowing eights to 3.2

SymmetricMatrix = tuple[float, float, float]  # a 2 x 2 matrix: east-east, east-north, north-north
PlaneVector = tuple[float, float]


class PositionMeasurement(NamedTuple):
    """The position of an obstacle in one picture, east and north [m], with the inverse of its covariance.

    box_id: as in `BoxIds`. gate_deviation_m: by which its range may be wrong in a picture whose box is.
    outline: points where it meets the water, from left to right.
    shows_ends: whether the picture shows its left and its right end. size_m: width and height of its box at its range.
    track_id: the advisor's track of it; 0: unknown.
    """

    box_id: tuple[int, int]
    label: Label
    position_m: PlaneVector
    information_matrix: SymmetricMatrix
    gate_deviation_m: float
    outline: tuple[F64, F64]
    shows_ends: tuple[bool, bool]
    size_m: PlaneVector
    track_id: int = 0

    @property
    def stamp_us(self) -> int:
        """When the picture was taken."""
        return self.box_id[0]

    @property
    def is_whole(self) -> bool:
        """Whether the picture's sides do not cut it."""
        return self.shows_ends == (True, True)


class Velocity(NamedTuple):
    """A velocity, and its standard deviation in the direction in which that is larger.

    covariance: of it; None: the same in every direction.
    """

    east_mps: float
    north_mps: float
    deviation_mps: float
    covariance: SymmetricMatrix | None = None

    @property
    def speed_mps(self) -> float:
        """Its magnitude."""
        return math.hypot(self.east_mps, self.north_mps)

    def variance_along(self, east: F64 | float, north: F64 | float) -> F64 | float:
        """The variance of its component along this unit vector."""
        square = self.deviation_mps * self.deviation_mps
        east_east, east_north, north_north = (square, 0.0, square) if self.covariance is None else self.covariance
        variance = east_east * east * east + 2.0 * east_north * east * north + north_north * north * north
        return np.maximum(variance, 0.0)  # rounding of a matrix that is nearly singular


class VelocityEstimate(NamedTuple):
    """A velocity, and the information vector: the inverse of its covariance times the velocity."""

    velocity_mps: PlaneVector
    information_vector: PlaneVector
    covariance: SymmetricMatrix

    @property
    def deviation_mps(self) -> float:
        """Standard deviation in the direction in which that is largest."""
        east_east, east_north, north_north = self.covariance
        half_trace = 0.5 * (east_east + north_north)
        return math.sqrt(half_trace + math.hypot(0.5 * (east_east - north_north), east_north))

    @property
    def squared_significance(self) -> float:
        """Squared Mahalanobis distance between the velocity and rest."""
        return self.velocity_mps[0] * self.information_vector[0] + self.velocity_mps[1] * self.information_vector[1]


def estimate_velocity(measurements: list[PositionMeasurement], fit_s: float) -> Velocity | None:
    """The velocity over the last `fit_s`; None where it may be chance."""
    return velocity_if_significant(fit_velocity(measurements, fit_s))


def velocity_if_significant(estimate: VelocityEstimate | None) -> Velocity | None:
    """The velocity, unless it may be chance or is that of a static obstacle."""
    if (
        estimate is None
        or estimate.squared_significance < MIN_SIGNIFICANCE * MIN_SIGNIFICANCE
        or math.hypot(*estimate.velocity_mps) < MIN_SPEED_MPS
    ):
        return None
    return Velocity(*estimate.velocity_mps, estimate.deviation_mps, estimate.covariance)


def fit_velocity(measurements: list[PositionMeasurement], fit_s: float) -> VelocityEstimate | None:
    """Fit a constant velocity to the positions of the last `fit_s` by weighted least squares; None of too few.

    With position and velocity as unknowns the normal equations are [W, T; T, S] [p; v] = [a; b], each a 2 x 2 matrix,
    and (S - T W^-1 T) v = b - T W^-1 a. A prior of zero mean draws the velocity towards rest. Information is scaled
    down for pictures that follow fast, whose errors are the same, and by the reduced chi-squared of the residuals.
    """
    measurements = measurements[first_since(measurements, round(fit_s * 1e6)) :]
    span_s = (measurements[-1].stamp_us - measurements[0].stamp_us) * 1e-6 if measurements else 0.0
    if len(measurements) < MIN_MEASUREMENTS or span_s < MIN_SPAN_S:
        return None
    weight_sum = time_sum = square_sum = (0.0, 0.0, 0.0)
    position_sum = moment_sum = (0.0, 0.0)
    first = measurements[0]
    for each in measurements:
        t_s = (each.stamp_us - first.stamp_us) * 1e-6
        offset_m = (each.position_m[0] - first.position_m[0], each.position_m[1] - first.position_m[1])
        weighted = _multiply(each.information_matrix, offset_m)
        weight_sum = _add_scaled(weight_sum, 1.0, each.information_matrix)
        time_sum = _add_scaled(time_sum, t_s, each.information_matrix)
        square_sum = _add_scaled(square_sum, t_s * t_s, each.information_matrix)
        position_sum = (position_sum[0] + weighted[0], position_sum[1] + weighted[1])
        moment_sum = (moment_sum[0] + t_s * weighted[0], moment_sum[1] + t_s * weighted[1])
    inverse = _invert(weight_sum)
    reduced = _multiply(time_sum, _multiply(inverse, position_sum))
    information_vector = (moment_sum[0] - reduced[0], moment_sum[1] - reduced[1])
    information_matrix = _add_scaled(square_sum, -1.0, _congruence(time_sum, inverse))
    independent = min(1.0, (1.0 + INDEPENDENT_RATE_HZ * span_s) / len(measurements))
    scale = independent / _reduced_chi_squared(
        measurements, _multiply(_invert(information_matrix), information_vector), inverse, position_sum, time_sum
    )
    rest = 1.0 / (PRIOR_SPEED_DEVIATION_MPS * PRIOR_SPEED_DEVIATION_MPS)
    covariance = _invert(_add_scaled((rest, 0.0, rest), scale, information_matrix))
    information_vector = (scale * information_vector[0], scale * information_vector[1])
    return VelocityEstimate(_multiply(covariance, information_vector), information_vector, covariance)


def first_since(measurements: list[PositionMeasurement], span_us: int) -> int:
    """The number of the first measurement that is no more than this older than the last; 0 without any."""
    if not measurements:
        return 0
    return bisect.bisect_left(measurements, measurements[-1].stamp_us - span_us, key=lambda each: each.stamp_us)


def _reduced_chi_squared(
    measurements: list[PositionMeasurement],
    velocity: PlaneVector,
    inverse: SymmetricMatrix,
    position_sum: PlaneVector,
    time_sum: SymmetricMatrix,
) -> float:
    """Squared residuals over variances for each degree of freedom: 1 where the errors are as expected.

    `PRIOR_DEGREES_OF_FREEDOM` more that are as expected keep a few measurements from showing much by chance.
    """
    moved = _multiply(time_sum, velocity)
    start = _multiply(inverse, (position_sum[0] - moved[0], position_sum[1] - moved[1]))
    total, first = 0.0, measurements[0]
    for each in measurements:
        t_s = (each.stamp_us - first.stamp_us) * 1e-6
        residual_m = (
            each.position_m[0] - first.position_m[0] - start[0] - t_s * velocity[0],
            each.position_m[1] - first.position_m[1] - start[1] - t_s * velocity[1],
        )
        weighted = _multiply(each.information_matrix, residual_m)
        total += residual_m[0] * weighted[0] + residual_m[1] * weighted[1]
    return (total + PRIOR_DEGREES_OF_FREEDOM) / (2 * len(measurements) - 4 + PRIOR_DEGREES_OF_FREEDOM)


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
