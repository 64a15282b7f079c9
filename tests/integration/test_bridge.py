"""The bridge as a process, on a real bus, with a microcontroller's stand-in behind each kind of line."""

from __future__ import annotations

import asyncio
import contextlib
import random
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TypeVar

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, Publisher, Queue
from paani.clock import WallClock
from paani.config import BridgeConfig
from paani.microcontroller.payloads import UNKNOWN_RISK, Guide
from paani.microcontroller.rpc import MessageScanner, Request, Response
from paani_services.bridge.service import Bridge
from paani_services.bridge.symbols import REASON_CODES
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn
from tests.fake_router import FakeRouter
from tests.mcu_peer import McuPeer, PtyLine, notification, run_sketch, served, tcp_line, until

pytestmark = pytest.mark.integration
CLOCK = WallClock()


class Advisor:
    """Publishes an advisory at 5 Hz, as the advisor does, until told otherwise."""

    def __init__(self, bus: Bus) -> None:
        self._publisher: Publisher[m.Advisory] = bus.publisher(keys.ADVISORY)
        self.direction: m.Direction | None = None

    def put(self, direction: m.Direction) -> None:
        self._publisher.put(m.Advisory(source_us=CLOCK.now_us(), direction=direction, reason=m.Reason.CENTER_RISK))

    async def run(self) -> None:
        while True:
            if self.direction is not None:
                self.put(self.direction)
            await asyncio.sleep(0.2)


class Loop:
    """A running bridge: what its microcontroller is sent, and what it says of itself."""

    def __init__(self, peer: McuPeer, advisor: Advisor, states: Queue[m.BridgeState], health: Queue[m.Health]) -> None:
        self.peer, self.advisor, self._states, self._health = peer, advisor, states, health

    async def state(self, condition: Callable[[m.BridgeState], bool], seconds: float = 10.0) -> m.BridgeState:
        """The next state for which the condition holds."""
        return await newest(self._states, condition, seconds)

    async def health(self, condition: Callable[[m.Health], bool]) -> m.Health:
        return await newest(self._health, condition, 10.0)


T = TypeVar("T")


async def newest(queue: Queue[T], condition: Callable[[T], bool], seconds: float) -> T:
    async with asyncio.timeout(seconds):
        while True:
            value = await queue.get()
            if condition(value):
                return value


@contextlib.asynccontextmanager
async def bridge(spawn: Spawn, open_as: OpenAs, line: str, peer: McuPeer, *sets: str) -> AsyncIterator[Loop]:
    advisor = Advisor(await open_as("advisor"))
    observer = await open_as("observer")
    states, health = observer.queue(keys.BRIDGE_STATE, 500), observer.queue(keys.health("bridge"))
    async with at_work(advisor.run()), spawn("bridge", f"bridge.line={line}", *sets):
        yield Loop(peer, advisor, states, health)


@contextlib.asynccontextmanager
async def routed(path: Path, peer: McuPeer) -> AsyncIterator[FakeRouter]:
    router = FakeRouter(path, random.Random(1))
    await router.start()
    try:
        async with at_work(run_sketch(path, peer)):
            await until(lambda: "paani_guide" in router.routes)
            yield router
    finally:
        await router.stop()


@contextlib.asynccontextmanager
async def plugged_in(path: Path, peer: McuPeer) -> AsyncIterator[PtyLine]:
    line = PtyLine(str(path), peer)
    line.plug_in()
    yield line
    line.pull_out()


@contextlib.asynccontextmanager
async def line_of(kind: str, folder: Path, peer: McuPeer) -> AsyncIterator[str]:
    match kind:
        case "socket":
            async with tcp_line(peer) as address:
                yield address
        case "serial":
            async with plugged_in(folder / "tty", peer) as line:
                yield line.address
        case _:
            async with routed(folder / "router.sock", peer):
                yield f"unix:{folder / 'router.sock'}"


@pytest.mark.parametrize("kind", ["socket", "serial", "unix"])
async def test_the_advice_is_shown_at_a_steady_rate(kind: str, spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """A4: over each kind of line, and from the first moment: NO_DATA before any advice."""
    peer = McuPeer()
    async with line_of(kind, tmp_path, peer) as line, bridge(spawn, open_as, line, peer) as loop:
        await until(lambda: len(peer.guides) > 3)
        assert {guide.direction for guide in peer.guides} == {m.Direction.NO_DATA}
        assert peer.guides[0].risks == (UNKNOWN_RISK,) * 3
        loop.advisor.direction = m.Direction.SLIGHT_RIGHT
        state = await loop.state(lambda state: state.display is m.Direction.SLIGHT_RIGHT)
        assert (state.line, state.connected, state.problem, state.mcu) == (line, True, "", m.McuState.FRESH)
        assert 0.0 < state.round_trip_p50_ms <= state.round_trip_p95_ms < 250.0
        assert state.session == peer.guides[-1].session

        before = len(peer.guides)
        await asyncio.sleep(2.0)
        assert 5 <= len(peer.guides) - before <= 24  # ten a second, on a machine with time for it
        assert [guide.seq for guide in peer.guides] == list(range(1, len(peer.guides) + 1))


async def test_a_change_of_advice_does_not_wait_for_the_next_frame(open_as: OpenAs) -> None:
    """At a frame in ten seconds, which no setting allows."""
    peer, advisor = McuPeer(), Advisor(await open_as("advisor"))
    async with tcp_line(peer) as line:
        bridge = Bridge(await open_as("bridge"), CLOCK, BridgeConfig(line=line, rate_hz=0.1))
        async with at_work(bridge.caller.run()):
            await until(lambda: bridge.caller.is_connected)
            async with at_work(bridge.show_advice()):
                await until(lambda: bool(peer.guides))
                for direction in (m.Direction.STOP, m.Direction.LEFT, m.Direction.STOP):
                    advisor.put(direction)
                    async with asyncio.timeout(5.0):
                        await until(lambda direction=direction: peer.guides[-1].direction is direction)  # type: ignore[misc]  # of a default
                assert len(peer.guides) == 4


@pytest.mark.parametrize("direction", [m.Direction.LEFT, m.Direction.NO_DATA])
async def test_a_silent_advisor_is_stop_and_the_frames_go_on(
    direction: m.Direction, spawn: Spawn, open_as: OpenAs
) -> None:
    peer = McuPeer()
    async with tcp_line(peer) as line, bridge(spawn, open_as, line, peer) as loop:
        loop.advisor.direction = direction
        await until(lambda: bool(peer.guides) and peer.guides[-1].reason == REASON_CODES[m.Reason.CENTER_RISK])
        assert peer.guides[-1].direction is direction
        loop.advisor.direction = None
        await until(lambda: peer.guides[-1].direction is m.Direction.STOP)
        before = len(peer.guides)
        await asyncio.sleep(1.0)
        assert len(peer.guides) - before >= 3
        assert {(guide.direction, guide.reason) for guide in peer.guides[before:]} == {(m.Direction.STOP, 12)}


async def test_only_bounded_symbols_leave_by_the_line(spawn: Spawn, open_as: OpenAs) -> None:
    """A4 O5 B13: every byte that left is part of a call of `paani_guide` or of an answer to the microcontroller."""
    peer = McuPeer()
    peer.answers = lambda request: b"\x94\x00\x07\xa7$/reset\x90" + peer.answer(request)
    async with tcp_line(peer) as line, bridge(spawn, open_as, line, peer) as loop:
        for direction in m.Direction:
            loop.advisor.direction = direction
            await loop.state(lambda state, sent=direction: state.display is sent)  # type: ignore[misc]  # of a default
    scanner = MessageScanner()
    messages = scanner.feed(bytes(peer.received))
    assert scanner.junk_bytes == 0
    calls = [message for message in messages if isinstance(message, Request)]
    assert len(calls) > 7
    assert {call.method for call in calls} == {"paani_guide"}
    assert all(len(call.params) == 1 and Guide.decode(call.params[0]) is not None for call in calls)
    assert {message for message in messages if message not in calls} == {Response(7, "", 0, True)}


async def test_a_device_pulled_out_is_named_and_used_again_when_it_is_back(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    peer = McuPeer()
    async with plugged_in(tmp_path / "tty", peer) as line, bridge(spawn, open_as, line.address, peer) as loop:
        loop.advisor.direction = m.Direction.LEFT
        await loop.state(lambda state: state.display is m.Direction.LEFT)
        line.pull_out()
        gone = await loop.state(lambda state: not state.connected)
        assert gone.problem.startswith(f"{line.address}: ")
        assert (gone.mcu, gone.display) == (m.McuState.UNKNOWN, m.Direction.NO_DATA)
        report = await loop.health(lambda health: "tty" in health.note)
        assert report.note.startswith(f"{line.address}: ")
        line.plug_in()
        back = await loop.state(lambda state: state.display is m.Direction.LEFT)
        assert (back.problem, back.connections) == ("", 2)
        assert len({guide.session for guide in peer.guides}) == 1


async def test_a_router_that_restarts_is_used_again(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    peer, path = McuPeer(), tmp_path / "router.sock"
    async with routed(path, peer) as router, bridge(spawn, open_as, f"unix:{path}", peer) as loop:
        loop.advisor.direction = m.Direction.LEFT
        await loop.state(lambda state: state.display is m.Direction.LEFT)
        await router.stop()
        await loop.state(lambda state: not state.connected and str(path) in state.problem)
        await router.start()
        back = await loop.state(lambda state: state.display is m.Direction.LEFT)
        assert back.connections >= 2
        assert {"paani_guide", "paani_mcu"} <= router.routes


async def test_a_route_that_is_missing_is_named(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    router = FakeRouter(tmp_path / "router.sock", random.Random(1))
    await router.start()
    async with bridge(spawn, open_as, f"unix:{tmp_path / 'router.sock'}", McuPeer()) as loop:
        state = await loop.state(lambda state: "no route" in state.problem)
        assert state.problem.endswith("router.sock: the router has no route to the microcontroller")
        assert state.connected
    await router.stop()


async def test_notifications_out_of_order_are_no_restart(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    peer, path = McuPeer(), tmp_path / "router.sock"
    async with routed(path, peer) as router, bridge(spawn, open_as, f"unix:{path}", peer) as loop:
        await until(lambda: "paani_mcu" in router.routes and bool(peer.guides))
        for number in range(300):
            assert peer.writer is not None
            peer.writer.write(notification(peer.status(mcu_ms=peer.mcu_ms + number)))
            if number % 20 == 0:
                await asyncio.sleep(0.01)
        sent = len(peer.guides)
        await loop.state(lambda state: state.answered > sent + 5)
        assert len({guide.session for guide in peer.guides}) == 1


async def test_a_microcontroller_that_restarts_gets_another_session(spawn: Spawn, open_as: OpenAs) -> None:
    peer = McuPeer()
    async with tcp_line(peer) as line, bridge(spawn, open_as, line, peer) as loop:
        loop.advisor.direction = m.Direction.LEFT
        before = await loop.state(lambda state: state.display is m.Direction.LEFT)
        peer.reset()
        after = await loop.state(lambda state: state.boot_count == 2 and state.session != before.session)
        await until(lambda: peer.guides[-1].session == after.session)
        report = await loop.health(lambda health: bool(health.drops))
        assert {drop.cause: drop.count for drop in report.drops} == {"microcontroller_restarted": 1}


async def test_a_second_session_is_refused_and_named(spawn: Spawn, open_as: OpenAs) -> None:
    peer = McuPeer()
    peer.session, peer.verdict = 4711, m.McuVerdict.FOREIGN_SESSION
    async with tcp_line(peer) as line, bridge(spawn, open_as, line, peer) as loop:
        state = await loop.state(lambda state: bool(state.problem) and state.connected)
        assert state.problem == f"{line}: second session refused: session 4711 holds the microcontroller"
        assert state.verdict is m.McuVerdict.FOREIGN_SESSION
        report = await loop.health(lambda health: any(d.cause == "refused_foreign_session" for d in health.drops))
        assert report.note == state.problem


async def test_a_device_that_speaks_another_protocol_is_named(spawn: Spawn, open_as: OpenAs) -> None:
    """A GPS on the wrong line: it talks all the time, and answers nothing."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                writer.write(b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n")
                await asyncio.sleep(0.1)

    async with served(talk) as port, bridge(spawn, open_as, f"socket://127.0.0.1:{port}", McuPeer()) as loop:
        report = await loop.health(lambda health: "protocol" in health.note)
        assert report.note == f"socket://127.0.0.1:{port}: speaks another protocol"
        state = await loop.state(lambda state: state.junk_bytes > 500)
        assert (state.mcu, state.display, state.answered) == (m.McuState.UNKNOWN, m.Direction.NO_DATA, 0)
        assert report.cpu_cores < 0.5


@pytest.mark.parametrize(
    ("sets", "line"),
    [
        ([], "paani bridge: bridge.line: not set"),
        (["bridge.line=/dev/ttyACM0"], "bridge: '/dev/ttyACM0' is no port"),
        (["bridge.rate_hz=50"], "bridge.rate_hz"),
        (["bridge.lease_ms=0"], "bridge.lease_ms"),
    ],
)
async def test_a_wrong_setting_is_named_in_one_line(
    sets: list[str], line: str, open_as: OpenAs, private_sets: tuple[str, ...]
) -> None:
    arguments = [word for setting in (*private_sets, *sets) for word in ("--set", setting)]
    result = await asyncio.to_thread(
        subprocess.run, [sys.executable, "-m", "paani", "bridge", *arguments], capture_output=True, text=True
    )
    assert result.returncode == 2
    assert line in result.stderr
    assert len([text for text in result.stderr.splitlines() if "INFO" not in text]) == 1
