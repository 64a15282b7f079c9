"""Messages of the dashboard to its page: settings, and which services are alive. Pure."""

from __future__ import annotations

from pathlib import Path

import msgspec

from paani import keys
from paani.config import Config, CorridorConfig, RiskConfig

MODES = {keys.Graph.SIMULATION: "sim", keys.Graph.HIL: "hil", keys.Graph.HULL: "hull"}


class TopicFreshness(msgspec.Struct, frozen=True):
    name: str
    producer: str
    rate_hz: float
    fresh_s: float


class PageSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Settings that the page shows or draws with; constant while the process runs.

    mode: what the thrust moves, `sim`, `hil` or `hull`; `replay`: a recording is played, and nothing moves. pictures:
    where they come from, `sim`, `camera` or `file`. own_hull: corners of what the boat's own hull covers of them, in
    [0, 1]. turn_radius_m: of the hull under way, 0 where it turns on the spot. planner: whether it chooses heading and
    speed. replayed: name of the recording that the page plays instead of the present; empty: none.
    """

    vessel: str
    domain: int
    profile: str
    mode: str
    pictures: str
    planner: bool
    world: str
    own_hull: tuple[tuple[float, float], ...]
    corridors: CorridorConfig
    weights: RiskConfig
    acceptance_m: float
    fence_margin_m: float
    turn_radius_m: float
    topics: tuple[TopicFreshness, ...]
    services: tuple[str, ...]
    replayed: str


class ServiceLife(msgspec.Struct, frozen=True):
    service: str
    alive: bool
    starts: int


class PageServices(msgspec.Struct, frozen=True):
    """Which services are alive; every start after the first is a restart."""

    services: tuple[ServiceLife, ...]


def page_settings(config: Config) -> PageSettings:
    camera = config.camera
    is_replay = config.bus.vessel.endswith(keys.REPLAY_SUFFIX) or bool(config.dashboard.replayed)
    return PageSettings(
        vessel=config.bus.vessel,
        domain=config.bus.domain,
        profile=config.profile,
        mode="replay" if is_replay else MODES[config.bus.graph],
        pictures="file" if camera.is_recording else "sim" if camera.source == "sim" else "camera",
        planner=config.is_planner_active,
        world=config.world.name,
        own_hull=config.perception.ego_polygon,
        corridors=config.perception.corridors,
        weights=config.advisor.risk,
        acceptance_m=config.navigator.acceptance_m,
        fence_margin_m=config.navigator.fence_margin_m,
        turn_radius_m=config.navigator.planner.turn_radius_m,
        topics=tuple(
            TopicFreshness(t.name, t.producer, t.rate_hz, t.fresh_s) for t in keys.topics_in(config.bus.graph)
        ),
        services=config.services,
        replayed=Path(config.dashboard.replayed).name,
    )


class ServiceLiveness:
    """Counts the starts of each service from its liveliness events."""

    def __init__(self) -> None:
        self._lives = {name: ServiceLife(name, alive=False, starts=0) for name in keys.SERVICES}

    def update(self, service: str, alive: bool) -> PageServices:
        before = self._lives.get(service, ServiceLife(service, alive=False, starts=0))
        starts = before.starts + (alive and not before.alive)
        self._lives[service] = ServiceLife(service, alive, starts)
        return PageServices(tuple(self._lives.values()))
