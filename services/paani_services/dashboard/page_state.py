"""Messages of the dashboard to its page: settings, and which services are alive. Pure."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec.structs import replace

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
    """Which services are alive, and how often each was seen to start; every start after the first is a restart."""

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
    """Which services are there, by their liveliness, and their starts, by the epoch of what they report.

    A router that was lost takes every liveliness token with it; the epoch stays with the process, and becomes a lower
    one only where the clock was set back.
    """

    def __init__(self) -> None:
        self._lives = {name: ServiceLife(name, alive=False, starts=0) for name in keys.SERVICES}
        self._epochs: dict[str, int] = {}

    def update(self, service: str, alive: bool) -> PageServices:
        """The services after a liveliness event."""
        return self._put(ServiceLife(service, alive, self._life(service).starts))

    def report(self, service: str, epoch: int) -> PageServices | None:
        """The services after a health report of this epoch, where that tells of a start."""
        is_start = epoch > self._epochs.get(service, -1)
        self._epochs[service] = epoch
        life = self._life(service)
        return self._put(replace(life, starts=life.starts + 1)) if is_start else None

    def _life(self, service: str) -> ServiceLife:
        return self._lives.get(service, ServiceLife(service, alive=False, starts=0))

    def _put(self, life: ServiceLife) -> PageServices:
        self._lives[life.service] = life
        return PageServices(tuple(self._lives.values()))
