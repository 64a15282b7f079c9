"""Figures of one run, from the messages on the bus. Pure: feed messages, ask for the report.

Latencies are differences of the stamps that messages carry, all on this machine's clock [ms]:

    perception         `Evidence.timing.total_ms`: from taking the picture to the evidence
    inference          `Evidence.timing.inference_ms`: detector and segmenter
    advisor            evidence sent -> first advisory from it sent (republished advice does not count)
    navigator          that advisory sent -> first order from it sent
    controller         that order sent -> first thrust from it sent
    adapter            that thrust sent -> step at which the adapter put it in force (refused or zeroed: no sample)
    capture_to_thrust  picture captured -> step at which the thrust adapter put in force a thrust decided from it
    transport          capture_to_thrust less the inference on the same picture
"""

from __future__ import annotations

import collections
from collections.abc import Iterable, Mapping

import msgspec

from paani import keys
from paani import messages as m
from paani.statistics.order_statistics import nearest_rank

STAGES = (
    "perception",
    "inference",
    "advisor",
    "navigator",
    "controller",
    "adapter",
    "capture_to_thrust",
    "transport",
)
EVENTS = frozenset(topic.name for topic in keys.TOPICS if topic.stance is keys.Stance.EVENT)
REMEMBERED = 256  # stamps that may still be named by a later message


class Percentiles(msgspec.Struct, frozen=True, kw_only=True):
    """Nearest rank [ms]; None without samples."""

    p50: float | None = None
    p95: float | None = None
    p99: float | None = None
    samples: int = 0


class ServiceFigures(msgspec.Struct, frozen=True, kw_only=True):
    """`rate_hz` of the main output, mean CPU, largest resident memory, restarts by the supervisor."""

    rate_hz: float = 0.0
    cpu_cores: float = 0.0
    rss_mib: float = 0.0
    restarts: int = 0


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """What `--summary` writes.

    Rates, CPU, latencies, decisions, reasons and `lost_*` (numbers missing on the bus) are those of the last
    `duration_s`, since every service was alive; distance, waypoints, collisions, the other drops and `superseded`
    are totals since the start.
    `drops` are messages refused or lost, by cause; `superseded` are those that a newer one of the same topic
    replaced before anyone looked, which is how newest-wins topics work.
    """

    duration_s: float
    profile: str
    world: str
    services: dict[str, ServiceFigures]
    board_rss_mib: float
    latency_ms: dict[str, Percentiles]
    decisions: dict[str, int]
    reasons: dict[str, int]
    distance_m: float
    waypoints_reached: int
    collisions: int
    drops: dict[str, int]
    superseded: dict[str, int]


def percentiles(samples: Iterable[float]) -> Percentiles:
    """Nearest-rank percentiles: the smallest sample that at least p % of the samples do not exceed."""
    ordered = sorted(samples)
    if not ordered:
        return Percentiles()
    p50, p95, p99 = (round(nearest_rank(ordered, p), 3) for p in (50, 95, 99))
    return Percentiles(p50=p50, p95=p95, p99=p99, samples=len(ordered))


class ProcessTotals(dict[object, float]):
    """Newest value of a counter in each life of its producer; it begins again at zero with each life."""

    @property
    def total(self) -> int:
        return round(sum(self.values()))


class Stamps(dict[int, float]):
    """Stamps that a later message may name, and what belongs to each; forgets the oldest."""

    def remember(self, stamp_us: int, value: float = 0.0) -> None:
        self[stamp_us] = value
        while len(self) > REMEMBERED:
            del self[next(iter(self))]


class Summary:
    """Collects one run."""

    def __init__(self) -> None:
        self._begin_us: int | None = None
        self._outputs: collections.Counter[str] = collections.Counter()
        self._latency: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self._decisions: collections.Counter[str] = collections.Counter({d.value: 0 for d in m.Direction})
        self._reasons: collections.Counter[str] = collections.Counter({r.value: 0 for r in m.Reason})
        self._cpu: dict[str, list[float]] = {}
        self._rss_mib: dict[str, float] = {}
        self._drops: collections.defaultdict[str, ProcessTotals] = collections.defaultdict(ProcessTotals)
        self._superseded: collections.defaultdict[str, ProcessTotals] = collections.defaultdict(ProcessTotals)
        self._distance_m, self._collisions, self._waypoints = ProcessTotals(), ProcessTotals(), ProcessTotals()
        self._place: dict[tuple[str, str], tuple[int, int]] = {}
        self._lost: collections.Counter[str] = collections.Counter()
        self._evidence, self._advisories, self._commands = Stamps(), Stamps(), Stamps()
        self._thrusts, self._pictures = Stamps(), Stamps()

    def begin(self, now_us: int) -> None:
        """Every service is alive: what is measured over time is measured from here."""
        self._begin_us = now_us
        for counters in (self._outputs, self._cpu, self._lost):
            counters.clear()
        for counts in (self._decisions, self._reasons):
            counts.update({name: -n for name, n in counts.items()})
        for samples in self._latency.values():
            samples.clear()

    @property
    def begun(self) -> bool:
        return self._begin_us is not None

    def count_output(self, service: str, n: int) -> None:
        """`n` more messages of a service whose main output (a picture) is not fed."""
        self._outputs[service] += n

    def feed(self, message: m.Message) -> None:
        """Take one message, in the order of arrival."""
        self._count_lost(message)
        match message:
            case m.Evidence():
                self._outputs["perception"] += 1
                self._evidence.remember(message.sent_us)
                self._pictures.remember(message.source_us, message.timing.inference_ms)
                self._latency["perception"].append(message.timing.total_ms)
                self._latency["inference"].append(message.timing.inference_ms)
            case m.Advisory():
                self._outputs["advisor"] += 1
                self._decisions[message.direction] += 1
                self._reasons[message.reason] += 1
                if self._step("advisor", self._evidence, message.evidence_sent_us, message.sent_us):
                    self._advisories.remember(message.sent_us)
            case m.NavCommand():
                self._outputs["navigator"] += 1
                self._waypoints[message.epoch] = message.waypoints_reached
                if self._step("navigator", self._advisories, message.advisory_sent_us, message.sent_us):
                    self._commands.remember(message.sent_us)
            case m.Thrust():
                self._outputs["controller"] += 1
                if self._step("controller", self._commands, message.command_sent_us, message.sent_us):
                    self._thrusts.remember(message.sent_us)
            case m.ThrustApplied(zero_cause=cause) if cause is not m.ZeroCause.NONE:
                self._outputs[message.producer] += 1
            case m.ThrustApplied():
                self._outputs[message.producer] += 1
                self._step("adapter", self._thrusts, message.command_sent_us, message.since_us)
                inference_ms = self._pictures.get(message.command_source_us, 0.0)
                if self._step("capture_to_thrust", self._pictures, message.command_source_us, message.since_us):
                    self._latency["transport"].append(self._latency["capture_to_thrust"][-1] - inference_ms)
            case m.TruePose():
                self._distance_m[message.epoch] = message.distance_m
                self._collisions[message.epoch] = message.collisions
            case m.Odometry():
                self._outputs["localization"] += 1
            case m.Arming():
                self._outputs["operator"] += 1
            case m.Tuning():
                self._outputs["dashboard"] += 1
            case m.Health():
                self._take_health(message)

    def report(self, now_us: int, profile: str, world: str, restarts: Mapping[str, int]) -> Report:
        """The figures so far. `restarts` names every service that was run."""
        duration_s = 0.0 if self._begin_us is None else max(0.0, (now_us - self._begin_us) * 1e-6)
        services = {
            name: ServiceFigures(
                rate_hz=round(self._outputs[name] / duration_s, 3) if duration_s else 0.0,
                cpu_cores=round(_mean(self._cpu.get(name, [])), 4),
                rss_mib=round(self._rss_mib.get(name, 0.0), 2),
                restarts=count,
            )
            for name, count in restarts.items()
        }
        drops = {cause: lives.total for cause, lives in self._drops.items()} | dict(self._lost)
        return Report(
            duration_s=round(duration_s, 3),
            profile=profile,
            world=world,
            services=services,
            board_rss_mib=round(sum(services[n].rss_mib for n in keys.BOARD_SERVICES if n in services), 2),
            latency_ms={stage: percentiles(samples) for stage, samples in self._latency.items()},
            decisions=dict(self._decisions),
            reasons=dict(self._reasons),
            distance_m=round(sum(self._distance_m.values()), 3),
            waypoints_reached=self._waypoints.total,
            collisions=self._collisions.total,
            drops={cause: count for cause, count in sorted(drops.items()) if count},
            superseded={topic: lives.total for topic, lives in sorted(self._superseded.items()) if lives.total},
        )

    def _step(self, stage: str, waiting: Stamps, named_us: int, at_us: int) -> bool:
        """The first message that names a waiting stamp is a sample of the stage."""
        if waiting.pop(named_us, None) is None:
            return False
        self._latency[stage].append((at_us - named_us) * 1e-3)
        return True

    def _take_health(self, health: m.Health) -> None:
        service, life = health.service, (health.service, health.epoch)
        if service == "router":
            self._outputs[service] += 1
        self._cpu.setdefault(service, []).append(health.cpu_cores)
        self._rss_mib[service] = max(self._rss_mib.get(service, 0.0), health.rss_mib)
        for drop in health.drops:
            self._drops[drop.cause][life] = drop.count
        for entry in health.inputs:
            if entry.topic in EVENTS:
                self._drops[f"overflow_{entry.topic}"][life] = entry.superseded
            else:
                self._superseded[entry.topic][life] = entry.superseded

    def _count_lost(self, message: m.Message) -> None:
        source = (type(message).__name__, message.producer)
        epoch, seq = self._place.get(source, (message.epoch, message.seq - 1))
        if message.epoch == epoch and message.seq > seq + 1:
            self._lost[f"lost_{type(message).__name__}"] += message.seq - seq - 1
        self._place[source] = (message.epoch, message.seq)


def _mean(samples: list[float]) -> float:
    return sum(samples) / len(samples) if samples else 0.0
