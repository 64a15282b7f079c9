"""Why the local planner took or refused each heading, for people. Pure; it decides nothing."""

import msgspec
import numpy as np

from paani.geometry import wrap_rad
from paani.messages import Constraint, HeadingCosts, HeadingVerdict
from paani_services.navigator.avoidance.constraints import any_refusal
from paani_services.navigator.avoidance.planner import JudgedCandidates

COST_DIGITS = 3  # of a cost that is told: a thousandth of a quarter turn


def tell_headings(judged: JudgedCandidates) -> tuple[HeadingVerdict, ...]:
    """Of each heading, what refuses it at each speed, and the costs of the cheapest speed that nothing refuses.

    The desired course comes first.
    """
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
                heading_rad=wrap_rad(evaluation.request.start.yaw_rad + float(evaluation.offsets_rad[at])),
                refused_by=tuple(names[first[each]] if is_refused[each] else Constraint.NONE for each in speeds),
                speed_mps=float(evaluation.speeds_mps[cheapest]) if is_free else 0.0,
                costs=HeadingCosts(*parts) if is_free else msgspec.UNSET,
            )
        )
    return tuple(verdicts)
