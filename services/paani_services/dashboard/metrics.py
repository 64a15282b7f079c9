"""What the hub holds, in the text format that Prometheus reads. Needs the extra `metrics`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.version import version_text
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.page_state import PageServices
from paani_services.dashboard.readiness import find_unready

CONTENT_TYPE = CONTENT_TYPE_LATEST
T = TypeVar("T", bound=m.Message)
Labels = TypeVar("Labels", bound=tuple[str, ...])
MIB = 2**20


class HubCollector:
    """Reads the hub at one time [us]; a message that is older than its topic allows gives no value."""

    def __init__(self, hub: Hub, config: Config, now_us: int) -> None:
        self._hub, self._config, self._now_us = hub, config, now_us

    def collect(self) -> Iterator[Metric]:
        """Every family, for `CollectorRegistry`."""
        labels = (version_text(), self._config.bus.vessel, str(self._config.bus.domain), self._config.profile)
        yield _gauge("paani_info", "What runs here; always 1.", ("version", "vessel", "domain", "profile"), {labels: 1})
        yield _gauge("paani_pages", "Pages that are open.", (), {(): len(self._hub.clients)})
        yield from self._services()
        yield from self._topics()
        yield from self._boat()

    def _services(self) -> Iterator[Metric]:
        services = self._config.services
        unready = find_unready(self._hub, services, self._now_us)
        yield _gauge(
            "paani_service_ready", "Whether the process is there and ready.", ("service",),
            {(name,): name not in unready for name in services},
        )  # fmt: skip
        newest = self._hub.newest("dashboard/services")
        lives = newest[0].services if newest is not None and isinstance(newest[0], PageServices) else ()
        yield _counter(
            "paani_service_starts", "Starts seen since the dashboard began.", ("service",),
            {(life.service,): life.starts for life in lives if life.service in services},
        )  # fmt: skip
        reports = {name: report for name in services if (report := self._fresh(keys.health(name), m.Health))}
        for name, text, values in (
            ("paani_service_cpu_cores", "Processor time used.", {(s,): r.cpu_cores for s, r in reports.items()}),
            ("paani_service_resident_bytes", "Memory held.", {(s,): r.rss_mib * MIB for s, r in reports.items()}),
        ):
            yield _gauge(name, text, ("service",), values)
        dropped: dict[tuple[str, ...], float] = {}
        for name, report in reports.items():
            for drop in report.drops:
                dropped[name, drop.cause] = dropped.get((name, drop.cause), 0) + drop.count
        yield _counter("paani_service_dropped", "Messages dropped, by cause.", ("service", "cause"), dropped)

    def _topics(self) -> Iterator[Metric]:
        ages_s = {
            (topic.name,): (self._now_us - newest[1]) * 1e-6
            for topic in keys.topics_in(self._config.bus.graph)
            if (newest := self._hub.newest(topic.name)) is not None
        }
        yield _gauge("paani_topic_age_seconds", "Since the newest message of the topic came.", ("topic",), ages_s)

    def _boat(self) -> Iterator[Metric]:
        if (state := self._fresh(keys.OPERATOR_STATE, m.OperatorState)) is not None:
            yield _gauge("paani_armed", "Whether the boat is armed.", (), {(): state.armed})
            yield _gauge("paani_stopped", "Whether a STOP is latched.", (), {(): state.stopped})
            yield _counter("paani_stops", "STOPs since the operator's process began.", (), {(): state.stops})
        if (advisory := self._fresh(keys.ADVISORY, m.Advisory)) is not None:
            values = {(each.value,): each is advisory.direction for each in m.Direction}
            yield _gauge("paani_advice", "1 for the direction that is advised.", ("direction",), values)
        if (order := self._fresh(keys.COMMAND, m.NavCommand)) is not None:
            inhibits = {(each.value,): each in order.inhibits for each in m.Inhibit}
            yield _gauge("paani_inhibit", "1 for what forbids motion.", ("inhibit",), inhibits)
        if (applied := self._fresh(keys.THRUST_APPLIED, m.ThrustApplied)) is not None:
            thrust_n: dict[tuple[str, ...], float] = {("left",): applied.left_n, ("right",): applied.right_n}
            yield _gauge("paani_thrust_newtons", "Thrust applied.", ("side",), thrust_n)
            causes = {(each.value,): each is applied.zero_cause for each in m.ZeroCause}
            yield _gauge("paani_thrust_zero_cause", "1 for why zero is applied.", ("cause",), causes)
        if (odometry := self._fresh(keys.ODOMETRY, m.Odometry)) is not None:
            yield _gauge("paani_speed_meters_per_second", "Ahead, estimated.", (), {(): odometry.surge_mps})
        if (thrusters := self._fresh(keys.THRUSTERS_STATE, m.ThrustersState)) is not None and thrusters.battery_v:
            yield _gauge("paani_battery_volts", "As the microcontroller measures it.", (), {(): thrusters.battery_v})

    def _fresh(self, topic: keys.Topic[T], kind: type[T]) -> T | None:
        value, received_us = self._hub.newest(topic.name) or (None, 0)
        is_fresh = (self._now_us - received_us) * 1e-6 <= topic.fresh_s
        return value if isinstance(value, kind) and is_fresh else None


def metrics_text(hub: Hub, config: Config, now_us: int) -> bytes:
    """The whole page of `/metrics`."""
    registry = CollectorRegistry()
    registry.register(HubCollector(hub, config, now_us))
    return generate_latest(registry)


def _gauge(name: str, text: str, labels: tuple[str, ...], values: Mapping[Labels, float]) -> Metric:
    family = GaugeMetricFamily(name, text, labels=labels)
    for key, value in values.items():
        family.add_metric(key, float(value))
    return family


def _counter(name: str, text: str, labels: tuple[str, ...], values: Mapping[Labels, float]) -> Metric:
    family = CounterMetricFamily(name, text, labels=labels)
    for key, value in values.items():
        family.add_metric(key, float(value))
    return family
