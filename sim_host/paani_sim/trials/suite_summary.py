"""Figures of many drives by policy, world and fault, with intervals. Pure."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from paani.statistics.order_statistics import nearest_rank
from paani_sim.trials.imazu_summary import ImazuSummary, summarise_imazu
from paani_sim.trials.intervals import Share, poisson_interval, share_with_interval
from paani_sim.trials.ledger import LedgerCounts
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import PERSON_CLEARANCE_M, Closeness, TrialResult, is_near_miss
from paani_sim.trials.seed_parts import SeedPart, part_of_parts
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.worlds import Kind


class StopFigures(msgspec.Struct, frozen=True, kw_only=True):
    count: int
    seconds: float


class PolicyFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Sums over all drives without a fault. `near_misses` are of things; those of banks are counted apart.

    `close_per_km`: near misses and contacts, as a boat held by what it hit comes near to nothing after it.
    `seen_untouched_share`: drives without a contact with what was visible. `touched_encounter_share` and
    `near_encounter_share`: of the encounters with things, those with a contact and those with a near miss.
    `person_clear_share`: of the encounters with people, those at `PERSON_CLEARANCE_M` or more. Shares have Wilson
    intervals, rates per km those of a Poisson count.
    """

    part: SeedPart
    seeds: int
    profile: str
    trials: int
    completed: int
    completed_share: Share
    untouched: int
    untouched_share: Share
    seen_untouched_share: Share
    encountered: int
    touched_encounter_share: Share
    near_encounter_share: Share
    encountered_people: int
    person_clear_share: Share
    collisions: int
    collisions_visible: int
    collisions_bank: int
    contacts_per_km: float
    contacts_per_km_interval: tuple[float, float]
    near_misses: int
    near_misses_bank: int
    near_misses_per_km: float
    near_misses_per_km_interval: tuple[float, float]
    close_per_km: float
    distance_m: float
    progress_m: float
    seconds: float
    mean_speed_mps: float
    energy_j: float
    min_clearance_m: float
    off_route_rms_m: float
    off_route_max_m: float
    encounters: dict[str, int]
    ended: dict[str, int]
    stops: dict[str, StopFigures]
    changes_per_min: float
    side_flips_per_min: float
    stop_go_flips_per_min: float
    latency_p50_s: float | None
    latency_max_s: float | None
    unusable_frac: float


class FaultFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Drives with one kind of fault; `in_time` of those `judged`: see `Reaction`."""

    trials: int
    completed: int
    collisions: int
    collisions_visible: int
    judged: int
    in_time: int
    worst_zero_thrust_s: float | None
    worst_rest_s: float | None


class SeedsDriven(msgspec.Struct, frozen=True, kw_only=True):
    """Of which part the seeds are, how many different ones, and how many drives were asked for and gave a result.

    `commit` and `ledger`: of seeds that are entered into a ledger.
    """

    part: SeedPart
    seeds: int
    drives: int
    asked: int
    commit: str = ""
    ledger: LedgerCounts | None = None


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes."""

    suite: str
    seeds: SeedsDriven
    policies: dict[str, PolicyFigures]
    worlds: dict[str, dict[str, PolicyFigures]]
    faults: dict[str, FaultFigures]
    imazu: ImazuSummary = {}


def summarise_suite(
    suite: str,
    results: Mapping[TrialCase, TrialResult],
    asked: int | None = None,
    commit: str = "",
    ledger: LedgerCounts | None = None,
) -> Summary:
    """Summarise drives by policy, by policy and world, and by fault. asked: drives, where some gave no result."""
    plain = {case: result for case, result in sorted(results.items()) if not case.fault}
    policies = [policy for policy in Policy if any(case.policy is policy for case in plain)]
    worlds = sorted({case.world for case in plain})
    kinds = sorted({case.fault for case in results if case.fault})
    return Summary(
        suite=suite,
        seeds=SeedsDriven(
            part=part_of_parts({r.part for r in results.values()}),
            seeds=len({case.seed for case in results}),
            drives=len(results),
            asked=len(results) if asked is None else asked,
            commit=commit,
            ledger=ledger,
        ),
        policies={p.value: summarise_drives([r for c, r in plain.items() if c.policy is p]) for p in policies},
        worlds={
            p.value: {
                world: summarise_drives(chosen)
                for world in worlds
                if (chosen := [r for c, r in plain.items() if c.policy is p and c.world == world])
            }
            for p in policies
        },
        faults={
            kind: summarise_fault_drives([r for c, r in sorted(results.items()) if c.fault == kind]) for kind in kinds
        },
        imazu=summarise_imazu(results),
    )


def summarise_drives(results: Sequence[TrialResult]) -> PolicyFigures:
    """Figures of one or more drives."""
    count, seconds = len(results), sum(r.seconds for r in results)
    distance_m, minutes = sum(r.distance_m for r in results), sum(r.dithering.seconds for r in results) / 60.0
    collisions, near = sum(r.collisions for r in results), sum(r.near_misses for r in results)
    completed, untouched = sum(r.completed for r in results), sum(r.collisions == 0 for r in results)
    km = max(distance_m * 1e-3, 1e-9)
    stops: dict[str, StopFigures] = {}
    for stop in (stop for r in results for stop in r.stops):
        old = stops.get(stop.reason, StopFigures(count=0, seconds=0.0))
        stops[stop.reason] = StopFigures(count=old.count + stop.count, seconds=round(old.seconds + stop.seconds, 2))
    latencies = [r.latency for r in results if r.latency.samples]
    met = [e for r in results for e in r.encounters if e.what != "bank"]
    closeness = collections.Counter(e.closeness.value for e in met)
    people = [e for e in met if e.kind == Kind.PERSON.value]
    return PolicyFigures(
        part=part_of_parts({r.part for r in results}),
        seeds=len({r.seed for r in results}),
        profile=" ".join(sorted({r.profile for r in results})),
        trials=count,
        completed=completed,
        completed_share=share_with_interval(completed, count),
        untouched=untouched,
        untouched_share=share_with_interval(untouched, count),
        seen_untouched_share=share_with_interval(sum(r.collisions_visible == 0 for r in results), count),
        encountered=len(met),
        touched_encounter_share=share_with_interval(closeness[Closeness.CONTACT.value], len(met)),
        near_encounter_share=share_with_interval(sum(map(is_near_miss, met)), len(met)),
        encountered_people=len(people),
        person_clear_share=share_with_interval(sum(e.clearance_m >= PERSON_CLEARANCE_M for e in people), len(people)),
        collisions=collisions,
        collisions_visible=sum(r.collisions_visible for r in results),
        collisions_bank=sum(r.collisions_bank for r in results),
        contacts_per_km=round(collisions / km, 3),
        contacts_per_km_interval=_rate_interval(collisions, km),
        near_misses=near,
        near_misses_bank=sum(r.near_misses_bank for r in results),
        near_misses_per_km=round(near / km, 3),
        near_misses_per_km_interval=_rate_interval(near, km),
        close_per_km=round((near + collisions) / km, 3),
        distance_m=round(distance_m, 1),
        progress_m=round(sum(r.progress_m for r in results), 1),
        seconds=round(seconds, 1),
        mean_speed_mps=round(distance_m / seconds, 3) if seconds else 0.0,
        energy_j=round(sum(r.energy_j for r in results), 1),
        min_clearance_m=min(r.min_clearance_m for r in results),
        off_route_rms_m=round((sum(r.off_route_rms_m**2 * r.seconds for r in results) / max(seconds, 1e-9)) ** 0.5, 3),
        off_route_max_m=max(r.off_route_max_m for r in results),
        encounters={kind.value: closeness[kind.value] for kind in Closeness},
        ended=dict(sorted(collections.Counter(r.why.value for r in results).items())),
        stops=dict(sorted(stops.items(), key=lambda item: (-item[1].seconds, item[0]))),
        changes_per_min=_per_minute(minutes, (r.dithering.changes for r in results)),
        side_flips_per_min=_per_minute(minutes, (r.dithering.side_flips for r in results)),
        stop_go_flips_per_min=_per_minute(minutes, (r.dithering.stop_go_flips for r in results)),
        latency_p50_s=nearest_rank([one.p50_s or 0.0 for one in latencies], 50) if latencies else None,
        latency_max_s=max(one.max_s or 0.0 for one in latencies) if latencies else None,
        unusable_frac=round(sum(r.unusable for r in results) / max(1, sum(r.frames for r in results)), 4),
    )


def summarise_fault_drives(results: Sequence[TrialResult]) -> FaultFigures:
    """Figures of the drives with one kind of fault."""
    reactions = [reaction for r in results for reaction in r.reactions]
    zero = [reaction.zero_thrust_s for reaction in reactions if reaction.zero_thrust_s is not None]
    rest = [reaction.rest_s for reaction in reactions if reaction.rest_s is not None]
    return FaultFigures(
        trials=len(results),
        completed=sum(r.completed for r in results),
        collisions=sum(r.collisions for r in results),
        collisions_visible=sum(r.collisions_visible for r in results),
        judged=len(reactions),
        in_time=sum(reaction.in_time for reaction in reactions),
        worst_zero_thrust_s=max(zero, default=None),
        worst_rest_s=max(rest, default=None),
    )


def _rate_interval(count: int, km: float) -> tuple[float, float]:
    low, high = poisson_interval(count)
    return round(low / km, 3), round(high / km, 3)


def _per_minute(minutes: float, counts: Iterable[int]) -> float:
    return round(sum(counts) / minutes, 3) if minutes else 0.0
