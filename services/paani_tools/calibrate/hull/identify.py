"""Least squares on the vessel's model: the parameters of a drive, and how well it determines each. Pure.

Output-error method (Ljung, System Identification, 2nd ed. 1999, chapter 7): the whole drive is simulated from its
thrust alone, and the parameters are those whose velocities and yaw rates lie nearest to the measured ones. Intervals
come from the sandwich estimator over blocks of the drive (Liang and Zeger 1986): errors may be correlated within a
block, as those of waves and filters are. A model in the plane is itself wrong by a little: `MODEL_SHARE` widens them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from paani.arrays import F64
from paani.errors import UserError
from paani.statistics.order_statistics import nearest_rank
from paani_sim.vessels import Vessel
from paani_tools.calibrate.hull.drive import STEP_S, Drive
from paani_tools.calibrate.hull.model import INDEX, PARAMETERS, Prediction, fan_force_n, initial_parameters, predict

CONFIDENCE = 0.95
BLOCK_S = 10.0  # several times what the hull, a wave or the estimator of the heading remembers
SETTLING_S = 5.0  # left out at the start, until the speed assumed there is forgotten
ROUNDS = 3  # the errors of GPS and gyro are weighed by their own spread, which a fit gives the next
SPEED_STD_MPS, RATE_STD_RADPS = 0.1, 0.01  # before the first fit
OUTLIER_STDS = 6.0
DIFFERENCE = 1e-5  # of a parameter's scale, for slopes
MAX_SHARE = 0.25  # half of an interval, of the force that the parameter belongs to at the fastest that was driven
MODEL_SHARE = 0.01  # of that force: roll, pitch and the plant's own steps move what is found by up to 0.7 %, measured
FASTEST_PERCENT = 95.0
MIN_ASTERN_S = 5.0
PRIOR_STD = 10.0  # of a parameter's scale: so far from its start it may lie where the drive says nothing of it
MAX_EVALUATIONS = 60
SCALES = {"current_east": 0.1, "current_north": 0.1, "gyro_bias": 0.01, "heading_offset": 0.1}
PAIRS = (
    ("thrust_linear", "thrust_quadratic"),
    ("surge_linear", "surge_quadratic"),
    ("sway_linear", "sway_quadratic"),
    ("yaw_linear", "yaw_quadratic"),
)


class Estimate(NamedTuple):
    """One parameter. std_error: by the measurements alone; low, high: its interval, with the error of the model.
    share: half of the interval, of the force it belongs to at the fastest that was driven.

    fixed: not identified, `value` is that of the vessel that the search began with.
    """

    value: float
    std_error: float
    low: float
    high: float
    share: float
    fixed: bool = False

    @property
    def excited(self) -> bool:
        """Whether the drive determines it."""
        return not self.fixed and self.share <= MAX_SHARE


class Identification(NamedTuple):
    """All parameters by name, and how well the model follows: standard deviations of what is left, and samples used.

    force_per_unit_n: of the straight line nearest to the thrust curve over the thrust that was used.
    """

    estimates: dict[str, Estimate]
    speed_residual_mps: float
    rate_residual_radps: float
    samples: int
    outliers: int
    seconds: float
    fastest: tuple[float, float, float]
    force_per_unit_n: float


class _Fit(NamedTuple):
    parameters: F64
    std_errors: F64
    speed_std_mps: float
    rate_std_radps: float
    kept: F64
    blocks: int
    motion: F64


def identify(drive: Drive, vessel: Vessel, force_per_unit_n: float) -> Identification:
    """The parameters of this drive. `vessel`: mass, spacing of the fans and added mass, which no drive tells apart.

    Sway drag and the astern ratio stay as they are in the vessel where the drive does not determine them. Raises
    UserError where no thrust was applied.
    """
    start = initial_parameters(vessel, force_per_unit_n)
    fixed = set[str]()
    if not drive.thrust.any():
        raise UserError("no thrust in the whole drive")
    if (drive.thrust < 0.0).any(axis=1).sum() * STEP_S < MIN_ASTERN_S:
        fixed.add("astern_ratio")
    found = _identify(drive, vessel, start, fixed)
    loose = {name for name in ("sway_linear", "sway_quadratic", "astern_ratio") if not found.estimates[name].excited}
    if loose - fixed:
        found = _identify(drive, vessel, start, fixed | loose)
    return found


def _identify(drive: Drive, vessel: Vessel, start: F64, fixed: set[str]) -> Identification:
    free = [number for name, number in INDEX.items() if name not in fixed]
    fit = _fit(drive, vessel, start, free)
    fastest = tuple(nearest_rank(motion, FASTEST_PERCENT) for motion in np.abs(fit.motion).T.tolist())
    errors = dict(zip(free, fit.std_errors, strict=True))
    width = student.ppf(0.5 + 0.5 * CONFIDENCE, max(1, fit.blocks - len(free)))
    thrust = np.abs(drive.thrust)
    most = nearest_rank(thrust[thrust > 0.0].tolist(), FASTEST_PERCENT)
    forces = _force_scales(fit.parameters, (most, *fastest))
    estimates = {}
    for name, number in INDEX.items():
        value, error = float(fit.parameters[number]), float(errors.get(number, 0.0))
        half = math.hypot(width * error, MODEL_SHARE * forces[name])
        share = half / forces[name] if forces[name] > 0.0 else math.inf
        estimates[name] = Estimate(value, error, value - half, value + half, share, fixed=number not in errors)
    return Identification(
        estimates=estimates,
        speed_residual_mps=fit.speed_std_mps,
        rate_residual_radps=fit.rate_std_radps,
        samples=int(fit.kept.sum()),
        outliers=int((~fit.kept.astype(bool)).sum()),
        seconds=drive.seconds,
        fastest=(fastest[0], fastest[1], fastest[2]),
        force_per_unit_n=_straight_line_n(fit.parameters, drive.thrust),
    )


def _fit(drive: Drive, vessel: Vessel, start: F64, free: list[int]) -> _Fit:
    """Fit, weigh GPS and gyro by what is left of each, leave out what lies far off, and fit again."""
    settled = round(SETTLING_S / STEP_S)
    is_rate, is_fix = drive.rate_at >= settled, drive.fix_at >= settled
    times = np.concatenate([np.repeat(drive.fix_at[is_fix], 2), drive.rate_at[is_rate]])
    of_speed = np.arange(len(times)) < 2 * is_fix.sum()
    thrust_n = abs(start[INDEX["thrust_linear"]])
    known = SCALES | {"thrust_quadratic": thrust_n}
    scales = np.array([known.get(name) or max(abs(start[INDEX[name]]), 1.0) for name in PARAMETERS])[free]
    parameters, kept = start.copy(), np.ones(len(times))
    stds = np.where(of_speed, SPEED_STD_MPS, RATE_STD_RADPS)

    def off(prediction: Prediction) -> F64:
        speeds = prediction.velocity_mps[is_fix] - drive.velocity_mps[is_fix][:, :, None]
        rates = prediction.yaw_rate_radps[is_rate] - drive.yaw_rate_radps[is_rate][:, None]
        return np.concatenate([speeds.reshape(-1, speeds.shape[-1]), rates])

    def with_free(scaled: F64) -> F64:
        sets = np.repeat(parameters[None], len(scaled), axis=0)
        sets[:, free] = scaled * scales
        return sets

    def residuals(scaled: F64) -> F64:
        measured = off(predict(with_free(scaled[None]), drive, vessel))[:, 0] * kept / stds
        return np.concatenate([measured, (scaled - begin) / PRIOR_STD])

    def slopes(scaled: F64) -> F64:
        steps = np.vstack([np.zeros(len(free)), DIFFERENCE * np.eye(len(free))])
        values = off(predict(with_free(scaled + steps), drive, vessel)) * (kept / stds)[:, None]
        return np.vstack([(values[:, 1:] - values[:, :1]) / DIFFERENCE, np.eye(len(free)) / PRIOR_STD])

    scaled = begin = parameters[free] / scales
    for _ in range(ROUNDS):
        scaled = least_squares(residuals, scaled, slopes, method="lm", xtol=1e-6, ftol=1e-8, max_nfev=MAX_EVALUATIONS).x
        left = off(predict(with_free(scaled[None]), drive, vessel))[:, 0]
        stds = np.where(of_speed, _bulk_std(left[of_speed]), max(1e-9, left[~of_speed].std()))
        kept = (~of_speed | (np.abs(left) <= OUTLIER_STDS * stds)).astype(np.float64)  # a GPS jumps, a gyro does not
    jacobian, left = slopes(scaled), residuals(scaled)[: len(times)]
    bread = np.linalg.inv(jacobian.T @ jacobian)
    jacobian = jacobian[: len(times)]
    block = (times * STEP_S / BLOCK_S).astype(np.int64)
    scores = np.zeros((block.max() + 1, len(free)))
    np.add.at(scores, block, jacobian * left[:, None])
    blocks = len(np.unique(block))
    sandwich = bread @ (scores.T @ scores) @ bread * blocks / max(1, blocks - 1)
    variances = np.maximum(np.diag(sandwich), np.diag(bread))  # errors that cancel by chance narrow no interval
    parameters[free] = scaled * scales
    motion = predict(parameters[None], drive, vessel).motion[:, :, 0]
    return _Fit(
        parameters,
        np.sqrt(variances) * scales,
        float(stds[of_speed][0]),
        float(stds[~of_speed][0]),
        kept,
        blocks,
        motion,
    )


def _bulk_std(values: F64) -> float:
    """Standard deviation of the bulk, from the median absolute deviation, so that outliers do not widen it."""
    return max(1e-9, 1.4826 * float(np.median(np.abs(values - np.median(values)))))


def _force_scales(parameters: F64, fastest: Sequence[float]) -> dict[str, float]:
    """What an error of 1 of each parameter is compared with: the force of its pair over its own part of it.

    fastest: thrust, surge, sway and yaw rate at the fastest that was driven.
    """
    scales = {name: abs(float(parameters[number])) for name, number in INDEX.items()}
    for (linear, quadratic), most in zip(PAIRS, fastest, strict=True):
        force = scales[linear] * most + scales[quadratic] * most * most
        scales[linear], scales[quadratic] = (force / most, force / most**2) if most > 1e-6 else (0.0, 0.0)
    return scales


def _straight_line_n(parameters: F64, thrust: F64) -> float:
    used = thrust[thrust != 0.0]
    return float((fan_force_n(parameters[None], used)[:, 0] * used).sum() / (used * used).sum())
