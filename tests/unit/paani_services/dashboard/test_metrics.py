"""What machines read: readiness of every process, and metrics without anything stale."""

from __future__ import annotations

from prometheus_client.parser import text_string_to_metric_families

from paani import keys
from paani import messages as m
from paani.config import load_config
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.metrics import metrics_text
from paani_services.dashboard.page_state import PageServices, ServiceLife
from paani_services.dashboard.readiness import find_unready

CONFIG = load_config()
NOW_US = 10_000_000


def hub_with(*, late: str = "", unready: str = "", dead: str = "") -> Hub:
    """Every process alive and ready, but for those named."""
    hub = Hub()
    lives = tuple(ServiceLife(name, alive=name != dead, starts=1) for name in CONFIG.services)
    hub.put("dashboard/services", PageServices(lives), NOW_US, NOW_US)
    for name in CONFIG.services:
        drops = (m.DropCount(cause="late", count=3), m.DropCount(cause="late", count=4))
        report = m.Health(
            source_us=1, service=name, ready=name != unready, uptime_s=9.0, cpu_cores=0.5, rss_mib=2.0, drops=drops
        )
        hub.put(keys.health(name).name, report, NOW_US - (4_000_000 if name == late else 0), NOW_US)
    return hub


def read(hub: Hub) -> dict[tuple[str, frozenset[tuple[str, str]]], float]:
    """Each sample by name and labels, as Prometheus would read it."""
    families = text_string_to_metric_families(metrics_text(hub, CONFIG, NOW_US).decode())
    return {(sample.name, frozenset(sample.labels.items())): sample.value for one in families for sample in one.samples}


def test_a_process_is_ready_only_if_it_lives_and_says_so_now() -> None:
    assert find_unready(Hub(), CONFIG.services, NOW_US) == dict.fromkeys(CONFIG.services, "not running")
    assert find_unready(hub_with(), CONFIG.services, NOW_US) == {}
    faults = [({"dead": "advisor"}, "not running"), ({"late": "advisor"}, "no recent report")]
    for changes, fault in (*faults, ({"unready": "advisor"}, "not ready")):
        assert find_unready(hub_with(**changes), CONFIG.services, NOW_US) == {"advisor": fault}


def test_every_metric_is_ours_and_of_now() -> None:
    hub = hub_with(late="eye")
    hub.put(keys.OPERATOR_STATE.name, m.OperatorState(source_us=1, armed=True, stopped=False, stops=2), NOW_US, NOW_US)
    odometry = m.Odometry(source_us=1, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.5)
    hub.put(keys.ODOMETRY.name, odometry, NOW_US - 2_000_000, NOW_US)
    order = m.NavCommand(source_us=1, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.NO_ROUTE,))
    hub.put(keys.COMMAND.name, order, NOW_US, NOW_US)
    found = read(hub)
    assert all(name.startswith("paani_") for name, _ in found)
    assert found["paani_armed", frozenset()] == 1.0
    assert found["paani_stops_total", frozenset()] == 2.0
    assert found["paani_inhibit", frozenset({("inhibit", "NO_ROUTE")})] == 1.0
    assert found["paani_inhibit", frozenset({("inhibit", "NOT_ARMED")})] == 0.0
    assert found["paani_service_dropped_total", frozenset({("service", "advisor"), ("cause", "late")})] == 7.0
    assert found["paani_service_resident_bytes", frozenset({("service", "advisor")})] == 2.0 * 2**20
    assert found["paani_service_ready", frozenset({("service", "eye")})] == 0.0
    assert ("paani_service_cpu_cores", frozenset({("service", "eye")})) not in found, "its report is stale"
    assert ("paani_speed_meters_per_second", frozenset()) not in found, "the position is stale"
    assert found["paani_topic_age_seconds", frozenset({("topic", keys.ODOMETRY.name)})] == 2.0
