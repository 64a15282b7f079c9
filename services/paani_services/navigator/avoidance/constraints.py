"""The named constraints of the local planner: why a candidate is refused. Pure.

Each gives a mask of the candidates that it refuses [candidates]. Those of `hard_constraints` always hold; what
distance is kept beyond them depends on the situation, and the masks of one situation are all that decides.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from paani.arrays import F64, Bools
from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani.messages import Constraint
from paani_services.navigator.avoidance.clearance import (
    ESCAPE_GAIN_M,
    least_of_obstacles_m,
    margins,
    required_clearance_m,
)
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, angles_between_rad
from paani_services.navigator.avoidance.rollout import (
    PIVOT_SPEED_FRACTION,
    RESIDUAL_DRIFT_MPS,
)

ESCAPE_TOLERANCE_M = 0.2  # clearance that a way out may lose before it gains [m]: the advance of a boat while it turns
PERSON_DISTANCE_TOLERANCE_M = 0.05  # error of an interpolated distance to a person [m]: a quarter of a cell
MIN_PIVOT_RAD = math.radians(20.0)  # smaller pivots are not made: the boat would creep where it may wait
HALF_FIELD_OF_VIEW_RAD = math.radians(35.0)  # of the shipped lens; before what a narrower one misses, UNKNOWN_WATER

Refusals = Mapping[Constraint, Bools]


class MarginCheck(NamedTuple):
    """What one margin refuses, and the clearance beyond the required one [times, candidates]."""

    refusals: Refusals
    margin_m: F64


def any_refusal(refusals: Refusals) -> Bools:
    """Whether anything refuses a candidate [candidates]."""
    return np.asarray(np.logical_or.reduce(list(refusals.values())))


def hard_constraints(evaluation: CandidateEvaluation) -> Refusals:
    """Refusals that no smaller margin lifts.

    UNKNOWN_WATER: the boat could not stop before water that it does not know. PERSON: nearer to a person than hull and
    `tight_margin_m`, or than the boat is, whatever else it escapes from. TOO_FAST: at full speed that near to anything.
    TURN: a pivot too small to be made, or not the one asked for; or, for a boat with its whole margin that nothing
    runs down, beyond `span_deg`: it waits before a dead end and does not circle through the far side.
    """
    setpoint, config = evaluation.request.setpoint, evaluation.request.config
    offsets_rad, travelled_m = evaluation.offsets_rad, evaluation.trajectories.travelled_m
    stopping_m = config.stop_s * np.maximum(evaluation.speeds_mps, evaluation.request.start.surge_mps)
    person_m = (
        min(evaluation.tight_clearance_m, float(evaluation.person_distance_m[0, 0])) - PERSON_DISTANCE_TOLERANCE_M
    )
    is_tight = (evaluation.clearance_m < evaluation.tight_clearance_m) & evaluation.is_in_horizon
    turn = evaluation.is_pivot & (angles_between_rad(offsets_rad, 0.0) < MIN_PIVOT_RAD)
    if setpoint.is_pivot_only:
        turn |= ~evaluation.is_pivot | (setpoint.advised_side * offsets_rad < MIN_PIVOT_RAD)
    has_margin = evaluation.static_clearance_m[0, 0] >= config.hull_radius_m + config.margin_m
    if has_margin and not evaluation.runs_down.any():
        turn |= np.abs(offsets_rad - offsets_rad[0]) > math.radians(config.span_deg) + 1e-9
    near_person = (evaluation.person_distance_m < person_m) & evaluation.is_in_checked_range
    return {
        Constraint.UNKNOWN_WATER: np.asarray((evaluation.is_unknown & (travelled_m <= stopping_m)).any(axis=0)),
        Constraint.PERSON: np.asarray(near_person.any(axis=0)),
        Constraint.TOO_FAST: evaluation.is_full_speed & is_tight.any(axis=0),
        Constraint.TURN: turn,
    }


def check_margins(evaluation: CandidateEvaluation, hard: Refusals) -> MarginCheck:
    """Check the candidates with the largest margin that leaves a feasible one, or else with the smallest.

    With less than the whole margin no candidate is feasible at full speed, and pivots out of the onward sector are
    feasible with the smallest margin alone.
    """
    *larger, least = margins(evaluation.request.config)
    for step in larger:
        check = _check_margin(evaluation, hard, step, may_pivot_away=evaluation.request.setpoint.is_pivot_only)
        if not any_refusal(check.refusals).all():
            return check
    return _check_margin(evaluation, hard, least, may_pivot_away=True)


def _check_margin(
    evaluation: CandidateEvaluation, hard: Refusals, step: PlannerConfig, *, may_pivot_away: bool
) -> MarginCheck:
    """Check the candidates with the margin and drift of one of the `margins` of the settings."""
    dynamic_m, static_m = least_of_obstacles_m(evaluation.separation_m(step)), evaluation.static_clearance_m
    beyond_m = static_m - required_clearance_m(evaluation.trajectories.time_s, static_m[0, 0], step)[:, None]
    static, dynamic = (
        np.asarray(((each_m < 0.0) & evaluation.is_in_checked_range).any(axis=0)) for each_m in (beyond_m, dynamic_m)
    )
    is_too_fast = evaluation.is_full_speed & (step is not evaluation.request.config)
    is_pivot_away = evaluation.is_pivot & ~evaluation.is_onward & (not may_pivot_away)
    refusals = {
        **hard,
        Constraint.STATIC_OBSTACLE: static,
        Constraint.DYNAMIC_OBSTACLE: dynamic,
        Constraint.TOO_FAST: hard[Constraint.TOO_FAST] | is_too_fast,
        Constraint.TURN: hard[Constraint.TURN] | is_pivot_away,
    }
    return MarginCheck(refusals, np.minimum(beyond_m, dynamic_m))


def while_waiting(evaluation: CandidateEvaluation, hard: Refusals, check: MarginCheck) -> Refusals:
    """WAIT: of a boat that waits until something has passed, all but the pivot to its course that keeps clear."""
    is_met = ((check.margin_m < 0.0) & evaluation.is_in_horizon).any(axis=0)
    return {**hard, Constraint.WAIT: ~evaluation.is_pivot_to_course | is_met}


def before_looking(evaluation: CandidateEvaluation, hard: Refusals) -> Refusals:
    """LOOK: of a boat that faces away, all but the pivot to its course with room for hull and half a cell."""
    step = margins(evaluation.request.config)[-1]
    static_m = evaluation.static_clearance_m - (step.hull_radius_m + step.margin_m)
    margin_m = np.minimum(static_m, least_of_obstacles_m(evaluation.separation_m(step)))
    is_unsafe = ((margin_m < 0.0) & evaluation.is_in_horizon).any(axis=0)
    return {**hard, Constraint.LOOK: ~evaluation.is_pivot_to_course | is_unsafe}


def has_stopped_facing_away(evaluation: CandidateEvaluation) -> bool:
    """Whether the boat was stopped, or is pivoting to its course since, and does not see in that direction yet."""
    start, previous = evaluation.request.start, evaluation.request.previous
    course_rad = float(evaluation.offsets_rad[0])
    if start.surge_mps > RESIDUAL_DRIFT_MPS or abs(course_rad) <= HALF_FIELD_OF_VIEW_RAD:
        return False
    if previous is None or previous.speed_mps == 0.0:
        return True
    off_rad = wrap_rad(previous.heading_rad - start.yaw_rad - course_rad)
    is_pivoting = previous.speed_mps <= PIVOT_SPEED_FRACTION * float(evaluation.speeds_mps[0])
    return is_pivoting and abs(off_rad) < 0.5 * MIN_PIVOT_RAD


def unless_escaping(evaluation: CandidateEvaluation, hard: Refusals) -> Refusals:
    """NO_ESCAPE: of a boat with no margin left, all that leads not away from static and dynamic obstacles."""
    escapes = _escapes_static(evaluation) & _escapes_dynamic(evaluation)
    return {**hard, Constraint.NO_ESCAPE: ~escapes}


def unless_clearer_than_coasting(evaluation: CandidateEvaluation, hard: Refusals) -> Refusals:
    """NO_ESCAPE: all whose least clearance is not above that of coasting and nearly the best of all; none too fast.

    A boat with its thrusters off is carried on by its own way, wind and current. What may be somewhere is not fled from
    into what is there: of static obstacles a way out keeps hull and least margin clear, or as much as the boat does
    now, or nearly the most that any candidate or coasting does, where all bring it nearer.
    """
    least = margins(evaluation.request.config)[-1]
    hard = {**hard, Constraint.TOO_FAST: hard[Constraint.TOO_FAST] | evaluation.is_full_speed}
    static_m = np.where(evaluation.is_in_horizon, evaluation.static_clearance_m, np.inf).min(axis=0)
    most_m = float(static_m[~any_refusal(hard)].max(initial=evaluation.coasting_static_m))
    kept_m = min(float(evaluation.static_clearance_m[0, 0]), most_m) - 0.5 * ESCAPE_GAIN_M
    into_static = static_m < min(kept_m, least.hull_radius_m + least.margin_m)
    clearance_m = np.where(evaluation.is_in_horizon, evaluation.clearance_m, np.inf)
    least_m = np.where(any_refusal(hard) | into_static, -np.inf, clearance_m.min(axis=0))
    enough_m = max(evaluation.coasting_clearance_m + ESCAPE_GAIN_M, float(least_m.max()) - 0.5 * ESCAPE_GAIN_M)
    return {**hard, Constraint.NO_ESCAPE: least_m < enough_m}


def _escapes_static(evaluation: CandidateEvaluation) -> Bools:
    """Candidates that come hardly nearer to static obstacles than the boat is, and end further away [candidates].

    They end after `room_m`, because a candidate that begins with a pivot gets nowhere within the horizon.
    """
    clearance_m, checked = evaluation.static_clearance_m, evaluation.is_in_checked_range
    least_m = np.where(checked, clearance_m, np.inf).min(axis=0)
    last = checked.sum(axis=0) - 1
    now_m, last_m = clearance_m[0, 0], clearance_m[last, np.arange(last.size)]
    return np.asarray((least_m >= now_m - ESCAPE_TOLERANCE_M) & (last_m >= now_m + ESCAPE_GAIN_M))


def _escapes_dynamic(evaluation: CandidateEvaluation) -> Bools:
    """Candidates that, of each dynamic obstacle, keep clear or come hardly nearer and end further away [candidates].

    Nearer and further are measured against a coasting boat: an obstacle not seen for long may be anywhere around it,
    and the space it may be in grows with time.
    """
    separation_m = evaluation.separation_m(margins(evaluation.request.config)[-1])
    is_clear = ((separation_m >= 0.0) | ~evaluation.is_in_checked_range).all(axis=1)
    within = evaluation.is_in_horizon[:, 0]
    sailing_m, coasting_m = evaluation.dynamic.candidates_m[:, within], evaluation.dynamic.coasting_m[:, within, None]
    is_left = (sailing_m >= coasting_m - ESCAPE_TOLERANCE_M).all(axis=1)
    is_left &= sailing_m[:, -1] >= coasting_m[:, -1] + ESCAPE_GAIN_M
    return np.asarray((is_clear | is_left).all(axis=0))
