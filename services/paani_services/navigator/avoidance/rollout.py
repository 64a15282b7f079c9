"""Simulation of candidate headings and speeds: where each takes the boat, and where it coasts. Pure."""

import math
from typing import NamedTuple

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64
from paani.config import PlannerConfig
from paani.geometry import wrap_rad

RESIDUAL_DRIFT_MPS = 0.1  # speed that a boat with its thrusters off may keep from wind and current [m/s]
STEERING_SATURATION_RAD = 0.5  # heading error at which the controller's steering saturates [rad]
PIVOT_SPEED_FRACTION = 0.1  # of the allowed speed; at so little a boat that can pivots, all but on the spot
SPEED_FRACTIONS = (1.0, 0.5, PIVOT_SPEED_FRACTION)  # of the allowed speed that are sampled


class BoatState(NamedTuple):
    """Position, heading and velocity of the boat, from which candidates are rolled out."""

    x_m: float
    y_m: float
    yaw_rad: float
    surge_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    sway_mps: float = 0.0


class Trajectories(NamedTuple):
    """Simulated trajectories: positions and distance travelled [times, candidates], and times from now [times]."""

    x_m: F64
    y_m: F64
    travelled_m: F64
    time_s: F64


class GuidanceSetpoint(NamedTuple):
    """Course and speed asked for by guidance; the speed is the highest allowed.

    advised_side: 1 port, -1 starboard, 0 neither.
    is_pivot_only: a pivot to the advised side is asked for, and no way ahead.
    escape_mps: the highest speed out of the way of what comes to the boat, where it is above that asked for.
    """

    course_rad: float
    speed_mps: float
    advised_side: float = 0.0
    is_pivot_only: bool = False
    escape_mps: float = 0.0


class Plan(msgspec.Struct, frozen=True, rename={"is_waiting": "waits"}):
    """The heading and speed to order; speed 0 where no candidate is feasible. Recorded under the names of `rename`.

    `is_waiting`: the boat waits until a dynamic obstacle has passed; it may pivot meanwhile.
    """

    heading_rad: float
    speed_mps: float
    is_waiting: bool = False


def sample_candidates(start: BoatState, setpoint: GuidanceSetpoint, config: PlannerConfig) -> tuple[F64, F64]:
    """Headings relative to the present one, and speeds [n]: the desired course first, then its neighbours, port first.

    Every heading is given as the shorter turn. Where the desired course lies abaft the beam, headings beyond it are
    therefore reached by turning the other way round, which offers a way out past whatever lies abeam.
    """
    desired_rad = wrap_rad(setpoint.course_rad - start.yaw_rad)
    spacing_rad = math.radians(config.spacing_deg)
    count = math.floor(config.span_deg / config.spacing_deg)
    steps = [0, *(side * number for number in range(1, count + 1) for side in (1, -1))]
    if 2 * count * config.spacing_deg >= 360.0:
        steps.pop()  # the last two headings are the same one
    speed_mps = min(setpoint.speed_mps, config.speed_mps)
    fractions = SPEED_FRACTIONS if config.turn_radius_m == 0.0 else SPEED_FRACTIONS[:-1]
    offsets_rad = np.array([wrap_rad(desired_rad + step * spacing_rad) for step in steps for _ in fractions])
    return offsets_rad, np.array([fraction * speed_mps for fraction in fractions] * len(steps))


def roll_out(start: BoatState, offsets_rad: F64, speeds_mps: F64, config: PlannerConfig) -> Trajectories:
    """Simulate each candidate in steps of `step_s` up to `horizon_s`, then at full speed in double steps to `look_m`.

    Surge changes by `accel_mps2` at most. The boat turns to its heading by `yaw_rate_radps` at most and, for thrusters
    that only push, on no tighter circle than `turn_radius_m`. The present sway, from wind or current, goes on.
    """
    fine_steps = round(config.horizon_s / config.step_s)
    coarse_steps = math.ceil(config.look_m / (2.0 * config.step_s * config.speed_mps))
    steps_s = [config.step_s] * fine_steps + [2.0 * config.step_s] * coarse_steps
    count = offsets_rad.size
    cos, sin = (np.full(count, of(start.yaw_rad)) for of in (portable.cos, portable.sin))
    east_mps, north_mps = -start.sway_mps * sin, start.sway_mps * cos
    x_m, y_m, travelled_m = np.full(count, start.x_m), np.full(count, start.y_m), np.zeros(count)
    turned_rad, rate_radps = np.zeros(count), np.full(count, start.yaw_rate_radps)
    surge_mps = np.full(count, max(start.surge_mps, 0.0))
    rows = [(x_m, y_m, travelled_m)]
    for number, step_s in enumerate(steps_s):
        if number == fine_steps:  # beyond the horizon the path matters, not the time
            surge_mps = np.maximum(surge_mps, config.speed_mps)
            speeds_mps = np.maximum(speeds_mps, config.speed_mps)
        helm = _clip((offsets_rad - turned_rad) / STEERING_SATURATION_RAD, 1.0)
        driven_mps = np.maximum(speeds_mps, config.helm_speed_mps * np.abs(helm))
        surge_mps = surge_mps + _clip(driven_mps - surge_mps, config.accel_mps2 * step_s)
        limit_radps = np.full(count, config.yaw_rate_radps)
        if config.turn_radius_m > 0.0:
            limit_radps = np.minimum(limit_radps, surge_mps / config.turn_radius_m)
        rate_radps = rate_radps + _clip(helm * limit_radps - rate_radps, config.yaw_accel_radps2 * step_s)
        half = 0.5 * step_s * rate_radps
        turned_rad = turned_rad + 2.0 * half
        # A rotation by 2 atan(half), which is right to 1e-4 rad a step and needs no sine.
        scale = 1.0 + half * half
        cos, sin = (
            ((1.0 - half * half) * cos - 2.0 * half * sin) / scale,
            ((1.0 - half * half) * sin + 2.0 * half * cos) / scale,
        )
        step_m = surge_mps * step_s
        x_m, y_m = x_m + step_m * cos + step_s * east_mps, y_m + step_m * sin + step_s * north_mps
        travelled_m = travelled_m + step_m
        rows.append((x_m, y_m, travelled_m))
    xs, ys, paths = (np.stack(column) for column in zip(*rows, strict=True))
    return Trajectories(xs, ys, paths, np.concatenate([[0.0], np.cumsum(steps_s)]))


def roll_out_coasting(start: BoatState, time_s: F64, config: PlannerConfig) -> Trajectories:
    """Simulate the boat with its thrusters off and its heading kept: one trajectory, with a column of positions.

    Drag takes its surge off, except for `RESIDUAL_DRIFT_MPS`, which may be wind and current.
    """
    surge_mps = max(start.surge_mps, 0.0)
    residual_mps = min(surge_mps, RESIDUAL_DRIFT_MPS)
    own_mps, distances_m = surge_mps - residual_mps, [0.0]
    for step_s in np.diff(time_s).tolist():
        own_mps /= 1.0 + step_s * (config.drag_per_s + config.drag_per_m * own_mps)
        distances_m.append(distances_m[-1] + step_s * (residual_mps + own_mps))
    travelled_m = np.array(distances_m)[:, None]
    cos, sin = portable.cos(start.yaw_rad), portable.sin(start.yaw_rad)
    drift_m = (start.sway_mps * time_s)[:, None]
    x_m, y_m = start.x_m + cos * travelled_m - sin * drift_m, start.y_m + sin * travelled_m + cos * drift_m
    return Trajectories(x_m, y_m, travelled_m, time_s)


def with_coasting_and_resting(candidates: Trajectories, start: BoatState, config: PlannerConfig) -> Trajectories:
    """The candidates, and after them the boat that coasts from there, and the one that stays there."""
    coasting = roll_out_coasting(start, candidates.time_s, config)
    rests = np.ones((candidates.time_s.size, 1))
    resting = (start.x_m * rests, start.y_m * rests, 0.0 * rests)
    x_m, y_m, travelled_m = map(np.hstack, zip(candidates[:3], coasting[:3], resting, strict=True))
    return Trajectories(x_m, y_m, travelled_m, candidates.time_s)


def _clip(values: F64, limit: float) -> F64:
    return np.asarray(np.minimum(np.maximum(values, -limit), limit))
