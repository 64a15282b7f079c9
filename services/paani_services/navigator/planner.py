"""Heading and speed on water that is known to be free: swept footprints over the grid (checklist Q4-Q6). Pure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from paani import portable
from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani_services.navigator.distances import distance_m, signed_m
from paani_services.navigator.grid import CELLS, Grid
from paani_services.navigator.movers import Mover
from paani_services.navigator.projection import F64
from paani_services.navigator.shown import CELL_M, Mask

QUARTER = 0.5 * math.pi
LOSE_M, GAIN_M = 0.2, 0.1  # of a way out: a turning boat's way ahead, and half a cell
ONWARD_RAD = math.radians(75.0)  # off the wanted course; further off, a quarter of the way at most is made good
ASTRAY_MPS = 0.1  # what is out of sight changes its course and speed: measured, 1.2 m in 12 s
AHEAD_S = np.arange(0.0, 30.5, 0.5)  # a boat that turns away from what comes at 0.13 m/s takes 20 s
CARRIED_MPS = 0.1  # of a boat's speed with its fans off, what may be wind and current
PEOPLE_SLACK_M = 0.05  # a quarter of a cell, for looking it up
FULL_HELM_RAD = 0.5  # the controller's steering saturates there
PARTS = (1.0, 0.5, 0.1)  # of the speed allowed that are tried; at the last a boat turns all but on the spot, if it can
ON_THE_SPOT_RAD = math.radians(20.0)  # by less it does not: it would creep along, where it may wait
# Weights of a candidate's cost: a quarter turn off the wanted course is 1.
SOON = 3.0  # something on the way; less the farther, nothing beyond `look_m`
CLOSE, CLEAR_M = 0.6, 2.0  # footprint touches something; less up to this clearance, by the square
WITHIN = 10.0  # a metre within hull and margin, all through the horizon: what leads out of it is better
UNKNOWN = 0.3  # all of the way is unknown: turn to what is seen, and see further from there
SLOW = 0.3  # nothing made good
CHANGE = 0.15  # a quarter turn off the plan before
ADVICE, ADVISED_RAD = 0.15, math.radians(25.0)  # not the advised side; nothing from a full turn to it on (M5)


class Plan(msgspec.Struct, frozen=True):
    """Where to steer and how fast; 0: nowhere is free. waits: until something has passed, but may turn meanwhile."""

    heading_rad: float
    speed_mps: float
    waits: bool = False


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


def plan(
    grid: Grid,
    start: Start,
    wish: Wish,
    before: Plan | None,
    config: PlannerConfig,
    moving: Sequence[Mover] = (),
    *,
    patient: bool = True,
) -> Plan:
    """The best of headings around the wanted course at three speeds, none of which meets anything.

    Refused is what sweeps an occupied cell within `horizon_s` or `room_m` (Q4, Q6), what comes too near to where a
    moving thing is by then, or sweeps an unknown cell within the way to stop. Where that is everything, less of a
    margin is kept to what stands, or else a way is taken that leads out from beside it, or at last the one that keeps
    furthest off, if that is further than coasting: fans that are off leave the boat to its way, wind and current. No
    way leads nearer to a person than hull and `tight_margin_m`; none within that of anything is taken at full speed.
    Where what moves leaves no way onward, a patient boat waits until it has passed, turned to its course as far as
    that brings it no nearer: one that flees keeps abreast. Where that would come to a boat that waits, less of a
    margin is kept to it too. Who may swim, but was not seen to while it waited, is kept clear of as what stands.
    Costs: off the wanted course, not to the advised side, near to things, within the margin, ahead of what moves, into
    the unknown, little made good, another than before.
    """
    nowhere = Plan(start.yaw_rad, 0.0)
    if wish.speed_mps <= 0.0 or not grid.free.any():
        return nowhere
    offsets, speeds = candidates(start, wish, config)
    is_full, tight_m = speeds == speeds[0], config.hull_radius_m + config.tight_margin_m
    turns = speeds == PARTS[-1] * speeds[0]
    ways = roll_out(start, offsets, speeds, config)
    clear_m = clearance_m(grid, config)
    gap_m = _looked_up(grid, clear_m, ways)
    unseen = _looked_up(grid, distance_m(grid.unknown), ways) < config.hull_radius_m
    barred = (unseen & (ways.way_m <= config.stop_s * np.maximum(speeds, start.surge_mps))).any(axis=0)
    barred |= turns & (_apart_rad(offsets, 0.0) < ON_THE_SPOT_RAD)
    if wish.turns:
        barred |= ~turns | (wish.side * offsets < ON_THE_SPOT_RAD)
    span_rad = math.radians(config.span_deg) + 1e-9
    if gap_m[0, 0] >= config.hull_radius_m + config.margin_m:
        barred |= np.abs(offsets - offsets[0]) > span_rad  # before a dead end it waits, and does not circle
    soon = (ways.at_s <= config.horizon_s + 1e-9)[:, None]
    nearby, looked = soon | (ways.way_m <= config.room_m), ways.way_m <= config.look_m
    to_people_m = _looked_up(grid, distance_m(grid.people), ways)
    kept_m = min(tight_m, float(to_people_m[0, 0]))  # whatever else leads out
    barred |= ((to_people_m < kept_m - PEOPLE_SLACK_M) & nearby).any(axis=0)
    movers = [each for each in moving if each.age_s <= config.unseen_s and (patient or each.is_sure)]
    coast = coasting(start, ways.at_s, config)
    last = int(soon.sum()) - 1
    is_approached = _comes_near(movers, coast.x_m[last], coast.y_m[last], tight_m)
    nearest_m = _nearest_m(gap_m, movers, ways)
    barred |= is_full & ((nearest_m < tight_m) & soon).any(axis=0)  # no faster than it must so near
    moved_m = _all_spare_m(movers, ways, start, config)
    footprints = _footprints(config)
    while True:
        kept = footprints.pop(0)
        if is_approached and kept is not config:  # else it keeps its whole margin: lying still is no worse beside it
            moved_m = _all_spare_m(movers, ways, start, kept)
        spare_m = np.minimum(gap_m - footprint_m(ways.at_s, gap_m[0, 0], kept)[:, None], moved_m)
        met = spare_m < 0.0
        refused = (met & nearby).any(axis=0) | barred
        if kept is not config:
            refused |= is_full
        if footprints and not wish.turns:
            refused |= turns & (_apart_rad(offsets, float(offsets[0])) > ONWARD_RAD)
        if not (refused.all() and footprints):
            break
    moved: Mask = np.asarray(((moved_m < 0.0) & nearby).any(axis=0))
    coast_m = _nearest_m(_looked_up(grid, clear_m, coast), movers, coast)
    is_safe = not is_approached and np.where(soon, coast_m, np.inf).min() >= tight_m
    waits = patient and is_safe and _is_held_up(offsets, refused | turns, moved)
    if waits:
        refused = barred | ~turns | (offsets != offsets[0]) | (met & soon).any(axis=0)  # it looks that way meanwhile
    elif refused.all():
        refused = ~_leads_out(gap_m, nearby, soon) | moved | barred
    if refused.all() and not waits:
        refused = ~_passes_wider(nearest_m, coast_m, soon, barred | is_full)
    if refused.all():
        return nowhere
    led = [_led(mover, config.lead_s) for mover in movers]
    roomy_m = np.minimum(spare_m, _all_spare_m(led, ways, start, config))
    within_m = np.where(soon, np.maximum(config.hull_radius_m + config.margin_m - nearest_m, 0.0), 0.0)
    cost = _costs(offsets, speeds, start, before) + _unadvised(offsets, wish.side)
    cost = cost + _way_costs(ways, roomy_m, met & looked, unseen & looked, soon, config)
    cost = cost + WITHIN * np.add.accumulate(within_m)[-1] / float(soon.sum())
    best = int(np.where(refused, np.inf, cost).argmin())
    return Plan(wrap_rad(start.yaw_rad + float(offsets[best])), float(speeds[best]), waits)


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


def footprint_m(at_s: F64, gap_m: float | F64, config: PlannerConfig) -> F64:
    """The radius that must be free at each time: hull, margin, and drift within the horizon (Q6).

    gap_m: to the nearest thing, boat at rest. Where that is less, a way that comes no nearer is allowed: it leads out.
    Within a thing both are negative.
    """
    drift_m = np.where(at_s <= config.horizon_s + 1e-9, config.drift_mps * at_s, 0.0)
    radius_m = config.hull_radius_m + config.margin_m + drift_m
    return np.asarray(np.minimum(radius_m, gap_m - 0.5 * CELL_M))


def _footprints(config: PlannerConfig) -> list[PlannerConfig]:
    """Margins and drift to keep, the largest first: the whole one, half way to Q6's, that, the hull and half a cell."""
    half_way_m = 0.5 * (config.margin_m + config.tight_margin_m)
    less = ((half_way_m, config.drift_mps), (config.tight_margin_m, config.drift_mps), (0.5 * CELL_M, 0.0))
    tighter = [(margin_m, drift_mps) for margin_m, drift_mps in less if margin_m < config.margin_m]
    return [config, *(msgspec.structs.replace(config, margin_m=m, drift_mps=d) for m, d in tighter)]


def _is_held_up(offsets: F64, refused: Mask, moved: Mask) -> bool:
    """Nothing leads onward, and something that moves is in the way there [candidates]."""
    onward = _apart_rad(offsets, float(offsets[0])) <= ONWARD_RAD
    return bool(refused[onward].all() and moved[onward].any())


def _comes_near(movers: Sequence[Mover], x_m: F64, y_m: F64, tight_m: float) -> bool:
    """Something that moves for certain comes to a boat that lies there [1], if it goes on as it does."""
    for mover in movers:
        as_it_does = mover._replace(motion=mover.motion._replace(deviation_mps=0.0))
        gaps_m = gap_to_m(as_it_does, x_m, y_m, AHEAD_S)
        if mover.is_sure and gaps_m.min() < min(tight_m, gaps_m[0] - GAIN_M):
            return True
    return False


def _leads_out(gap_m: F64, nearby: Mask, soon: Mask) -> Mask:
    """Ways along which what stands comes hardly nearer than it is, and is further away in the end [candidates]."""
    least_m = np.where(nearby, gap_m, np.inf).min(axis=0)
    last_m = gap_m[int(soon.sum()) - 1]
    return np.asarray((least_m >= gap_m[0, 0] - LOSE_M) & (last_m >= gap_m[0, 0] + GAIN_M))


def _passes_wider(nearest_m: F64, coast_m: F64, soon: Mask, barred: Mask) -> Mask:
    """Ways that keep further off all through the horizon than a boat that coasts on, and hardly less than the best."""
    least_m = np.where(barred, -np.inf, np.where(soon, nearest_m, np.inf).min(axis=0))
    wider_m = float(np.where(soon, coast_m, np.inf).min()) + GAIN_M
    return np.asarray(least_m >= max(wider_m, float(least_m.max()) - 0.5 * GAIN_M))


def _nearest_m(gap_m: F64, movers: Sequence[Mover], ways: Ways) -> F64:
    """To what stands and to what moves [times, candidates]."""
    return np.asarray(
        np.minimum.reduce([gap_m, *(gap_to_m(each, ways.x_m, ways.y_m, ways.at_s[:, None]) for each in movers)])
    )


def gap_to_m(mover: Mover, x_m: F64, y_m: F64, at_s: F64) -> F64:
    """From places to the outline of a thing that moves on, at these times from now; less what is kept beside it.

    Uncertainty is one standard deviation of its velocity, and `ASTRAY_MPS` from when it was last seen.
    """
    motion = mover.motion
    east_m, north_m = x_m - at_s * motion.east_mps, y_m - at_s * motion.north_mps
    square = np.full(east_m.shape, np.inf)
    for x, y in zip(mover.east_m.tolist(), mover.north_m.tolist(), strict=True):
        east, north = east_m - x, north_m - y
        square = np.minimum(square, east * east + north * north)
    astray_m = motion.deviation_mps * (at_s + mover.age_s) + ASTRAY_MPS * mover.age_s
    return np.asarray(np.sqrt(square) - mover.room_m - astray_m)


def _all_spare_m(movers: Sequence[Mover], ways: Ways, start: Start, config: PlannerConfig) -> F64:
    """`_spare_m` of the nearest; without any, without end."""
    far_m = np.full(ways.x_m.shape, np.inf)
    return np.asarray(np.minimum.reduce([far_m, *(_spare_m(each, ways, start, config) for each in movers)]))


def _spare_m(mover: Mover, ways: Ways, start: Start, config: PlannerConfig) -> F64:
    """Between the footprint and a thing that moves. What comes near a boat at rest may come no nearer on the way."""
    at_s = ways.at_s[:, None]
    rest_m = gap_to_m(mover, np.full_like(at_s, start.x_m), np.full_like(at_s, start.y_m), at_s)[:, 0]
    rest_m = np.minimum.accumulate(np.where(ways.at_s <= config.horizon_s + 1e-9, rest_m, np.inf))
    kept_m = np.maximum(footprint_m(ways.at_s, rest_m, config), 0.0)  # nothing excuses a way into its room
    return np.asarray(gap_to_m(mover, ways.x_m, ways.y_m, at_s) - kept_m[:, None])


def _led(mover: Mover, lead_s: float) -> Mover:
    """The same so much later: what comes near this one passes ahead of it."""
    motion = mover.motion
    return mover._replace(
        east_m=mover.east_m + lead_s * motion.east_mps, north_m=mover.north_m + lead_s * motion.north_mps
    )


def clearance_m(grid: Grid, config: PlannerConfig) -> F64:
    """From the middle of each cell to what is there, at most 4 m; negative within, the further in the less [100, 100].

    What is out of sight may have drifted nearer; a person or a vessel may be anywhere in `Grid.strayed`.
    """
    drifted_m = signed_m(grid.hidden) - config.hidden_drift_m
    found_m = np.minimum(signed_m(grid.occupied), drifted_m)
    return np.minimum(found_m, signed_m(grid.strayed)) if grid.strayed.any() else found_m


def _looked_up(grid: Grid, field: F64, ways: Ways) -> F64:
    """The field at these places, between the middles of four cells; at the rim of the grid, the rim's."""
    column = np.clip((ways.x_m - grid.west_m) / CELL_M - 0.5, 0.0, CELLS - 1.001)
    row = np.clip((ways.y_m - grid.south_m) / CELL_M - 0.5, 0.0, CELLS - 1.001)
    left, low = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right_part, high_part = column - left, row - low
    flat, at = field.ravel(), low * CELLS + left
    lower = flat[at] * (1.0 - right_part) + flat[at + 1] * right_part
    upper = flat[at + CELLS] * (1.0 - right_part) + flat[at + CELLS + 1] * right_part
    return np.asarray(lower * (1.0 - high_part) + upper * high_part)


def _costs(offsets: F64, speeds: F64, start: Start, before: Plan | None) -> F64:
    off_rad = _apart_rad(offsets, float(offsets[0]))
    made_good = speeds / speeds[0] * np.array([portable.cos(each) for each in off_rad.tolist()])
    cost = off_rad / QUARTER + SLOW * (1.0 - made_good)
    if before is not None and before.speed_mps > 0.0:
        cost = cost + CHANGE * _apart_rad(offsets, wrap_rad(before.heading_rad - start.yaw_rad)) / QUARTER
    return np.asarray(cost)


def _apart_rad(angles_rad: F64, other_rad: float) -> F64:
    """Between each and the other, both wrapped [0, pi]."""
    off = np.abs(angles_rad - other_rad)
    return np.asarray(np.minimum(off, 2.0 * math.pi - off))


def _unadvised(offsets: F64, side: float) -> F64:
    return np.asarray(ADVICE * abs(side) * np.minimum(np.maximum(1.0 - side * offsets / ADVISED_RAD, 0.0), 1.0))


def _way_costs(ways: Ways, spare_m: F64, met: Mask, unseen: Mask, soon: Mask, config: PlannerConfig) -> F64:
    """spare_m: between the footprint and the nearest thing. soon: times within the horizon [times, 1]."""
    cost = UNKNOWN * unseen.sum(axis=0) / len(unseen)
    nearest = np.where(soon, spare_m, np.inf).min(axis=0)
    near = np.clip(1.0 - nearest / CLEAR_M, 0.0, 1.0)
    cost = cost + CLOSE * near * near
    if config.look_m > 0.0:
        first_m = np.where(met, ways.way_m, np.inf).min(axis=0)
        cost = cost + SOON * np.clip(1.0 - first_m / config.look_m, 0.0, 1.0)
    return np.asarray(cost)
