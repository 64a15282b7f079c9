"""Where a boat gets by each of its candidates for heading and speed, and with its fans off. Pure."""

import math
from typing import NamedTuple

import numpy as np

from paani import portable
from paani.arrays import F64
from paani.config import PlannerConfig
from paani.geometry import wrap_rad

CARRIED_MPS = 0.1  # of a boat's speed with its fans off, what may be wind and current
FULL_HELM_RAD = 0.5  # the controller's steering saturates there
PARTS = (1.0, 0.5, 0.1)  # of the speed allowed that are tried; at the last a boat turns all but on the spot, if it can


class Start(NamedTuple):
    """Where the boat is and how it moves."""

    x_m: float
    y_m: float
    yaw_rad: float
    surge_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    sway_mps: float = 0.0


class Ways(NamedTuple):
    """Where candidates lead: positions and way made [times, candidates], times from now [times]."""

    x_m: F64
    y_m: F64
    way_m: F64
    at_s: F64


class Wish(NamedTuple):
    """The wanted course and the speed allowed. side: the one advised, 1 port, -1 starboard, 0 neither.

    turns: no way ahead is asked for, but a turn to that side where the boat lies.
    """

    course_rad: float
    speed_mps: float
    side: float = 0.0
    turns: bool = False


def candidates(start: Start, wish: Wish, config: PlannerConfig) -> tuple[F64, F64]:
    """Headings relative to the one now and speeds [n], the wanted one first, the nearest to it next, port before.

    Where the wanted course lies abaft the beam, those on its far side are turned to the other way round: a way out.
    """
    wanted_rad = wrap_rad(wish.course_rad - start.yaw_rad)
    spacing_rad = math.radians(config.spacing_deg)
    count = math.floor(config.span_deg / config.spacing_deg)
    steps = [0, *(side * number for number in range(1, count + 1) for side in (1, -1))]
    if 2 * count * config.spacing_deg >= 360.0:
        steps.pop()  # the same as the one before
    speed_mps = min(wish.speed_mps, config.speed_mps)
    parts = PARTS if config.turn_radius_m == 0.0 else PARTS[:-1]
    offsets = np.array([wrap_rad(wanted_rad + step * spacing_rad) for step in steps for _ in parts])
    return offsets, np.array([part * speed_mps for part in parts] * len(steps))


def roll_out(start: Start, offsets_rad: F64, speeds_mps: F64, config: PlannerConfig) -> Ways:
    """Where the boat gets in steps of `step_s` up to `horizon_s`, then at full speed and twice as long up to `look_m`.

    Speed changes by `accel_mps2` at most; it turns towards the heading by `yaw_rate_radps` at most and on no tighter
    circle than `turn_radius_m`, for fans that only push. What carries it sideways now, wind or current, goes on to.
    """
    fine = round(config.horizon_s / config.step_s)
    coarse = math.ceil(config.look_m / (2.0 * config.step_s * config.speed_mps))
    steps_s = [config.step_s] * fine + [2.0 * config.step_s] * coarse
    count = offsets_rad.size
    cos, sin = (np.full(count, of(start.yaw_rad)) for of in (portable.cos, portable.sin))
    east_mps, north_mps = -start.sway_mps * sin, start.sway_mps * cos
    x_m, y_m, way_m = np.full(count, start.x_m), np.full(count, start.y_m), np.zeros(count)
    turned, rate = np.zeros(count), np.full(count, start.yaw_rate_radps)
    speed = np.full(count, max(start.surge_mps, 0.0))
    rows = [(x_m, y_m, way_m)]
    for number, step_s in enumerate(steps_s):
        if number == fine:  # from here on the way counts, not when
            speed, speeds_mps = np.maximum(speed, config.speed_mps), np.maximum(speeds_mps, config.speed_mps)
        helm = _between((offsets_rad - turned) / FULL_HELM_RAD, 1.0)
        gain = config.accel_mps2 * step_s
        driven = np.maximum(speeds_mps, config.helm_speed_mps * np.abs(helm))
        speed = speed + _between(driven - speed, gain)
        fastest = np.full(count, config.yaw_rate_radps)
        if config.turn_radius_m > 0.0:
            fastest = np.minimum(fastest, speed / config.turn_radius_m)
        swing = config.yaw_accel_radps2 * step_s
        rate = rate + _between(helm * fastest - rate, swing)
        half = 0.5 * step_s * rate
        turned = turned + 2.0 * half
        # A rotation by 2 atan(half), which is right to 1e-4 rad a step and needs no sine.
        scale = 1.0 + half * half
        cos, sin = (
            ((1.0 - half * half) * cos - 2.0 * half * sin) / scale,
            ((1.0 - half * half) * sin + 2.0 * half * cos) / scale,
        )
        along = speed * step_s
        x_m, y_m = x_m + along * cos + step_s * east_mps, y_m + along * sin + step_s * north_mps
        way_m = way_m + along
        rows.append((x_m, y_m, way_m))
    xs, ys, ways = (np.stack(column) for column in zip(*rows, strict=True))
    return Ways(xs, ys, ways, np.concatenate([[0.0], np.cumsum(steps_s)]))


def coasting(start: Start, at_s: F64, config: PlannerConfig) -> Ways:
    """Where the boat gets with its fans off, on its heading: drag takes its way off, but for `CARRIED_MPS` of it."""
    surge = max(start.surge_mps, 0.0)
    carried = min(surge, CARRIED_MPS)
    own, way = surge - carried, [0.0]
    for step_s in np.diff(at_s).tolist():
        own /= 1.0 + step_s * (config.drag_per_s + config.drag_per_m * own)
        way.append(way[-1] + step_s * (carried + own))
    way_m = np.array(way)[:, None]
    cos, sin = portable.cos(start.yaw_rad), portable.sin(start.yaw_rad)
    drift_m = (start.sway_mps * at_s)[:, None]
    return Ways(start.x_m + cos * way_m - sin * drift_m, start.y_m + sin * way_m + cos * drift_m, way_m, at_s)


def _between(values: F64, limit: float) -> F64:
    """Each, but no further from zero than the limit."""
    return np.asarray(np.minimum(np.maximum(values, -limit), limit))
