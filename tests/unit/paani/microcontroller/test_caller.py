"""Calls over sockets and pseudo-terminals of the test."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from paani.clock import process_cpu_s, stopwatch_ms
from paani.messages import Direction, McuState, McuVerdict
from paani.microcontroller import caller as caller_module
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.payloads import INDICATION, THRUST, Guide, McuStatus, append_crc
from paani.microcontroller.rpc import Request, Response, encode_response
from tests.at_work import at_work
from tests.conftest import find_free_port
from tests.mcu_peer import McuPeer, PtyLine, boot_messages, notification, served, tcp_line, until

GUIDE = Guide(direction=Direction.LEFT, session=7, seq=1, lease_ms=700).encode()


@contextlib.asynccontextmanager
async def running(address: str) -> AsyncIterator[McuCaller]:
    caller = McuCaller(address, INDICATION)
    async with at_work(caller.run()):
        yield caller


@contextlib.asynccontextmanager
async def connected(peer: McuPeer) -> AsyncIterator[McuCaller]:
    async with tcp_line(peer) as address, running(address) as caller:
        await until(lambda: caller.is_connected)
        yield caller


async def test_a_call_is_answered_with_the_microcontrollers_status() -> None:
    peer = McuPeer()
    async with connected(peer) as caller:
        status = await caller.call("paani_guide", GUIDE)
    assert (status.state, status.display, status.seq) == (McuState.FRESH, Direction.LEFT, 1)
    assert caller.status == status
    assert peer.guides == [Guide.decode(GUIDE)]
    assert (caller.sent, caller.answered, caller.unanswered) == (1, 1, 0)
    assert 0.0 < caller.round_trip_ms(50) <= caller.round_trip_ms(95) < 250.0


async def test_a_call_without_payload_sends_none() -> None:
    peer = McuPeer()
    async with connected(peer) as caller:
        await caller.call("paani_status")
    assert peer.calls == [Request(1, "paani_status", ())]


@pytest.mark.slow
async def test_a_silent_microcontroller_costs_a_quarter_of_a_second_and_is_named() -> None:
    peer = McuPeer()
    peer.answers = lambda request: b""
    async with connected(peer) as caller:
        for _ in range(4):
            started_ms = stopwatch_ms()
            with pytest.raises(CallError, match="no answer"):
                await caller.call("paani_guide", GUIDE)
            assert 200.0 < stopwatch_ms() - started_ms < 600.0
        assert caller.problem == f"{caller.address}: no answer from the microcontroller"
        assert caller.unanswered == 4
        peer.answers = peer.answer
        await caller.call("paani_guide", GUIDE)
        assert caller.problem == ""


@pytest.mark.slow
async def test_what_speaks_another_protocol_is_named() -> None:
    peer = McuPeer()
    peer.answers = lambda request: b"$GPGGA,092750.000,5321.6802,N\r\n"
    async with connected(peer) as caller:
        for _ in range(4):
            with pytest.raises(CallError):
                await caller.call("paani_guide", GUIDE)
        assert caller.problem == f"{caller.address}: speaks another protocol"
        assert caller.junk_bytes > 60


async def test_another_version_of_the_protocol_is_named() -> None:
    peer = McuPeer()
    peer.answers = lambda request: encode_response(request.id, append_crc(b"\x09" + peer.status().encode()[1:-2]))
    async with connected(peer) as caller:
        with pytest.raises(CallError, match="version 9"):
            await caller.call("paani_guide", GUIDE)
        assert caller.problem == f"{caller.address}: speaks version 9 of the protocol, expected 1"


async def test_the_line_of_the_thrusters_is_not_taken_for_ours() -> None:
    peer = McuPeer()
    peer.answers = lambda request: encode_response(request.id, McuStatus(kind=THRUST, state=McuState.BOOT).encode())
    async with connected(peer) as caller:
        with pytest.raises(CallError, match="another kind"):
            await caller.call("paani_guide", GUIDE)
        assert caller.status is None


@pytest.mark.parametrize(
    ("verdict", "problem"),
    [
        (McuVerdict.FOREIGN_SESSION, "second session refused: session 99 holds the microcontroller"),
        (McuVerdict.EXPIRED, "refused: expired"),
    ],
)
async def test_a_refusal_is_named(verdict: McuVerdict, problem: str) -> None:
    peer = McuPeer()
    peer.verdict, peer.session = verdict, 99
    async with connected(peer) as caller:
        assert (await caller.call("paani_guide", GUIDE)).verdict is verdict
        assert caller.problem == f"{caller.address}: {problem}"


@pytest.mark.slow
async def test_one_call_is_outstanding_at_a_time() -> None:
    peer = McuPeer()
    peer.delay_s = 0.02
    async with connected(peer) as caller, asyncio.TaskGroup() as calls:
        for _ in range(4):
            calls.create_task(caller.call("paani_guide", GUIDE))
        await until(lambda: len(peer.calls) == 1)
        await asyncio.sleep(0.005)
        assert len(peer.calls) == 1
    assert [call.id for call in peer.calls if isinstance(call, Request)] == [1, 2, 3, 4]


@pytest.mark.slow
async def test_an_answer_that_comes_late_answers_no_other_call() -> None:
    peer = McuPeer()
    held: list[bytes] = []

    def hold_first(request: Request) -> bytes:
        answer = peer.answer(request)
        if request.id == 1:
            held.append(answer)
            return b""
        return held.pop() + answer

    peer.answers = hold_first
    async with connected(peer) as caller:
        with pytest.raises(CallError):
            await caller.call("paani_guide", GUIDE)
        second = Guide(direction=Direction.RIGHT, session=7, seq=2, lease_ms=700)
        assert (await caller.call("paani_guide", second.encode())).seq == 2
        assert caller.late == 1


async def test_on_a_bare_line_the_microcontroller_is_answered_as_the_router_would() -> None:
    peer = McuPeer()
    peer.answers = lambda request: boot_messages() + peer.answer(request)
    async with connected(peer) as caller:
        await caller.call("paani_guide", GUIDE)
        await until(lambda: len(peer.responses) == 2)
    assert peer.responses == [Response(1, "", 0, True), Response(2, "", 0, True)]


@pytest.mark.slow
async def test_a_change_of_state_is_heard_without_a_call_and_an_older_one_changes_nothing() -> None:
    peer = McuPeer()
    changes = [
        peer.status(state=McuState.STALE, mcu_ms=5000),
        peer.status(state=McuState.FRESH, mcu_ms=4990),  # the router delivers out of order
        peer.status(kind=THRUST, state=McuState.SAFE, mcu_ms=6000, display=Direction.NO_DATA),
    ]
    peer.answers = lambda request: b"".join(map(notification, changes))
    heard: list[McuStatus] = []
    async with connected(peer) as caller:
        caller.on_status = heard.append
        with pytest.raises(CallError):
            await caller.call("paani_guide", GUIDE)
        assert caller.status == changes[0]
    assert heard == changes[:1]


@pytest.mark.slow
async def test_a_device_that_was_pulled_out_is_named_and_used_again_when_it_is_back(tmp_path: Path) -> None:
    peer = McuPeer()
    line = PtyLine(str(tmp_path / "tty"), peer)
    line.plug_in()
    try:
        async with running(line.address) as caller:
            await until(lambda: caller.is_connected)
            await caller.call("paani_guide", GUIDE)
            line.pull_out()
            await until(lambda: not caller.is_connected)
            assert caller.problem == f"{line.address}: vanished"
            with pytest.raises(CallError, match="vanished"):
                await caller.call("paani_guide", GUIDE)
            await until(lambda: "No such file" in caller.problem)
            line.plug_in()
            await until(lambda: caller.is_connected)
            await caller.call("paani_guide", GUIDE)
            assert (caller.problem, caller.connections) == ("", 2)
    finally:
        line.pull_out()


async def test_a_line_that_breaks_during_a_call_ends_it_at_once() -> None:
    peer = McuPeer()
    peer.delay_s = 10.0
    async with connected(peer) as caller:

        async def close() -> None:
            await until(lambda: bool(peer.calls))
            assert caller._port is not None
            await caller._port.close()

        with pytest.raises(CallError, match="closed"):
            await asyncio.gather(caller.call("paani_guide", GUIDE), close())


@pytest.mark.slow
async def test_a_line_that_is_not_to_be_had_is_tried_again_without_haste() -> None:
    before_s = process_cpu_s()
    async with running(f"socket://127.0.0.1:{find_free_port()}") as caller:
        await until(lambda: "Connection refused" in caller.problem)
        with pytest.raises(CallError, match="Connection refused"):
            await caller.call("paani_status")
        await asyncio.sleep(0.5)
    assert process_cpu_s() - before_s < 0.2


@pytest.mark.slow
async def test_a_babbling_line_costs_bounded_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """As fast as the socket takes it, which is thousands of times what a serial line carries."""
    monkeypatch.setattr(caller_module, "BABBLE_PAUSE_S", 0.1)
    block = bytes(range(256)) * 256

    async def babble(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                writer.write(block)
                await writer.drain()

    async with served(babble) as port, running(f"socket://127.0.0.1:{port}") as caller:
        await until(lambda: caller.junk_bytes > 0)
        before_s = process_cpu_s()
        started_ms = stopwatch_ms()
        await asyncio.sleep(1.0)
        load = (process_cpu_s() - before_s) / (stopwatch_ms() - started_ms) * 1000
    assert load < 0.5
