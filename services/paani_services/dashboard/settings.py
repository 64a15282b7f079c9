"""What the page needs to know of the configuration and of this process. Pure."""

from __future__ import annotations

import msgspec

from paani import keys
from paani.config import Config, CorridorConfig, RiskConfig
from paani_services.dashboard.operator import Operator


class Freshness(msgspec.Struct, frozen=True):
    name: str
    producer: str
    rate_hz: float
    fresh_s: float


class PageSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Constant while the process lives."""

    vessel: str
    domain: int
    profile: str
    mode: str
    world: str
    corridors: CorridorConfig
    weights: RiskConfig
    acceptance_m: float
    topics: tuple[Freshness, ...]
    services: tuple[str, ...]


class PageOperator(msgspec.Struct, frozen=True, kw_only=True):
    """The operator's word as the page shows it; `confirmed_ms` is None until the plant holds zero."""

    armed: bool
    stopped: bool
    asked: bool
    confirmed_ms: float | None


class ServiceLife(msgspec.Struct, frozen=True):
    service: str
    alive: bool
    starts: int


class PageServices(msgspec.Struct, frozen=True):
    """Liveliness as this process saw it; every start after the first is a restart."""

    services: tuple[ServiceLife, ...]


def page_settings(config: Config) -> PageSettings:
    source = config.camera.source
    return PageSettings(
        vessel=config.bus.vessel,
        domain=config.bus.domain,
        profile=config.profile,
        mode="sim" if source == "sim" else "board" if source.startswith("webcam") else "replay",
        world=config.world.name,
        corridors=config.perception.corridors,
        weights=config.advisor.risk,
        acceptance_m=config.navigator.acceptance_m,
        topics=tuple(Freshness(t.name, t.producer, t.rate_hz, t.fresh_s) for t in keys.TOPICS),
        services=config.services,
    )


def page_operator(state: Operator) -> PageOperator:
    confirmed_ms = (state.confirmed_us - state.asked_us) * 1e-3 if state.confirmed_us else None
    return PageOperator(armed=state.armed, stopped=state.stopped, asked=state.asked_us > 0, confirmed_ms=confirmed_ms)


class Lives:
    """Counts starts of each service from liveliness events."""

    def __init__(self) -> None:
        self._lives = {name: ServiceLife(name, alive=False, starts=0) for name in keys.SERVICES}

    def hear(self, service: str, alive: bool) -> PageServices:
        before = self._lives.get(service, ServiceLife(service, alive=False, starts=0))
        starts = before.starts + (alive and not before.alive)
        self._lives[service] = ServiceLife(service, alive, starts)
        return PageServices(tuple(self._lives.values()))
