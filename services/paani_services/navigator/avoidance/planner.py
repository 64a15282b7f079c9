"""The local planner: the best of sampled headings and speeds that meets no obstacle (Q4-Q6). Pure.

In the manner of the dynamic window approach (Fox, Burgard, Thrun: "The dynamic window approach to collision avoidance",
IEEE Robotics & Automation Magazine, 1997): candidates are rolled out, checked against constraints, and weighed by cost.
Constraints and costs keep their names.
"""

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np

from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani.messages import Constraint, HeadingCosts, HeadingVerdict
from paani_services.navigator.avoidance.constraints import (
    MarginCheck,
    Refusals,
    any_refusal,
    before_looking,
    check_margins,
    hard_constraints,
    has_stopped_facing_away,
    unless_clearer_than_coasting,
    unless_escaping,
    while_waiting,
)
from paani_services.navigator.avoidance.costs import CandidateCosts, weigh_candidates
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, evaluate_candidates
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid

COST_DIGITS = 3  # of a cost that is told: a thousandth of a quarter turn


def plan_motion(
    grid: OccupancyGrid,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    previous: Plan | None,
    config: PlannerConfig,
    tracked: Sequence[DynamicObstacle] = (),
    *,
    may_wait: bool = True,
) -> tuple[Plan, tuple[HeadingVerdict, ...]]:
    """Choose the cheapest feasible candidate; with it, why each heading was taken or refused, the desired course first.

    Candidates are headings around the desired course at three speeds, each rolled out through the boat's turn-rate and
    acceleration limits. A candidate is feasible if no constraint refuses it: `hard_constraints`, and those of the first
    of these situations that leaves a candidate:
      * Dynamic obstacles alone leave no candidate onward, and the boat `may_wait` and is safe at rest: it waits until
        they have passed, and pivots to its course meanwhile where that brings it no nearer.
      * A boat that stopped facing away from its course pivots to it before it moves, because it has not seen what came
        up on that side.
      * The swept hull keeps a margin to static obstacles within `horizon_s` or `room_m` (Q4, Q6), the largest one that
        leaves a candidate, and the whole one to the predicted positions of dynamic ones.
      * It escapes from the nearest obstacle.
      * It keeps further off than coasting would.
    If there is none, the plan is a stop. Once the boat may wait no longer, people who may swim but were not seen to are
    static obstacles.
    """
    stop = Plan(start.yaw_rad, 0.0)
    if setpoint.speed_mps <= 0.0 or not grid.free.any():
        return stop, ()
    obstacles = [each for each in tracked if each.age_s <= config.unseen_s and (may_wait or each.is_moving)]
    evaluation = evaluate_candidates(grid, start, setpoint, obstacles, config)
    hard = hard_constraints(evaluation, start, setpoint, config)
    check = check_margins(evaluation, hard, start, setpoint, config)
    costs = weigh_candidates(evaluation, check.margin_m, start, setpoint, previous, config)
    is_waiting = may_wait and evaluation.is_safe_at_rest and _is_held_up(evaluation, check)
    if is_waiting:
        refusals = while_waiting(evaluation, hard, check)
    else:
        situations = _situations(evaluation, hard, check, start, previous, config)
        refusals = next((each for each in situations if not any_refusal(each).all()), check.refusals)
    verdicts = _tell_headings(evaluation, refusals, costs, start)
    if any_refusal(refusals).all():
        return stop, verdicts
    best = int(np.where(any_refusal(refusals), np.inf, costs.total).argmin())
    heading_rad = wrap_rad(start.yaw_rad + float(evaluation.offsets_rad[best]))
    return Plan(heading_rad, float(evaluation.speeds_mps[best]), is_waiting), verdicts


def _is_held_up(evaluation: CandidateEvaluation, check: MarginCheck) -> bool:
    """Whether no candidate but a pivot leads onward, and dynamic obstacles refuse one that would."""
    onward = evaluation.is_onward
    is_refused = (any_refusal(check.refusals) | evaluation.is_pivot)[onward].all()
    return bool(is_refused and check.refusals[Constraint.DYNAMIC_OBSTACLE][onward].any())


def _situations(
    evaluation: CandidateEvaluation,
    hard: Refusals,
    check: MarginCheck,
    start: BoatState,
    previous: Plan | None,
    config: PlannerConfig,
) -> Iterator[Refusals]:
    """What is refused in each situation of a boat that does not wait, the first that applies first."""
    if has_stopped_facing_away(evaluation, start, previous):
        yield before_looking(evaluation, hard, start, config)
    yield check.refusals
    yield unless_escaping(evaluation, hard, start, config)
    yield unless_clearer_than_coasting(evaluation, hard)


def _tell_headings(
    evaluation: CandidateEvaluation, refusals: Refusals, costs: CandidateCosts, start: BoatState
) -> tuple[HeadingVerdict, ...]:
    """Of each heading, what refuses it at each speed, and the costs of the cheapest speed that nothing refuses."""
    names = [each for each in Constraint if each in refusals]
    masks = np.stack([refusals[each] for each in names])
    is_refused, first = any_refusal(refusals), masks.argmax(axis=0)
    total = np.where(is_refused, np.inf, costs.total)
    count = int((evaluation.offsets_rad == evaluation.offsets_rad[0]).sum())
    verdicts = []
    for at in range(0, total.size, count):
        speeds = range(at, at + count)
        cheapest = min(speeds, key=lambda each: float(total[each]))
        is_free = bool(total[cheapest] < np.inf)
        parts = (round(float(each[cheapest]), COST_DIGITS) for each in costs)
        verdicts.append(
            HeadingVerdict(
                heading_rad=wrap_rad(start.yaw_rad + float(evaluation.offsets_rad[at])),
                refused_by=tuple(names[first[each]] if is_refused[each] else Constraint.NONE for each in speeds),
                speed_mps=float(evaluation.speeds_mps[cheapest]) if is_free else 0.0,
                costs=HeadingCosts(*parts) if is_free else msgspec.UNSET,
            )
        )
    return tuple(verdicts)
