"""Heading and speed on water that is known to be free: swept footprints over the grid (Q4-Q6). Pure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64, Bools
from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani_services.navigator.avoidance.clearance import (
    GAIN_M,
    all_spare_m,
    clearance_m,
    comes_near,
    footprint_m,
    gap_to_m,
    led,
    looked_up,
    margins,
    nearest_m,
    spare_m,
)
from paani_services.navigator.avoidance.rollout import (
    CARRIED_MPS,
    PARTS,
    Start,
    Ways,
    Wish,
    candidates,
    coasting,
    roll_out,
)
from paani_services.navigator.mapping.distance_field import distance_m
from paani_services.navigator.mapping.dynamic_obstacles import Mover
from paani_services.navigator.mapping.occupancy_grid import Grid

QUARTER = 0.5 * math.pi
LOSE_M = 0.2  # on a way out: a turning boat's way ahead
ONWARD_RAD = math.radians(75.0)  # off the wanted course; further off, a quarter of the way at most is made good
PEOPLE_SLACK_M = 0.05  # a quarter of a cell, for looking it up
ON_THE_SPOT_RAD = math.radians(20.0)  # by less it does not turn so: it would creep along, where it may wait
IN_VIEW_RAD = math.radians(35.0)  # off the bow; no usual lens shows less
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


class Tried(NamedTuple):
    """What each candidate meets: [candidates], or [times, candidates] of `ways`.

    off_rad: off the wanted course. soon: times within the horizon [times, 1]. nearby: so soon, or within `room_m`.
    gap_m: to what stands. nearest_m: to what moves, too. coast: where it gets with its fans off. coast_m: how near it
    comes there within the horizon.
    tight_m: hull and `tight_margin_m`. is_approached: what moves for certain comes that near to a boat that coasts.
    """

    movers: Sequence[Mover]
    offsets: F64
    speeds: F64
    off_rad: F64
    is_full: Bools
    turns: Bools
    ways: Ways
    soon: Bools
    nearby: Bools
    gap_m: F64
    nearest_m: F64
    to_people_m: F64
    unseen: Bools
    tight_m: float
    is_approached: bool
    coast: Ways
    coast_m: float


class Room(NamedTuple):
    """What a margin leaves of them: refused, and moved: met by what moves [candidates]; met, spare_m as in `Tried`."""

    refused: Bools
    met: Bools
    spare_m: F64
    moved: Bools


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
    that brings it no nearer: one that flees keeps abreast. A boat that lay still turns to a course out of its view
    before it goes: what came up meanwhile it has not seen. Where what moves would come to a boat that waits, less of a
    margin is kept to it too. Who may swim, but was not seen to while it waited, is kept clear of as what stands.
    Costs: off the wanted course, not to the advised side, near to things, within the margin, ahead of what moves, into
    the unknown, little made good, another than before.
    """
    nowhere = Plan(start.yaw_rad, 0.0)
    if wish.speed_mps <= 0.0 or not grid.free.any():
        return nowhere
    movers = [each for each in moving if each.age_s <= config.unseen_s and (patient or each.is_sure)]
    way = _tried(grid, start, wish, movers, config)
    barred = _barred(way, start, wish, config)
    room = _room(way, barred, start, wish, config)
    refused, onward = room.refused, way.off_rad <= ONWARD_RAD
    is_held_up = bool((refused | way.turns)[onward].all() and room.moved[onward].any())
    waits = patient and is_held_up and not way.is_approached and way.coast_m >= way.tight_m
    if waits:
        refused = barred | ~_faces(way) | (room.met & way.soon).any(axis=0)
    elif _lay_averted(way, start, before) and not (averted := _turns_about(way, barred, start, config)).all():
        refused = averted
    elif refused.all():
        refused = ~_leads_out(way) | ~_leads_away(way, start, config) | barred
        if refused.all():
            refused = ~_passes_wider(way, barred | way.is_full)
    if refused.all():
        return nowhere
    cost = _costs(way, room, start, wish, before, config)
    best = int(np.where(refused, np.inf, cost).argmin())
    return Plan(wrap_rad(start.yaw_rad + float(way.offsets[best])), float(way.speeds[best]), waits)


def _tried(grid: Grid, start: Start, wish: Wish, movers: Sequence[Mover], config: PlannerConfig) -> Tried:
    offsets, speeds = candidates(start, wish, config)
    ways, clear_m = roll_out(start, offsets, speeds, config), clearance_m(grid, config)
    gap_m, tight_m = looked_up(grid, clear_m, ways), config.hull_radius_m + config.tight_margin_m
    soon = (ways.at_s <= config.horizon_s + 1e-9)[:, None]
    coast, last = coasting(start, ways.at_s, config), int(soon.sum()) - 1
    coast_m = nearest_m(looked_up(grid, clear_m, coast), movers, coast)
    return Tried(
        movers,
        offsets,
        speeds,
        off_rad=_apart_rad(offsets, float(offsets[0])),
        is_full=speeds == speeds[0],
        turns=speeds == PARTS[-1] * speeds[0],
        ways=ways,
        soon=soon,
        nearby=soon | (ways.way_m <= config.room_m),
        gap_m=gap_m,
        nearest_m=nearest_m(gap_m, movers, ways),
        to_people_m=looked_up(grid, distance_m(grid.people), ways),
        unseen=looked_up(grid, distance_m(grid.unknown), ways) < config.hull_radius_m,
        tight_m=tight_m,
        is_approached=comes_near(movers, coast.x_m[last], coast.y_m[last], tight_m),
        coast=coast,
        coast_m=float(np.where(soon, coast_m, np.inf).min()),
    )


def _barred(way: Tried, start: Start, wish: Wish, config: PlannerConfig) -> Bools:
    """What no lesser margin allows [candidates]."""
    to_rest_m = config.stop_s * np.maximum(way.speeds, start.surge_mps)
    barred: Bools = np.asarray((way.unseen & (way.ways.way_m <= to_rest_m)).any(axis=0))
    barred |= way.turns & (_apart_rad(way.offsets, 0.0) < ON_THE_SPOT_RAD)
    if wish.turns:
        barred |= ~way.turns | (wish.side * way.offsets < ON_THE_SPOT_RAD)
    if way.gap_m[0, 0] >= config.hull_radius_m + config.margin_m:  # before a dead end it waits, and does not circle
        barred |= np.abs(way.offsets - way.offsets[0]) > math.radians(config.span_deg) + 1e-9
    kept_m = min(way.tight_m, float(way.to_people_m[0, 0])) - PEOPLE_SLACK_M  # whatever else leads out
    barred |= ((way.to_people_m < kept_m) & way.nearby).any(axis=0)
    return barred | (way.is_full & ((way.nearest_m < way.tight_m) & way.soon).any(axis=0))


def _room(way: Tried, barred: Bools, start: Start, wish: Wish, config: PlannerConfig) -> Room:
    """With the largest margin that leaves a way; else with the least.

    To what moves the whole margin is kept, unless it comes to a boat at rest: else lying still is no worse beside it.
    """
    moved_m = all_spare_m(way.movers, way.ways, start, config)
    footprints = margins(config)
    while True:
        kept = footprints.pop(0)
        if way.is_approached and kept is not config:
            moved_m = all_spare_m(way.movers, way.ways, start, kept)
        least_m = np.minimum(way.gap_m - footprint_m(way.ways.at_s, way.gap_m[0, 0], kept)[:, None], moved_m)
        met = least_m < 0.0
        refused = (met & way.nearby).any(axis=0) | barred
        if kept is not config:
            refused |= way.is_full
        if footprints and not wish.turns:
            refused |= way.turns & (way.off_rad > ONWARD_RAD)
        if not (refused.all() and footprints):
            return Room(refused, met, least_m, np.asarray(((moved_m < 0.0) & way.nearby).any(axis=0)))


def _faces(way: Tried) -> Bools:
    """The turn on the spot to the wanted course [candidates]."""
    return np.asarray(way.turns & (way.offsets == way.offsets[0]))


def _lay_averted(way: Tried, start: Start, before: Plan | None) -> bool:
    """Whether a boat that lay still, or has begun to turn on the spot to its course since, does not see that way."""
    if start.surge_mps > CARRIED_MPS or abs(float(way.offsets[0])) <= IN_VIEW_RAD:
        return False
    if before is None or before.speed_mps == 0.0:
        return True
    off_rad = wrap_rad(before.heading_rad - start.yaw_rad - float(way.offsets[0]))
    return before.speed_mps <= PARTS[-1] * float(way.speeds[0]) and abs(off_rad) < 0.5 * ON_THE_SPOT_RAD


def _turns_about(way: Tried, barred: Bools, start: Start, config: PlannerConfig) -> Bools:
    """All but the turn on the spot to the wanted course, and that where hull and half a cell are not free for it."""
    kept = margins(config)[-1]
    moved_m = all_spare_m(way.movers, way.ways, start, kept if way.is_approached else config)
    room_m = np.minimum(way.gap_m - (kept.hull_radius_m + kept.margin_m), moved_m)
    return np.asarray(barred | ~_faces(way) | ((room_m < 0.0) & way.soon).any(axis=0))


def _leads_out(way: Tried) -> Bools:
    """Ways along which what stands comes hardly nearer than it is, and is further away in the end [candidates].

    In the end of `room_m`: what begins with a turn on the spot gets nowhere within the horizon.
    """
    least_m = np.where(way.nearby, way.gap_m, np.inf).min(axis=0)
    last = way.nearby.sum(axis=0) - 1
    now_m, last_m = way.gap_m[0, 0], way.gap_m[last, np.arange(last.size)]
    return np.asarray((least_m >= now_m - LOSE_M) & (last_m >= now_m + GAIN_M))


def _leads_away(way: Tried, start: Start, config: PlannerConfig) -> Bools:
    """Ways that keep clear of each thing that moves, or of where it may be by now: then like `_leads_out` [candidates].

    Measured against a boat that coasts: what was not seen for long may be anywhere around it, the more the later.
    """
    fine, soon = np.ones(way.offsets.size, np.bool_), way.soon[:, 0]
    kept = margins(config)[-1] if way.is_approached else config
    for mover in way.movers:
        is_clear = ((spare_m(mover, way.ways, start, kept) >= 0.0) | ~way.nearby).all(axis=0)
        there_m, here_m = (
            gap_to_m(mover, each.x_m, each.y_m, each.at_s[:, None])[soon] for each in (way.ways, way.coast)
        )
        is_left = (there_m >= here_m - LOSE_M).all(axis=0) & (there_m[-1] >= here_m[-1] + GAIN_M)
        fine &= is_clear | is_left
    return fine


def _passes_wider(way: Tried, barred: Bools) -> Bools:
    """Ways that keep further off all through the horizon than a boat that coasts on, and hardly less than the best."""
    least_m = np.where(barred, -np.inf, np.where(way.soon, way.nearest_m, np.inf).min(axis=0))
    return np.asarray(least_m >= max(way.coast_m + GAIN_M, float(least_m.max()) - 0.5 * GAIN_M))


def _costs(way: Tried, room: Room, start: Start, wish: Wish, before: Plan | None, config: PlannerConfig) -> F64:
    """Of each candidate."""
    made_good = way.speeds / way.speeds[0] * np.array([portable.cos(each) for each in way.off_rad.tolist()])
    cost = way.off_rad / QUARTER + SLOW * (1.0 - made_good)
    if before is not None and before.speed_mps > 0.0:
        cost = cost + CHANGE * _apart_rad(way.offsets, wrap_rad(before.heading_rad - start.yaw_rad)) / QUARTER
    cost = cost + _unadvised(way.offsets, wish.side)
    cost = cost + _way_costs(way, room, start, config)
    within_m = np.where(way.soon, np.maximum(config.hull_radius_m + config.margin_m - way.nearest_m, 0.0), 0.0)
    return np.asarray(cost + WITHIN * np.add.accumulate(within_m)[-1] / float(way.soon.sum()))


def _way_costs(way: Tried, room: Room, start: Start, config: PlannerConfig) -> F64:
    looked = way.ways.way_m <= config.look_m
    cost = UNKNOWN * (way.unseen & looked).sum(axis=0) / len(looked)
    ahead_m = all_spare_m([led(mover, config.lead_s) for mover in way.movers], way.ways, start, config)
    nearest = np.where(way.soon, np.minimum(room.spare_m, ahead_m), np.inf).min(axis=0)
    near = np.clip(1.0 - nearest / CLEAR_M, 0.0, 1.0)
    cost = cost + CLOSE * near * near
    if config.look_m > 0.0:
        first_m = np.where(room.met & looked, way.ways.way_m, np.inf).min(axis=0)
        cost = cost + SOON * np.clip(1.0 - first_m / config.look_m, 0.0, 1.0)
    return np.asarray(cost)


def _unadvised(offsets: F64, side: float) -> F64:
    return np.asarray(ADVICE * abs(side) * np.minimum(np.maximum(1.0 - side * offsets / ADVISED_RAD, 0.0), 1.0))


def _apart_rad(angles_rad: F64, other_rad: float) -> F64:
    """Between each and the other, both wrapped [0, pi]."""
    off = np.abs(angles_rad - other_rad)
    return np.asarray(np.minimum(off, 2.0 * math.pi - off))
