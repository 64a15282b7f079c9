"""The local planner: the best of sampled headings and speeds that meets no obstacle (Q4-Q6). Pure.

In the manner of the dynamic window approach (Fox, Burgard, Thrun: "The dynamic window approach to collision avoidance",
IEEE Robotics & Automation Magazine, 1997): candidates are rolled out, checked against constraints, and weighed by cost.
"""

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
    ESCAPE_GAIN_M,
    advanced_in_time,
    clearance_field_m,
    interpolate_field,
    is_give_way_needed,
    least_clearance_m,
    least_separation_margin_m,
    margins,
    predicted_clearance_m,
    required_clearance_m,
    separation_margin_m,
)
from paani_services.navigator.avoidance.rollout import (
    PIVOT_SPEED_FRACTION,
    RESIDUAL_DRIFT_MPS,
    BoatState,
    GuidanceSetpoint,
    Trajectories,
    roll_out,
    roll_out_coasting,
    sample_candidates,
)
from paani_services.navigator.mapping.distance_field import distance_field_m
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid

QUARTER_TURN_RAD = 0.5 * math.pi
ESCAPE_TOLERANCE_M = 0.2  # clearance that a way out may lose before it gains [m]: the advance of a boat while it turns
# Deviation from the desired course up to which a candidate leads onward [rad]; beyond it less than a quarter of the
# distance sailed is made good.
ONWARD_SECTOR_RAD = math.radians(75.0)
PERSON_DISTANCE_TOLERANCE_M = 0.05  # error of an interpolated distance to a person [m]: a quarter of a cell
MIN_PIVOT_RAD = math.radians(20.0)  # smaller pivots are not made: the boat would creep where it may wait
HALF_FIELD_OF_VIEW_RAD = math.radians(35.0)  # what lies further off the bow is not seen; no usual lens shows less

# Weights of the cost of a candidate. The unit is the cost of a quarter turn off the desired course.
PATH_OBSTACLE_WEIGHT = 3.0  # an obstacle on the path at the boat; it falls linearly to none at `look_m`
PROXIMITY_WEIGHT = 0.6  # required clearance just kept; it falls with the square to none at PROXIMITY_RANGE_M beyond it
PROXIMITY_RANGE_M = 2.0
MARGIN_INTRUSION_WEIGHT = 10.0  # a metre of intrusion into the safety margin, held over the whole horizon
UNKNOWN_WATER_WEIGHT = 0.3  # a path all over unknown water: the boat turns to what it sees, and sees further from there
LOST_PROGRESS_WEIGHT = 0.3  # nothing made good along the desired course
HEADING_CHANGE_WEIGHT = 0.15  # a quarter turn off the heading of the plan before
ADVICE_WEIGHT = 0.15  # nothing turned to the advised side (M5); it falls linearly to none at ADVISED_TURN_RAD
ADVISED_TURN_RAD = math.radians(25.0)


class Plan(msgspec.Struct, frozen=True, rename={"is_waiting": "waits"}):
    """The heading and speed to order; speed 0 where no candidate is feasible. Recorded under the names of `rename`.

    `is_waiting`: the boat waits until a dynamic obstacle has passed; it may pivot meanwhile.
    """

    heading_rad: float
    speed_mps: float
    is_waiting: bool = False


class CandidateEvaluation(NamedTuple):
    """What each candidate meets: [candidates], or [times, candidates] of `trajectories`.

    deviation_rad: off the desired course.
    is_in_horizon: times within `horizon_s` [times, 1]; is_in_checked_range: those, or within `room_m` of path.
    static_clearance_m: to static obstacles; clearance_m: to dynamic ones as well; person_distance_m: to seen people.
    tight_clearance_m: hull and `tight_margin_m`.
    is_give_way_needed: a dynamic obstacle will come nearer than that to a boat that coasts to rest.
    coasting: the trajectory with the thrusters off; coasting_clearance_m: its least clearance within the horizon.
    """

    obstacles: Sequence[DynamicObstacle]
    offsets_rad: F64
    speeds_mps: F64
    deviation_rad: F64
    is_full_speed: Bools
    is_pivot: Bools
    trajectories: Trajectories
    is_in_horizon: Bools
    is_in_checked_range: Bools
    static_clearance_m: F64
    clearance_m: F64
    person_distance_m: F64
    is_unknown: Bools
    tight_clearance_m: float
    is_give_way_needed: bool
    coasting: Trajectories
    coasting_clearance_m: float


class MarginCheck(NamedTuple):
    """What a margin leaves of the candidates.

    is_infeasible, and is_blocked_by_dynamic: a dynamic obstacle is too near [candidates].
    margin_m: clearance beyond the required one, is_intruding: where that is negative [times, candidates].
    """

    is_infeasible: Bools
    is_intruding: Bools
    margin_m: F64
    is_blocked_by_dynamic: Bools


def plan_motion(
    grid: OccupancyGrid,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    previous: Plan | None,
    config: PlannerConfig,
    tracked: Sequence[DynamicObstacle] = (),
    *,
    may_wait: bool = True,
) -> Plan:
    """Choose the cheapest feasible candidate.

    Candidates are headings around the desired course at three speeds, each rolled out through the boat's turn-rate and
    acceleration limits. A candidate is infeasible if its swept hull
      1. enters an occupied cell within `horizon_s` or `room_m` (Q4, Q6),
      2. comes closer to the predicted position of a dynamic obstacle than its separation margin,
      3. enters an unknown cell before the boat could stop,
      4. comes nearer to a person than hull and `tight_margin_m`, or
      5. comes that near to anything at full speed.
    If none is feasible, margins to static obstacles are relaxed in the order of `margins()`; margins to dynamic ones
    are relaxed only if one of them would come to a boat at rest. If still none is, the planner returns the cheapest
    candidate that escapes from the nearest obstacle, else one that keeps further off than coasting would: a boat with
    its thrusters off is carried on by its own way, wind and current. If there is none, it returns a stop.

    Three situations come first:
      * If dynamic obstacles alone leave no candidate onward, the boat waits until they have passed, as long as it
        `may_wait` and is safe at rest. It pivots to its course meanwhile where that brings it no nearer.
      * A boat that stopped facing away from its course pivots to it before it moves, because it has not seen what came
        up on that side.
      * Once the boat may wait no longer, people who may swim but were not seen to are static obstacles.

    The cost is the sum of: deviation from the course, lost progress, change of heading, disregard of the advised side,
    unknown water, nearness to obstacles and to places ahead of dynamic ones, obstacles further along the path, and
    intrusion into the margin.
    """
    stop = Plan(start.yaw_rad, 0.0)
    if setpoint.speed_mps <= 0.0 or not grid.free.any():
        return stop
    obstacles = [each for each in tracked if each.age_s <= config.unseen_s and (may_wait or each.is_moving)]
    evaluation = _evaluate_candidates(grid, start, setpoint, obstacles, config)
    forbidden = _hard_constraints(evaluation, start, setpoint, config)
    check = _relax_margin(evaluation, forbidden, start, setpoint, config)
    infeasible, onward = check.is_infeasible, evaluation.deviation_rad <= ONWARD_SECTOR_RAD
    is_held_up = bool((infeasible | evaluation.is_pivot)[onward].all() and check.is_blocked_by_dynamic[onward].any())
    is_safe_at_rest = (
        not evaluation.is_give_way_needed and evaluation.coasting_clearance_m >= evaluation.tight_clearance_m
    )
    is_waiting = may_wait and is_held_up and is_safe_at_rest
    if is_waiting:
        is_met = (check.is_intruding & evaluation.is_in_horizon).any(axis=0)
        infeasible = forbidden | ~_is_pivot_to_course(evaluation) | is_met
    elif (
        _stopped_facing_away(evaluation, start, previous)
        and not (excluded := _all_but_safe_pivot(evaluation, forbidden, start, config)).all()
    ):
        infeasible = excluded
    elif infeasible.all():
        infeasible = ~_escapes_static(evaluation) | ~_escapes_dynamic(evaluation, start, config) | forbidden
        if infeasible.all():
            infeasible = ~_clears_more_than_coasting(evaluation, forbidden | evaluation.is_full_speed)
    if infeasible.all():
        return stop
    cost = _total_cost(evaluation, check, start, setpoint, previous, config)
    best = int(np.where(infeasible, np.inf, cost).argmin())
    heading_rad = wrap_rad(start.yaw_rad + float(evaluation.offsets_rad[best]))
    return Plan(heading_rad, float(evaluation.speeds_mps[best]), is_waiting)


def _evaluate_candidates(
    grid: OccupancyGrid,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    obstacles: Sequence[DynamicObstacle],
    config: PlannerConfig,
) -> CandidateEvaluation:
    offsets_rad, speeds_mps = sample_candidates(start, setpoint, config)
    trajectories, field_m = roll_out(start, offsets_rad, speeds_mps, config), clearance_field_m(grid, config)
    static_m = interpolate_field(grid, field_m, trajectories)
    tight_m = config.hull_radius_m + config.tight_margin_m
    is_in_horizon = (trajectories.time_s <= config.horizon_s + 1e-9)[:, None]
    coasting, last = roll_out_coasting(start, trajectories.time_s, config), int(is_in_horizon.sum()) - 1
    at_rest = BoatState(float(coasting.x_m[last, 0]), float(coasting.y_m[last, 0]), start.yaw_rad)
    coasting_m = least_clearance_m(interpolate_field(grid, field_m, coasting), obstacles, coasting)
    return CandidateEvaluation(
        obstacles,
        offsets_rad,
        speeds_mps,
        deviation_rad=_angles_between_rad(offsets_rad, float(offsets_rad[0])),
        is_full_speed=speeds_mps == speeds_mps[0],
        is_pivot=speeds_mps == PIVOT_SPEED_FRACTION * speeds_mps[0],
        trajectories=trajectories,
        is_in_horizon=is_in_horizon,
        is_in_checked_range=is_in_horizon | (trajectories.travelled_m <= config.room_m),
        static_clearance_m=static_m,
        clearance_m=least_clearance_m(static_m, obstacles, trajectories),
        person_distance_m=interpolate_field(grid, distance_field_m(grid.people), trajectories),
        is_unknown=interpolate_field(grid, distance_field_m(grid.unknown), trajectories) < config.hull_radius_m,
        tight_clearance_m=tight_m,
        is_give_way_needed=is_give_way_needed(obstacles, at_rest, tight_m),
        coasting=coasting,
        coasting_clearance_m=float(np.where(is_in_horizon, coasting_m, np.inf).min()),
    )


def _hard_constraints(
    evaluation: CandidateEvaluation, start: BoatState, setpoint: GuidanceSetpoint, config: PlannerConfig
) -> Bools:
    """Candidates that no smaller margin makes feasible [candidates]."""
    offsets_rad, travelled_m = evaluation.offsets_rad, evaluation.trajectories.travelled_m
    stopping_m = config.stop_s * np.maximum(evaluation.speeds_mps, start.surge_mps)
    forbidden: Bools = np.asarray((evaluation.is_unknown & (travelled_m <= stopping_m)).any(axis=0))
    forbidden |= evaluation.is_pivot & (_angles_between_rad(offsets_rad, 0.0) < MIN_PIVOT_RAD)
    if setpoint.is_pivot_only:
        forbidden |= ~evaluation.is_pivot | (setpoint.advised_side * offsets_rad < MIN_PIVOT_RAD)
    # A boat with its whole margin waits before a dead end; it does not circle through the far side.
    if evaluation.static_clearance_m[0, 0] >= config.hull_radius_m + config.margin_m:
        forbidden |= np.abs(offsets_rad - offsets_rad[0]) > math.radians(config.span_deg) + 1e-9
    # A boat that is nearer to a person than it should be comes no nearer, whatever else it escapes from.
    person_m = (
        min(evaluation.tight_clearance_m, float(evaluation.person_distance_m[0, 0])) - PERSON_DISTANCE_TOLERANCE_M
    )
    forbidden |= ((evaluation.person_distance_m < person_m) & evaluation.is_in_checked_range).any(axis=0)
    is_tight = (evaluation.clearance_m < evaluation.tight_clearance_m) & evaluation.is_in_horizon
    return forbidden | (evaluation.is_full_speed & is_tight.any(axis=0))


def _relax_margin(
    evaluation: CandidateEvaluation,
    forbidden: Bools,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    config: PlannerConfig,
) -> MarginCheck:
    """Check the candidates with the largest margin that leaves a feasible one, or else with the smallest.

    The whole margin is kept to dynamic obstacles, unless one would come to a boat at rest: only then is being at rest
    no better than passing it closely. With less than the whole margin no candidate is feasible at full speed, and
    pivots out of the onward sector are feasible with the smallest margin alone.
    """
    dynamic_m = least_separation_margin_m(evaluation.obstacles, evaluation.trajectories, start, config)
    steps = margins(config)
    while True:
        step = steps.pop(0)
        if evaluation.is_give_way_needed and step is not config:
            dynamic_m = least_separation_margin_m(evaluation.obstacles, evaluation.trajectories, start, step)
        static_m = evaluation.static_clearance_m
        required_m = required_clearance_m(evaluation.trajectories.time_s, static_m[0, 0], step)
        margin_m = np.minimum(static_m - required_m[:, None], dynamic_m)
        intruding = margin_m < 0.0
        infeasible = (intruding & evaluation.is_in_checked_range).any(axis=0) | forbidden
        if step is not config:
            infeasible |= evaluation.is_full_speed
        if steps and not setpoint.is_pivot_only:
            infeasible |= evaluation.is_pivot & (evaluation.deviation_rad > ONWARD_SECTOR_RAD)
        if not (infeasible.all() and steps):
            blocked = ((dynamic_m < 0.0) & evaluation.is_in_checked_range).any(axis=0)
            return MarginCheck(infeasible, intruding, margin_m, np.asarray(blocked))


def _is_pivot_to_course(evaluation: CandidateEvaluation) -> Bools:
    """Whether a candidate is the pivot to the desired course [candidates]."""
    return np.asarray(evaluation.is_pivot & (evaluation.offsets_rad == evaluation.offsets_rad[0]))


def _stopped_facing_away(evaluation: CandidateEvaluation, start: BoatState, previous: Plan | None) -> bool:
    """Whether the boat was stopped, or is pivoting to its course since, and does not see in that direction yet."""
    course_rad = float(evaluation.offsets_rad[0])
    if start.surge_mps > RESIDUAL_DRIFT_MPS or abs(course_rad) <= HALF_FIELD_OF_VIEW_RAD:
        return False
    if previous is None or previous.speed_mps == 0.0:
        return True
    off_rad = wrap_rad(previous.heading_rad - start.yaw_rad - course_rad)
    is_pivoting = previous.speed_mps <= PIVOT_SPEED_FRACTION * float(evaluation.speeds_mps[0])
    return is_pivoting and abs(off_rad) < 0.5 * MIN_PIVOT_RAD


def _all_but_safe_pivot(
    evaluation: CandidateEvaluation, forbidden: Bools, start: BoatState, config: PlannerConfig
) -> Bools:
    """All candidates but the pivot to the course, and that too where hull and half a cell are not free [candidates]."""
    step = margins(config)[-1]
    dynamic_step = step if evaluation.is_give_way_needed else config
    dynamic_m = least_separation_margin_m(evaluation.obstacles, evaluation.trajectories, start, dynamic_step)
    margin_m = np.minimum(evaluation.static_clearance_m - (step.hull_radius_m + step.margin_m), dynamic_m)
    is_unsafe = ((margin_m < 0.0) & evaluation.is_in_horizon).any(axis=0)
    return np.asarray(forbidden | ~_is_pivot_to_course(evaluation) | is_unsafe)


def _escapes_static(evaluation: CandidateEvaluation) -> Bools:
    """Candidates that come hardly nearer to static obstacles than the boat is, and end further away [candidates].

    They end after `room_m`, because a candidate that begins with a pivot gets nowhere within the horizon.
    """
    clearance_m, checked = evaluation.static_clearance_m, evaluation.is_in_checked_range
    least_m = np.where(checked, clearance_m, np.inf).min(axis=0)
    last = checked.sum(axis=0) - 1
    now_m, last_m = clearance_m[0, 0], clearance_m[last, np.arange(last.size)]
    return np.asarray((least_m >= now_m - ESCAPE_TOLERANCE_M) & (last_m >= now_m + ESCAPE_GAIN_M))


def _escapes_dynamic(evaluation: CandidateEvaluation, start: BoatState, config: PlannerConfig) -> Bools:
    """Candidates that, of each dynamic obstacle, keep clear or come hardly nearer and end further away [candidates].

    Nearer and further are measured against a coasting boat: an obstacle not seen for long may be anywhere around it,
    and the space it may be in grows with time.
    """
    escapes = np.ones(evaluation.offsets_rad.size, np.bool_)
    within = evaluation.is_in_horizon[:, 0]
    step = margins(config)[-1] if evaluation.is_give_way_needed else config
    for obstacle in evaluation.obstacles:
        margin_m = separation_margin_m(obstacle, evaluation.trajectories, start, step)
        is_clear = ((margin_m >= 0.0) | ~evaluation.is_in_checked_range).all(axis=0)
        sailing_m, coasting_m = (
            predicted_clearance_m(obstacle, each.x_m, each.y_m, each.time_s[:, None])[within]
            for each in (evaluation.trajectories, evaluation.coasting)
        )
        is_left = (sailing_m >= coasting_m - ESCAPE_TOLERANCE_M).all(axis=0)
        escapes &= is_clear | (is_left & (sailing_m[-1] >= coasting_m[-1] + ESCAPE_GAIN_M))
    return escapes


def _clears_more_than_coasting(evaluation: CandidateEvaluation, forbidden: Bools) -> Bools:
    """Candidates whose least clearance within the horizon exceeds that of coasting and is nearly the best of all."""
    clearance_m = np.where(evaluation.is_in_horizon, evaluation.clearance_m, np.inf)
    least_m = np.where(forbidden, -np.inf, clearance_m.min(axis=0))
    enough_m = max(evaluation.coasting_clearance_m + ESCAPE_GAIN_M, float(least_m.max()) - 0.5 * ESCAPE_GAIN_M)
    return np.asarray(least_m >= enough_m)


def _total_cost(
    evaluation: CandidateEvaluation,
    check: MarginCheck,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    previous: Plan | None,
    config: PlannerConfig,
) -> F64:
    """The cost of each candidate [candidates]."""
    speeds_mps, deviation_rad = evaluation.speeds_mps, evaluation.deviation_rad
    made_good = speeds_mps / speeds_mps[0] * np.array([portable.cos(each) for each in deviation_rad.tolist()])
    cost = deviation_rad / QUARTER_TURN_RAD + LOST_PROGRESS_WEIGHT * (1.0 - made_good)
    if previous is not None and previous.speed_mps > 0.0:
        change_rad = _angles_between_rad(evaluation.offsets_rad, wrap_rad(previous.heading_rad - start.yaw_rad))
        cost = cost + HEADING_CHANGE_WEIGHT * change_rad / QUARTER_TURN_RAD
    cost = cost + _advice_cost(evaluation.offsets_rad, setpoint.advised_side)
    cost = cost + _obstacle_cost(evaluation, check, start, config)
    margin_m = config.hull_radius_m + config.margin_m - evaluation.clearance_m
    intrusion_m = np.where(evaluation.is_in_horizon, np.maximum(margin_m, 0.0), 0.0)
    intrusion = MARGIN_INTRUSION_WEIGHT * np.add.accumulate(intrusion_m)[-1] / float(evaluation.is_in_horizon.sum())
    return np.asarray(cost + intrusion)


def _obstacle_cost(evaluation: CandidateEvaluation, check: MarginCheck, start: BoatState, config: PlannerConfig) -> F64:
    """The cost of unknown water, of nearness to obstacles, and of obstacles further along the path [candidates]."""
    trajectories = evaluation.trajectories
    is_looked_at = trajectories.travelled_m <= config.look_m
    cost = UNKNOWN_WATER_WEIGHT * (evaluation.is_unknown & is_looked_at).sum(axis=0) / len(is_looked_at)
    leading = [advanced_in_time(obstacle, config.lead_s) for obstacle in evaluation.obstacles]
    ahead_m = least_separation_margin_m(leading, trajectories, start, config)
    margin_m = np.where(evaluation.is_in_horizon, np.minimum(check.margin_m, ahead_m), np.inf).min(axis=0)
    nearness = np.clip(1.0 - margin_m / PROXIMITY_RANGE_M, 0.0, 1.0)
    cost = cost + PROXIMITY_WEIGHT * nearness * nearness
    if config.look_m > 0.0:
        first_m = np.where(check.is_intruding & is_looked_at, trajectories.travelled_m, np.inf).min(axis=0)
        cost = cost + PATH_OBSTACLE_WEIGHT * np.clip(1.0 - first_m / config.look_m, 0.0, 1.0)
    return np.asarray(cost)


def _advice_cost(offsets_rad: F64, advised_side: float) -> F64:
    disregard = np.minimum(np.maximum(1.0 - advised_side * offsets_rad / ADVISED_TURN_RAD, 0.0), 1.0)
    return np.asarray(ADVICE_WEIGHT * abs(advised_side) * disregard)


def _angles_between_rad(angles_rad: F64, other_rad: float) -> F64:
    """The angle between each and the other, both wrapped: [0, pi]."""
    off = np.abs(angles_rad - other_rad)
    return np.asarray(np.minimum(off, 2.0 * math.pi - off))
