"""Build 6: whoever does not go by the router reaches no process, and no process reaches him."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus
from paani.clock import WallClock
from paani.config import Config
from tests.bus_peers import until
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.integration.authority_matrix import bus_in
from tests.integration.direct_peers import Stranger, connections_to, scouted, stranger
from tests.integration.exposure import listening

pytestmark = pytest.mark.integration
SCOUTING_S = 1.0  # a peer of Zenoh's own settings is found within a tenth of it
TIMES = 20


@pytest.fixture(params=[False, True], ids=["password", "certificate"])
def private_sets(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, ...]:
    bus = bus_in(tmp_path / "bus", keys.Graph.SIMULATION, by_certificate=request.param)
    certificates = (f"bus.certificates={bus.certificates}",) if request.param else ()
    return (
        f"bus.router={bus.router}",
        f"bus.runtime_dir={bus.runtime_dir}",
        f"dashboard.port={find_free_port()}",
        *certificates,
    )


async def test_a_stranger_reaches_no_process(spawn: Spawn, open_as: OpenAs, config: Config) -> None:
    """A peer that scouts, gossips and waits for others, beside another one that it finds at once."""
    async with (
        spawn("controller") as process,
        stranger(config.bus, None) as peer,
        stranger(config.bus, None) as other,
    ):
        await until(lambda: other.id in peer.peers())  # who can be found is found
        assert await asyncio.to_thread(scouted, SCOUTING_S) == {peer.id, other.id}
        await require_unreached(process.pid, peer, open_as)
        assert connections_to(process.pid, other.port) == 0
        assert peer.peers() == {other.id}
        assert peer.heard == []
        assert set(other.heard) == {keys.COMMAND.name}  # the forged ones: who is connected hears them


async def test_an_observer_reaches_no_process_but_by_the_router(spawn: Spawn, open_as: OpenAs, config: Config) -> None:
    """The same with credentials that let it in at the router, which tells it of nobody, and nobody of it."""
    async with spawn("controller") as process, stranger(config.bus, OBSERVER) as peer:
        await until(lambda: bool(peer.routers()) and bool(peer.heard))
        assert await asyncio.to_thread(scouted, SCOUTING_S) <= {peer.id}
        await require_unreached(process.pid, peer, open_as)
        assert peer.peers() == set()


async def require_unreached(pid: int, peer: Stranger, open_as: OpenAs) -> None:
    """The controller has no session with the peer, and hears no order of it; it does hear the navigator's."""
    navigator, observer = await open_as("navigator"), await open_as("observer")
    command = m.NavCommand(source_us=WallClock().now_us(), enable=False, heading_rad=0.0, speed_mps=0.0)
    orders = observer.latest(keys.COMMAND)
    await forge(peer, command)
    assert connections_to(pid, peer.port) == 0
    assert listening(pid) == set()
    assert await commands_heard(observer) == 0
    assert orders.received == 0
    publisher = navigator.publisher(keys.COMMAND)
    await until(lambda: orders.received > 0, lambda: publisher.put(command))
    assert await commands_heard(observer) > 0


async def forge(peer: Stranger, command: m.NavCommand) -> None:
    """Orders of the navigator, as it would say them."""
    for seq in range(TIMES):
        now_us = WallClock().now_us()
        forged = msgspec.structs.replace(
            command,
            source_us=now_us,
            sent_us=now_us,
            seq=seq,
            epoch=now_us // 1000,
            producer="navigator",
            topic=keys.COMMAND.name,
        )
        await asyncio.to_thread(peer.say, keys.COMMAND.name, msgspec.json.encode(forged))
        await asyncio.sleep(0.02)


async def commands_heard(observer: Bus) -> int:
    """How many the controller says that it has heard, by a report of after this call."""
    reports = observer.queue(keys.health("controller"))
    health = await reports.get()
    return next(each.received for each in health.inputs if each.topic == keys.COMMAND.name)
