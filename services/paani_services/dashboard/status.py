"""The status of the board side for programs that poll it, from what the hub holds. Pure."""

from __future__ import annotations

from typing import TypeVar

from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.board_status import BoardStatus, ProcessStatus
from paani.bus import Picture
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.page_state import PageServices, ServiceLife

T = TypeVar("T")


def board_status(hub: Hub, profile: str, now_us: int) -> BoardStatus:
    """The newest message of each kind, and what every process said of itself last."""
    picture, _ = _newest(hub, keys.PICTURE.name, Picture, now_us)
    evidence, evidence_age_s = _newest(hub, keys.EVIDENCE.name, m.Evidence, now_us)
    advisory, advisory_age_s = _newest(hub, keys.ADVISORY.name, m.Advisory, now_us)
    services, _ = _newest(hub, "dashboard/services", PageServices, now_us)
    return BoardStatus(
        now_us=now_us,
        profile=profile,
        picture=None if picture is None else picture.header,
        evidence=evidence,
        evidence_age_s=evidence_age_s,
        advisory=advisory,
        advisory_age_s=advisory_age_s,
        processes=tuple(_process(hub, life, now_us) for life in (services.services if services else ())),
    )


def _process(hub: Hub, life: ServiceLife, now_us: int) -> ProcessStatus:
    health, _ = _newest(hub, keys.health(life.service).name, m.Health, now_us)
    status = ProcessStatus(service=life.service, alive=life.alive, starts=life.starts)
    if health is None:
        return status
    drops = sum(drop.count for drop in health.drops)
    return replace(status, cpu_cores=health.cpu_cores, rss_mib=health.rss_mib, drops=drops)


def _newest(hub: Hub, key: str, kind: type[T], now_us: int) -> tuple[T | None, float]:
    """The newest value of a key, and how long ago it came [s]."""
    value, received_us = hub.newest(key) or (None, now_us)
    return (value if isinstance(value, kind) else None), max(0.0, (now_us - received_us) * 1e-6)
