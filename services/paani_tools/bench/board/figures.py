"""The figures of a board run, from its polls, by the paper's rules (U5, U6, U10). Pure."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import msgspec

from paani import messages as m
from paani.board_status import BoardStatus
from paani.statistics.order_statistics import median, nearest_rank
from paani_tools.bench.board.host_counters import HostSample, cpu_percent
from paani_tools.bench.board.poll import Poll

PAPER_ZONE = "cpuss0"  # V21
STALE_REASONS = frozenset({m.Reason.STALE_EVIDENCE, m.Reason.FUTURE_EVIDENCE, m.Reason.NO_EVIDENCE})


class Spread(msgspec.Struct, frozen=True, kw_only=True):
    """Median, nearest-rank p95 and maximum (U5); None without samples."""

    median: float | None = None
    p95: float | None = None
    maximum: float | None = None
    samples: int = 0


class BoardFigures(msgspec.Struct, frozen=True, kw_only=True):
    """What a run of the protocol measured.

    Stage times, frame age and `unusable` are of distinct results (by frame); CPU, memory, temperature, `learned` and
    `stale` of polls. `cadence_hz` and `captured_hz` follow from the numbers of the first and last result and picture
    sampled, so results between two polls count too. `returns`, `drops`, `oom_kills`, `throttled_periods` and
    `major_faults` are increases from the first poll to the last; a process returns that was started again, or whose
    link was silent for `bus.lease_ms`. None: not measured here.
    """

    polls_wanted: int
    polls: int
    answered: int
    failures: dict[str, int]
    distinct_results: int
    pipeline_ms: Spread
    detector_ms: Spread
    segmenter_run_ms: Spread
    segmenter_ms: Spread
    answer_ms: Spread
    cadence_hz: float | None
    captured_hz: float | None
    frame_age_s: Spread
    cpu_percent: Spread
    memory_mib: Spread
    temperature_zone: str
    temperature_c: Spread
    learned: int
    stale: int
    unusable: int
    returns: int
    drops: int
    oom_kills: int | None
    throttled_periods: int | None
    major_faults: int | None


def board_figures(polls: Sequence[Poll], wanted: int) -> BoardFigures:
    """The figures of the polls that were made, of `wanted`."""
    answered = [poll.status for poll in polls if poll.status is not None]
    sampled = [status.evidence for status in answered if status.evidence is not None]
    results = list({(result.frame_epoch, result.frame_seq): result for result in sampled}.values())
    inferred = [result.timing for result in results if result.timing.inference_ms > 0.0]
    pictures = [status.picture for status in answered if status.picture is not None]
    hosts = [poll.host for poll in polls]
    loads = [cpu_percent(before, after) for before, after in itertools.pairwise(hosts)]
    zone = _temperature_zone(hosts)
    return BoardFigures(
        polls_wanted=wanted,
        polls=len(polls),
        answered=len(answered),
        failures=dict(Counter(poll.failure for poll in polls if poll.status is None)),
        distinct_results=len(results),
        pipeline_ms=spread(result.timing.total_ms for result in results),
        detector_ms=spread(timing.detector_ms for timing in inferred),
        segmenter_run_ms=spread(timing.segmenter_run_ms for timing in inferred),
        segmenter_ms=spread(timing.segmenter_ms for timing in inferred),
        answer_ms=spread(poll.answer_ms for poll in polls if poll.status is not None),
        cadence_hz=_rate_hz([(result.epoch, result.seq, result.sent_us) for result in sampled]),
        captured_hz=_rate_hz([(picture.frame_epoch, picture.frame_seq, picture.source_us) for picture in pictures]),
        frame_age_s=spread((r.timing.frame_age_ms + r.timing.total_ms) * 1e-3 for r in results),
        cpu_percent=spread(load for load in loads if load is not None),
        memory_mib=spread(host.memory_mib for host in hosts if host.memory_mib is not None),
        temperature_zone=zone,
        temperature_c=spread(host.temperature_c[zone] for host in hosts if zone in host.temperature_c),
        learned=sum(result.segmentation is m.SegmentationSource.LEARNED for result in sampled),
        stale=sum(is_stale(status) for status in answered),
        unusable=sum(not result.usable for result in results),
        returns=sum(_increases(answered, lambda process: max(1, process.starts)).values()),
        drops=sum(_increases(answered, lambda process: process.drops).values()),
        oom_kills=_host_increase(hosts, lambda host: host.oom_kills),
        throttled_periods=_host_increase(hosts, lambda host: host.throttled_periods),
        major_faults=_host_increase(hosts, lambda host: host.major_faults),
    )


def spread(samples: Iterable[float]) -> Spread:
    """Median, p95 and maximum by the paper's rule."""
    values = list(samples)
    if not values:
        return Spread()
    return Spread(median=median(values), p95=nearest_rank(values, 95.0), maximum=max(values), samples=len(values))


def is_stale(status: BoardStatus) -> bool:
    """Whether the advice sampled is missing, says that its evidence is too old, or has outlived its evidence."""
    advisory = status.advisory
    if advisory is None or advisory.reason in STALE_REASONS:
        return True
    return status.advisory_age_s + advisory.evidence_age_s > advisory.lifetime_s


def networks_of(polls: Sequence[Poll]) -> str:
    """The networks that the results were made by, as perception names them."""
    sampled = [poll.status.evidence for poll in polls if poll.status is not None and poll.status.evidence is not None]
    return "; ".join(sorted({evidence.models for evidence in sampled})) or "none"


def _rate_hz(numbered: Sequence[tuple[int, int, int]]) -> float | None:
    """Rate of a numbered stream from (epoch, number, time [us]) samples; each epoch counts for itself."""
    counted, span_us = 0, 0
    for epoch in {entry[0] for entry in numbered}:
        of_epoch = [entry for entry in numbered if entry[0] == epoch]
        counted += of_epoch[-1][1] - of_epoch[0][1]
        span_us += of_epoch[-1][2] - of_epoch[0][2]
    return counted / (span_us * 1e-6) if span_us > 0 else None


def _increases(answered: Sequence[BoardStatus], count_of: Callable[..., int]) -> dict[str, int]:
    """By how much a counter of each process grew; one that begins again with its process adds what it then reached."""
    grown: Counter[str] = Counter()
    for before, after in itertools.pairwise(answered):
        earlier = {process.service: count_of(process) for process in before.processes}
        for process in after.processes:
            count = count_of(process)
            known = earlier.get(process.service, 0)
            grown[process.service] += count - known if count >= known else count
    return dict(grown)


def _host_increase(hosts: Sequence[HostSample], count_of: Callable[[HostSample], int | None]) -> int | None:
    counts = [count for host in hosts if (count := count_of(host)) is not None]
    return counts[-1] - counts[0] if counts else None


def _temperature_zone(hosts: Sequence[HostSample]) -> str:
    """The paper's zone where there is one, else the hottest; "" where there is none."""
    names = sorted({name for host in hosts for name in host.temperature_c})
    papers = [name for name in names if name.startswith(PAPER_ZONE)]
    if papers:
        return papers[0]
    hottest = {name: max(host.temperature_c.get(name, -1e9) for host in hosts) for name in names}
    return max(hottest, key=lambda name: hottest[name], default="")
