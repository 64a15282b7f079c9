"""Figures of many drives by policy, world and fault, with intervals. Pure."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from paani.statistics.order_statistics import nearest_rank
from paani_sim.trials.intervals import wilson_interval
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import Closeness, TrialResult
from paani_sim.trials.trial_cases import TrialCase


class Share(msgspec.Struct, frozen=True, kw_only=True):
    """A share of trials with its 95 % Wilson interval, in [0, 1]."""

    share: float
    low: float
    high: float


class StopFigures(msgspec.Struct, frozen=True, kw_only=True):
    count: int
    seconds: float


class PolicyFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Sums over all drives without a fault. `near_misses` are of things; those of banks are counted apart.

    `close_per_km`: near misses and contacts, as a boat held by what it hit comes near to nothing after it.
    """

    trials: int
    completed: int
    completed_share: Share
    untouched: int
    untouched_share: Share
    collisions: int
    collisions_visible: int
    collisions_bank: int
    contacts_per_km: float
    near_misses: int
    near_misses_bank: int
    near_misses_per_km: float
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


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes."""

    suite: str
    policies: dict[str, PolicyFigures]
    worlds: dict[str, dict[str, PolicyFigures]]
    faults: dict[str, FaultFigures]


def summarise_suite(suite: str, results: Mapping[TrialCase, TrialResult]) -> Summary:
    """Summarise drives by policy, by policy and world, and by fault."""
    plain = {case: result for case, result in sorted(results.items()) if not case.fault}
    policies = [policy for policy in Policy if any(case.policy is policy for case in plain)]
    worlds = sorted({case.world for case in plain})
    kinds = sorted({case.fault for case in results if case.fault})
    return Summary(
        suite=suite,
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
    )


def summarise_drives(results: Sequence[TrialResult]) -> PolicyFigures:
    """Figures of one or more drives."""
    count, seconds = len(results), sum(r.seconds for r in results)
    distance_m, minutes = sum(r.distance_m for r in results), sum(r.dithering.seconds for r in results) / 60.0
    collisions, near = sum(r.collisions for r in results), sum(r.near_misses for r in results)
    completed, untouched = sum(r.completed for r in results), sum(r.collisions == 0 for r in results)
    km = max(distance_m * 1e-3, 1e-9)
    closeness = collections.Counter(e.closeness.value for r in results for e in r.encounters if e.what != "bank")
    stops: dict[str, StopFigures] = {}
    for stop in (stop for r in results for stop in r.stops):
        old = stops.get(stop.reason, StopFigures(count=0, seconds=0.0))
        stops[stop.reason] = StopFigures(count=old.count + stop.count, seconds=round(old.seconds + stop.seconds, 2))
    latencies = [r.latency for r in results if r.latency.samples]
    return PolicyFigures(
        trials=count,
        completed=completed,
        completed_share=share_with_interval(completed, count),
        untouched=untouched,
        untouched_share=share_with_interval(untouched, count),
        collisions=collisions,
        collisions_visible=sum(r.collisions_visible for r in results),
        collisions_bank=sum(r.collisions_bank for r in results),
        contacts_per_km=round(collisions / km, 3),
        near_misses=near,
        near_misses_bank=sum(r.near_misses_bank for r in results),
        near_misses_per_km=round(near / km, 3),
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


def share_with_interval(successes: int, trials: int) -> Share:
    """A share with its Wilson interval."""
    low, high = wilson_interval(successes, trials)
    return Share(share=round(successes / trials, 4) if trials else 0.0, low=round(low, 4), high=round(high, 4))


def format_summary(summary: Summary) -> str:
    """One line per policy, then one per fault."""
    lines = [
        f"{'policy':8} {'drives':>6}  {'completed [95 %]':22} {'no contact [95 %]':22} {'contacts':>8} {'visible':>7}"
        f" {'bank':>5} {'per km':>7} {'near':>5} {'close/km':>8} {'least':>6} {'off rms':>8} {'turns/min':>9} {'km':>7}"
    ]
    for name, p in summary.policies.items():
        lines.append(
            f"{name:8} {p.trials:6}  {_format_share(p.completed_share):22} {_format_share(p.untouched_share):22}"
            f" {p.collisions:8} {p.collisions_visible:7} {p.collisions_bank:5} {p.contacts_per_km:7.2f}"
            f" {p.near_misses:5}"
            f" {p.close_per_km:8.2f} {p.min_clearance_m:6.2f} {p.off_route_rms_m:8.2f}"
            f" {p.changes_per_min:9.2f} {p.distance_m * 1e-3:7.3f}"
        )
    if summary.faults:
        lines += [
            "",
            f"{'fault':16} {'drives':>6} {'completed':>9} {'contacts':>8} {'in time':>9} {'fans off [s]':>12}",
        ]
        for name, f in summary.faults.items():
            judged = f"{f.in_time}/{f.judged}" if f.judged else "-"
            worst = "-" if f.worst_zero_thrust_s is None else f"{f.worst_zero_thrust_s:.2f}"
            lines.append(f"{name:16} {f.trials:6} {f.completed:9} {f.collisions:8} {judged:>9} {worst:>12}")
    return "\n".join(lines) + "\n"


def _format_share(s: Share) -> str:
    return f"{100 * s.share:5.1f} % [{100 * s.low:4.1f}, {100 * s.high:5.1f}]"


def _per_minute(minutes: float, counts: Iterable[int]) -> float:
    return round(sum(counts) / minutes, 3) if minutes else 0.0
