"""Why the local planner took or refused each heading, for people. Pure; it decides nothing."""

from collections.abc import Sequence

import msgspec
import numpy as np

from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani.messages import Constraint, HeadingCosts, HeadingVerdict
from paani_services.navigator.avoidance.constraints import any_refusal
from paani_services.navigator.avoidance.planner import JudgedCandidates, judge_candidates
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid

COST_DIGITS = 3  # of a cost that is told: a thousandth of a quarter turn


def explain_motion(
    grid: OccupancyGrid,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    previous: Plan | None,
    config: PlannerConfig,
    tracked: Sequence[DynamicObstacle] = (),
    *,
    may_wait: bool = True,
) -> tuple[Plan, tuple[HeadingVerdict, ...]]:
    """The plan that `plan_motion` makes of the same, and its verdict on each heading, the desired course first."""
    judged = judge_candidates(grid, start, setpoint, previous, config, tracked, may_wait=may_wait)
    if judged is None:
        return Plan(start.yaw_rad, 0.0), ()
    return judged.cheapest_plan(start), _tell_headings(judged, start)


def _tell_headings(judged: JudgedCandidates, start: BoatState) -> tuple[HeadingVerdict, ...]:
    """Of each heading, what refuses it at each speed, and the costs of the cheapest speed that nothing refuses."""
    evaluation, refusals, costs, _ = judged
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
