"""Figures of the Imazu cases by policy, form and how many of their vessels the lens can see. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum

import msgspec

from paani.messages import EncounterClass
from paani_sim.trials.intervals import Share, share_with_interval
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import NEAR_MISS_CLEARANCE_M, TrialResult
from paani_sim.trials.rule_encounters import mean_own_score
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.imazu import IMAZU_SCENARIOS, case_codes, count_seen, is_fair


class SightGroup(StrEnum):
    """Which of a case's vessels are within the lens at the start; by bearing, they stay so unless the boat turns.

    ALL_ROUND: none of them, so that the case needs all-round vision.
    """

    ALL_SEEN = "all seen"
    PARTLY = "partly seen"
    ALL_ROUND = "needs all-round vision"


class ClassScore(msgspec.Struct, frozen=True, kw_only=True):
    """Mean score of so many encounters by their class's own rule."""

    encounters: int
    mean: float


class ImazuFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Of the drives of one group. `untouched_share`: without contact. `time_lost_s`: mean of the completed ones.

    `domain_entered`: drives in which some vessel came into the boat's ship domain.
    """

    drives: int
    completed: int
    untouched_share: Share
    contacts: int
    near: int
    domain_entered: int
    time_lost_s: float | None
    scores: dict[str, ClassScore]


ImazuSummary = dict[str, dict[str, dict[str, ImazuFigures]]]


def sight_group(scenario: str, hfov_deg: float) -> SightGroup:
    """The group of a case for a lens."""
    seen, whole = count_seen(scenario, hfov_deg), len(case_codes(scenario))
    if seen == whole:
        return SightGroup.ALL_SEEN
    return SightGroup.PARTLY if seen else SightGroup.ALL_ROUND


def summarise_imazu(results: Mapping[TrialCase, TrialResult]) -> ImazuSummary:
    """By policy, form ("plain", "camera-fair") and group; empty without such drives."""
    grouped: dict[tuple[Policy, str, SightGroup], list[TrialResult]] = {}
    for case, result in sorted(results.items()):
        if case.world in IMAZU_SCENARIOS and not case.fault:
            form = "camera-fair" if is_fair(case.world) else "plain"
            group = sight_group(case.world, result.hfov_deg)
            grouped.setdefault((case.policy, form, group), []).append(result)
    found: ImazuSummary = {}
    for policy in Policy:
        for form in ("plain", "camera-fair"):
            for group in SightGroup:
                if chosen := grouped.get((policy, form, group)):
                    forms = found.setdefault(policy.value, {})
                    forms.setdefault(form, {})[group.value] = _summarise_group(chosen)
    return found


def format_imazu(summary: ImazuSummary) -> list[str]:
    """A line for each policy, form and group."""
    if not summary:
        return []
    lines = [
        "",
        f"{'policy':12} {'imazu':11} {'group':22} {'drives':>6} {'done':>4} {'no contact [95 %]':>22} {'near':>4}"
        f" {'domain':>6} {'lost [s]':>8}  scores by class (encounters)",
    ]
    for policy, forms in summary.items():
        for form, groups in forms.items():
            for group, f in groups.items():
                share = f.untouched_share
                interval = f"{100 * share.share:5.1f} % [{100 * share.low:4.1f}, {100 * share.high:5.1f}]"
                lost = "-" if f.time_lost_s is None else f"{f.time_lost_s:.1f}"
                scores = ", ".join(f"{kind} {score.mean:.2f} ({score.encounters})" for kind, score in f.scores.items())
                lines.append(
                    f"{policy:12} {form:11} {group:22} {f.drives:6} {f.completed:4} {interval:>22} {f.near:4}"
                    f" {f.domain_entered:6} {lost:>8}  {scores}"
                )
    return lines


def _summarise_group(results: Sequence[TrialResult]) -> ImazuFigures:
    lost_s = [r.seconds - r.goal_m / NOMINAL_BOAT_MPS for r in results if r.completed]
    encounters = [each for r in results for each in r.rule_encounters]
    scores = {}
    for kind in EncounterClass:
        mean = mean_own_score(encounters, kind)
        if mean is not None:
            count = sum(each.encounter_class is kind for each in encounters)
            scores[kind.value] = ClassScore(encounters=count, mean=round(mean, 4))
    return ImazuFigures(
        drives=len(results),
        completed=sum(r.completed for r in results),
        untouched_share=share_with_interval(sum(r.collisions == 0 for r in results), len(results)),
        contacts=sum(r.collisions for r in results),
        near=sum(any(0.0 < e.clearance_m < NEAR_MISS_CLEARANCE_M for e in r.rule_encounters) for r in results),
        domain_entered=sum(any(e.is_domain_entered for e in r.rule_encounters) for r in results),
        time_lost_s=round(sum(lost_s) / len(lost_s), 2) if lost_s else None,
        scores=scores,
    )
