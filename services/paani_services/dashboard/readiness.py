"""Whether every process of these settings is there and says that it is ready. Pure."""

from __future__ import annotations

from paani import keys
from paani import messages as m
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.page_state import PageServices


def find_unready(hub: Hub, services: tuple[str, ...], now_us: int) -> dict[str, str]:
    """What is wrong with each process that is not ready; empty where all are."""
    newest = hub.newest("dashboard/services")
    lives = newest[0].services if newest is not None and isinstance(newest[0], PageServices) else ()
    alive = {life.service for life in lives if life.alive}
    faults = {name: _fault(hub, name, now_us) if name in alive else "not running" for name in services}
    return {name: fault for name, fault in faults.items() if fault}


def _fault(hub: Hub, service: str, now_us: int) -> str:
    topic = keys.health(service)
    report, received_us = hub.newest(topic.name) or (None, 0)
    if not isinstance(report, m.Health) or (now_us - received_us) * 1e-6 > topic.fresh_s:
        return "no recent report"
    return "" if report.ready else "not ready"
