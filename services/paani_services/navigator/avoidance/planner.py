"""The local planner: the best of sampled headings and speeds that meets no obstacle (Q4-Q6). Pure.

In the manner of the dynamic window approach (Fox, Burgard, Thrun: "The dynamic window approach to collision avoidance",
IEEE Robotics & Automation Magazine, 1997): candidates are rolled out, checked against constraints, and weighed by cost.
Constraints and costs keep their names.
"""

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np

from paani.geometry import wrap_rad
from paani.messages import Constraint
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
from paani_services.navigator.avoidance.costs import CandidateCosts, add_courtesy, weigh_candidates
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, evaluate_candidates
from paani_services.navigator.avoidance.passages import find_passages
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import Plan


class JudgedCandidates(NamedTuple):
    """The candidates with what refuses each in the situation that decides, and what each costs."""

    evaluation: CandidateEvaluation
    refusals: Refusals
    costs: CandidateCosts
    is_waiting: bool

    def cheapest_plan(self) -> Plan:
        """The plan of the cheapest feasible candidate; a stop if there is none."""
        yaw_rad, is_refused = self.evaluation.request.start.yaw_rad, any_refusal(self.refusals)
        if is_refused.all():
            return Plan(yaw_rad, 0.0)
        best = int(np.where(is_refused, np.inf, self.costs.total).argmin())
        heading_rad = wrap_rad(yaw_rad + float(self.evaluation.offsets_rad[best]))
        return Plan(heading_rad, float(self.evaluation.speeds_mps[best]), self.is_waiting)


def plan_motion(request: PlanRequest) -> Plan:
    """Choose the cheapest feasible candidate.

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
    If there is none, the plan is a stop.
    """
    judged = judge_candidates(request)
    return Plan(request.start.yaw_rad, 0.0) if judged is None else judged.cheapest_plan()


def judge_candidates(request: PlanRequest) -> JudgedCandidates | None:
    """Check and weigh the candidates that `plan_motion` chooses from; None where none is considered."""
    setpoint, config = request.setpoint, request.config
    if setpoint.speed_mps <= 0.0 or not request.grid.free.any():
        return None
    evaluation = evaluate_candidates(request)
    if setpoint.escape_mps <= setpoint.speed_mps:
        return _judge(evaluation)
    if not evaluation.runs_down.any():
        judged = _judge(evaluation)
        # What comes to a boat that has no way out of it as fast as was asked for is left faster too.
        if not (evaluation.is_give_way_needed and any_refusal(judged.refusals).all()):
            return judged
    escape = setpoint._replace(speed_mps=setpoint.escape_mps)
    config = msgspec.structs.replace(config, speed_mps=max(config.speed_mps, setpoint.escape_mps))
    return _judge(evaluate_candidates(msgspec.structs.replace(request, setpoint=escape, config=config)))


def _judge(evaluation: CandidateEvaluation) -> JudgedCandidates:
    """Check and weigh the candidates."""
    hard = hard_constraints(evaluation)
    check = check_margins(evaluation, hard)
    passages = find_passages(evaluation)
    costs = weigh_candidates(evaluation, check.margin_m, passages)
    is_waiting = evaluation.request.may_wait and evaluation.is_safe_at_rest and _is_held_up(evaluation, check)
    if is_waiting:
        refusals = while_waiting(evaluation, hard, check)
    else:
        situations = _situations(evaluation, hard, check)
        refusals = next((each for each in situations if not any_refusal(each).all()), check.refusals)
    costs = add_courtesy(costs, passages, any_refusal(refusals))
    return JudgedCandidates(evaluation, refusals, costs, is_waiting)


def _is_held_up(evaluation: CandidateEvaluation, check: MarginCheck) -> bool:
    """Whether no candidate but a pivot leads onward, and dynamic obstacles refuse one that would."""
    onward = evaluation.is_onward
    is_refused = (any_refusal(check.refusals) | evaluation.is_pivot)[onward].all()
    return bool(is_refused and check.refusals[Constraint.DYNAMIC_OBSTACLE][onward].any())


def _situations(evaluation: CandidateEvaluation, hard: Refusals, check: MarginCheck) -> Iterator[Refusals]:
    """What is refused in each situation of a boat that does not wait, the first that applies first."""
    if has_stopped_facing_away(evaluation):
        yield before_looking(evaluation, hard)
    yield check.refusals
    yield unless_escaping(evaluation, hard)
    yield unless_clearer_than_coasting(evaluation, hard)
