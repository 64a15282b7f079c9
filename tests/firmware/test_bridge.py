"""The bridge and the firmware: what is advised on the bus is on the lights, and nothing that breaks leaves an arrow."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path

import pytest

from paani import messages as m
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import INDICATION, Guide
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn
from tests.fake_router import FakeRouter
from tests.firmware.emulator import open_emulator
from tests.firmware.line_listener import listening_on, pipe_to_router
from tests.integration.test_bridge import bridge
from tests.mcu_peer import McuPeer, PtyLine, until

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]
ARROW_COLUMNS = 7  # of the thirteen; the risk bars are beside them
NOBODY = McuPeer()  # where the emulator is the peer


def arrow(lights: list[str]) -> list[str]:
    return [row[:ARROW_COLUMNS] for row in lights]


@pytest.mark.parametrize("pty", [False, True], ids=["tcp", "pty"])
async def test_the_advice_on_the_bus_is_on_the_lights(pty: bool, spawn: Spawn, open_as: OpenAs) -> None:
    """O3: each direction has a picture of its own; those to the sides are mirrored; the bars are the risks."""
    async with open_emulator(pty=pty) as mcu, bridge(spawn, open_as, mcu.guide, NOBODY) as loop:
        lights = {}
        for direction in m.Direction:
            loop.advisor.direction = direction
            await loop.state(lambda state, sent=direction: state.display is sent)  # type: ignore[misc]  # of a default
            lights[direction] = await mcu.read_lights()
            assert mcu.pins.enable is False  # O5: the lights move nothing
    pictures = {direction: arrow(rows) for direction, rows in lights.items()}
    assert len({tuple(picture) for picture in pictures.values()}) == len(m.Direction)
    for left, right in ((m.Direction.LEFT, m.Direction.RIGHT), (m.Direction.SLIGHT_LEFT, m.Direction.SLIGHT_RIGHT)):
        assert [row[::-1] for row in pictures[left]] == pictures[right]
    risks = lights[m.Direction.LEFT]
    assert all(row[ARROW_COLUMNS + 1] == row[ARROW_COLUMNS + 3] == row[ARROW_COLUMNS + 5] != "0" for row in risks)


async def test_a_cable_pulled_out_during_a_turn_is_stop_and_the_arrow_comes_back(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    async with open_emulator() as mcu, listening_on(mcu.guide) as listener:
        relay = Relay()
        cable = PtyLine(str(tmp_path / "tty"), relay)
        await relay.connect(listener.address, cable)
        cable.plug_in()
        async with bridge(spawn, open_as, cable.address, NOBODY) as loop:
            loop.advisor.direction = m.Direction.LEFT
            await loop.state(lambda state: state.display is m.Direction.LEFT)
            pulled_out = await mcu.wait_for_pins(lambda pins: True)
            cable.pull_out()
            await until(lambda: listener.state is m.McuState.STALE)
            stopped = next(status for status in listener.statuses if status.state is m.McuState.STALE)
            assert stopped.display is m.Direction.STOP
            assert 0 < stopped.mcu_ms - pulled_out.mcu_ms <= 800  # the lease and 100 ms
            await until(lambda: listener.state is m.McuState.SAFE)
            assert listener.display is m.Direction.STOP
            await asyncio.sleep(0.5)
            cable.plug_in()
            back = await loop.state(lambda state: state.display is m.Direction.LEFT)
            assert (back.mcu, back.problem, back.boot_count) == (m.McuState.FRESH, "", 1)
        cable.pull_out()
        await relay.close()


@pytest.mark.parametrize("how", ["hangs", "is reset"])
async def test_a_microcontroller_that_starts_again_shows_the_advice_again(
    how: str, spawn: Spawn, open_as: OpenAs
) -> None:
    """A hanging loop feeds no watchdog."""
    async with open_emulator() as mcu, bridge(spawn, open_as, mcu.guide, NOBODY) as loop:
        loop.advisor.direction = m.Direction.RIGHT
        before = await loop.state(lambda state: state.display is m.Direction.RIGHT)
        await (mcu.set_pins("hang") if how == "hangs" else mcu.reset())
        after = await loop.state(lambda state: state.boot_count == 2 and state.display is m.Direction.RIGHT)
        assert after.session != before.session
        assert after.reset_cause is (m.ResetCause.WATCHDOG if how == "hangs" else m.ResetCause.PIN)
        report = await loop.health(lambda health: bool(health.drops))
        assert "microcontroller_restarted" in {drop.cause for drop in report.drops}


async def test_behind_the_router_a_restart_of_it_ends_and_a_second_session_is_refused(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    """The firmware registers by itself, and again with a router that knows nothing of it."""
    path = tmp_path / "router.sock"
    router = FakeRouter(path, random.Random(1))
    await router.start()
    async with (
        open_emulator() as mcu,
        at_work(pipe_to_router(mcu.guide, path)),
        bridge(spawn, open_as, f"unix:{path}", NOBODY) as loop,
    ):
        loop.advisor.direction = m.Direction.LEFT
        await loop.state(lambda state: state.display is m.Direction.LEFT, 30.0)
        assert {"paani_guide", "paani_mcu"} <= router.routes

        second = McuCaller(f"unix:{path}", INDICATION)
        async with at_work(second.run()):
            await until(lambda: second.is_connected)
            other = Guide(direction=m.Direction.RIGHT, session=1, seq=1, lease_ms=700)
            status = await second.call("paani_guide", other.encode())
            assert (status.verdict, status.display) == (m.McuVerdict.FOREIGN_SESSION, m.Direction.LEFT)
            assert "second session refused" in second.problem

        await router.stop()
        await loop.state(lambda state: not state.connected)
        await router.start()
        await loop.state(lambda state: state.display is m.Direction.LEFT, 40.0)
    await router.stop()


class Relay(McuPeer):
    """Bytes of a cable's end to the emulator, and back."""

    def __init__(self) -> None:
        super().__init__()
        self._stream: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._copying: asyncio.Task[None] | None = None

    async def connect(self, address: str, cable: PtyLine) -> None:
        host, _, port = address.removeprefix("socket://").rpartition(":")
        self._stream = await asyncio.open_connection(host, int(port))
        self._copying = asyncio.create_task(self._copy(cable))

    def take(self, data: bytes) -> list[bytes]:
        assert self._stream is not None
        self._stream[1].write(data)
        return []

    async def close(self) -> None:
        assert self._stream is not None
        assert self._copying is not None
        self._copying.cancel()
        await asyncio.gather(self._copying, return_exceptions=True)
        self._stream[1].close()

    async def _copy(self, cable: PtyLine) -> None:
        assert self._stream is not None
        while data := await self._stream[0].read(4096):
            cable.send(data)
