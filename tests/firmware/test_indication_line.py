"""Guidance over the wire to an emulated Cortex-M33. Real lights and the board's own serial line need the board."""

from __future__ import annotations

import asyncio
import random

import pytest

from paani.messages import Direction, McuState, McuVerdict, ResetCause
from paani.microcontroller.payloads import INDICATION, Guide, McuStatus, append_crc
from paani.microcontroller.rpc import encode_notification, encode_request
from paani.serial_port import Port
from tests.firmware.conftest import open_caller
from tests.firmware.emulator import Emulator, open_emulator
from tests.firmware.streams import corrupted, open_stream, wait_for_answer

pytestmark = pytest.mark.firmware


def guide(
    seq: int, direction: Direction = Direction.LEFT, session: int = 7, lease_ms: int = 500, age_ms: int = 0
) -> Guide:
    return Guide(direction=direction, session=session, seq=seq, lease_ms=lease_ms, age_ms=age_ms)


async def test_o3_advice_is_shown_and_becomes_stop_when_its_lease_is_over(mcu: Emulator) -> None:
    """O3 and A1 as far as an emulated core proves them: its picture in memory, judged on its own milliseconds."""
    async with open_caller(mcu.guide, INDICATION) as caller:
        changes = list[McuStatus]()
        caller.on_status = changes.append
        accepted = await caller.call("paani_guide", guide(1, lease_ms=500, age_ms=100).encode())
        assert (accepted.verdict, accepted.state, accepted.boot_count) == (McuVerdict.ACCEPTED, McuState.FRESH, 1)
        assert accepted.reset_cause is ResetCause.POWER_ON
        assert (await mcu.read_lights())[2][:7] == "7777777"
        async with asyncio.timeout(10):
            while not changes or changes[-1].state is not McuState.SAFE:
                await asyncio.sleep(0.01)
        stale, safe = changes[-2:]
        assert stale.state is McuState.STALE
        assert stale.display is Direction.STOP
        assert 400 <= stale.mcu_ms - accepted.mcu_ms <= 402
        assert 1000 <= safe.mcu_ms - stale.mcu_ms <= 1002
        status = await caller.call("paani_status")
        assert (status.verdict, status.display) == (McuVerdict.NONE, Direction.STOP)


REFUSALS = {
    "crc": guide(9).encode()[:-1] + b"\0",
    "version": append_crc(b"\x02" + guide(9).encode()[1:-2]),
    "range": append_crc(b"\x01\x07" + guide(9).encode()[2:-2]),
    "replayed": guide(5).encode(),
    "foreign_session": guide(9, session=8).encode(),
    "expired": guide(9, lease_ms=4000, age_ms=4000).encode(),
    "lease": append_crc(guide(9).encode()[:8] + b"\x31\x00" + guide(9).encode()[10:-2]),
    "framing": guide(9).encode() + b"\0\0",
}


async def test_every_refusal_is_counted_by_its_cause(mcu: Emulator) -> None:
    """Corrupt, of another version, out of range, replayed, of a second session, expired, oversized, cut off."""
    async with open_caller(mcu.guide, INDICATION) as caller:
        accepted = await caller.call("paani_guide", guide(6, Direction.RIGHT, lease_ms=4000).encode())
        for name, payload in REFUSALS.items():
            before = (await caller.call("paani_status")).refusals
            status = await caller.call("paani_guide", payload)
            after = status.refusals
            changed = {field: getattr(after, field) - getattr(before, field) for field in after.__struct_fields__}
            assert {field: count for field, count in changed.items() if count} == {name: 1}
            assert (status.accepted, status.seq, status.display) == (1, accepted.seq, Direction.RIGHT)
    port = await open_stream(mcu.guide)
    await port.write(encode_notification("paani_guide", guide(9).encode())[:-5])
    await asyncio.sleep(0.5)  # what is cut off by silence is so after 100 ms
    await port.close()
    async with open_caller(mcu.guide, INDICATION) as caller:
        assert (await caller.call("paani_status")).refusals.framing == 2


async def test_corrupted_frames_are_never_acted_on_and_hide_no_good_one(mcu: Emulator) -> None:
    """The larger run is that of the same core in tests/unit/mcu."""
    rng = random.Random(5)
    async with open_caller(mcu.guide, INDICATION) as caller:
        await caller.call("paani_guide", guide(1, Direction.STRAIGHT, lease_ms=4000).encode())
    port: Port = await open_stream(mcu.guide)
    good = 0
    for seq in range(2, 202):
        call = encode_request(seq, "paani_guide", guide(seq, Direction.STRAIGHT, lease_ms=4000).encode())
        # What a damaged frame asks for differs from what every good one does.
        damaged = corrupted(encode_request(seq, "paani_guide", guide(seq, Direction.RIGHT).encode()), rng)
        await port.write(damaged + call)
        good += 1
        await wait_for_answer(port, seq)
    await port.close()
    async with open_caller(mcu.guide, INDICATION) as caller:
        status = await caller.call("paani_status")
    assert (status.display, status.accepted, status.seq) == (Direction.STRAIGHT, 1 + good, 201)
    assert sum(getattr(status.refusals, name) for name in ("crc", "framing")) > 100


async def test_a_second_bridge_is_refused_until_the_lease_of_the_first_is_over(mcu: Emulator) -> None:
    async with open_caller(mcu.guide, INDICATION) as caller:
        await caller.call("paani_guide", guide(1, lease_ms=300).encode())
        second = guide(1, Direction.RIGHT, session=8).encode()
        assert (await caller.call("paani_guide", second)).verdict is McuVerdict.FOREIGN_SESSION
        async with asyncio.timeout(10):
            while (status := await caller.call("paani_guide", second)).verdict is not McuVerdict.ACCEPTED:
                await asyncio.sleep(0.02)
        assert (status.session, status.display) == (8, Direction.RIGHT)


async def test_o4_the_papers_image_reports_no_loss_before_a_stream() -> None:
    """O4 on an emulated core: nothing is lost before the first frame; then 1000 ms of its own clock."""
    async with open_emulator(paper=True) as mcu, open_caller(mcu.guide, INDICATION) as caller:
        await mcu.wait_for_pins(lambda pins: pins.mcu_ms > 2500)
        assert (await caller.call("paani_status")).state is McuState.BOOT
        changes = list[McuStatus]()
        caller.on_status = changes.append
        accepted = await caller.call("paani_guide", guide(1, lease_ms=100).encode())
        async with asyncio.timeout(10):
            while not changes or changes[-1].state is not McuState.STALE:
                await asyncio.sleep(0.01)
        assert 1000 <= changes[-1].mcu_ms - accepted.mcu_ms <= 1002
