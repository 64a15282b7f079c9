"""A loop that hangs: still within the longest lease, then reset. The watchdog of the real chip needs the board."""

from __future__ import annotations

import asyncio

import pytest

from paani.messages import Direction, McuState, McuVerdict, ResetCause
from paani.microcontroller.caller import CallError, McuCaller
from paani.microcontroller.payloads import INDICATION, THRUST, EscSettings, Guide, McuStatus, ThrustCall
from tests.firmware.conftest import open_caller
from tests.firmware.emulator import Emulator

pytestmark = pytest.mark.firmware

GUIDE = Guide(direction=Direction.LEFT, session=7, seq=1, lease_ms=4000).encode()


async def wait_for_boot(caller: McuCaller, count: int) -> McuStatus:
    async with asyncio.timeout(20):
        while True:
            try:
                status = await caller.call("paani_status")
            except CallError:
                continue
            if status.boot_count == count:
                return status
            await asyncio.sleep(0.02)


async def test_a_hang_stops_the_boat_within_a_lease_and_is_reset(mcu: Emulator) -> None:
    async with open_caller(mcu.guide, INDICATION) as guidance, open_caller(mcu.thrust, THRUST) as thrust:
        await guidance.call("paani_guide", GUIDE)
        await thrust.call("paani_esc", EscSettings(session=9, slew_per_s=10.0).encode())
        for seq in range(1, 5):
            call = ThrustCall(armed=seq > 1, session=9, seq=seq, lease_ms=300, left=1.0, right=1.0)
            assert (await thrust.call("paani_thrust", call.encode())).verdict is McuVerdict.ACCEPTED
            await asyncio.sleep(0.05)
        await mcu.wait_for_pins(lambda pins: pins.enable)
        await mcu.set_pins("hang")
        before = await wait_for_boot(guidance, 2)
        assert (before.reset_cause, before.accepted, before.session) == (ResetCause.WATCHDOG, 0, 0)
        restarted = next(i for i, pins in enumerate(mcu.history) if i and pins.mcu_ms < mcu.history[i - 1].mcu_ms)
        assert mcu.history[restarted].enable is False
        assert (await guidance.call("paani_guide", GUIDE)).state is McuState.FRESH
        # Thrust needs its settings and its arming anew.
        again = ThrustCall(armed=True, session=9, seq=9, lease_ms=300, left=1.0, right=1.0).encode()
        assert (await thrust.call("paani_thrust", again)).verdict is McuVerdict.NOT_CONFIGURED
        assert await mcu.read_timers() == (1500, 1500, False)


async def test_the_outputs_are_safe_before_the_reset(mcu: Emulator) -> None:
    """The watchdog's first expiry, which nothing masks, makes the registers safe while the loop still hangs."""
    async with open_caller(mcu.thrust, THRUST) as thrust:
        await thrust.call("paani_esc", EscSettings(session=9, slew_per_s=10.0).encode())
        for seq in range(1, 5):
            call = ThrustCall(armed=seq > 1, session=9, seq=seq, lease_ms=300, left=1.0, right=1.0)
            await thrust.call("paani_thrust", call.encode())
        await mcu.wait_for_pins(lambda pins: pins.enable and pins.left_us > 1600)
        await mcu.set_pins("hang")
        seen: list[tuple[int, int, bool]] = []
        async with asyncio.timeout(20):
            while not seen or seen[-1] != (1500, 1500, False):
                seen.append(await mcu.read_timers())
        times_ms = [pins.mcu_ms for pins in mcu.history]
        assert times_ms == sorted(times_ms), "this is the state after the reset"
        status = await wait_for_boot(thrust, 2)
        assert status.reset_cause is ResetCause.WATCHDOG


async def drive(thrust: McuCaller, mcu: Emulator) -> None:
    """Until the outputs are live."""
    await thrust.call("paani_esc", EscSettings(session=9, slew_per_s=10.0).encode())
    for seq in range(1, 5):
        call = ThrustCall(armed=seq > 1, session=9, seq=seq, lease_ms=300, left=1.0, right=1.0)
        await thrust.call("paani_thrust", call.encode())
    await mcu.wait_for_pins(lambda pins: pins.enable)


async def test_a_loop_that_stood_still_is_stopped_meanwhile_and_goes_on_disarmed(mcu: Emulator) -> None:
    """The timer's interrupt sees it after 50 ms; what the loop had decided before it stood still moves nothing."""
    async with open_caller(mcu.thrust, THRUST) as thrust:
        await drive(thrust, mcu)
        begin = len(mcu.history)
        await mcu.set_pins("stall 100")
        await mcu.wait_for_pins(lambda pins: not pins.enable)
        call = ThrustCall(armed=True, session=9, seq=5, lease_ms=300, left=1.0, right=1.0)
        status = await thrust.call("paani_thrust", call.encode())
        assert (status.verdict, status.holds, status.boot_count) == (McuVerdict.ACCEPTED, 16, 1)
        live = [pins.enable for pins in mcu.history[begin:]]
        assert live == sorted(live, reverse=True), "it was live again"
        still = next(pins for pins in mcu.history[begin:] if not pins.enable)
        assert still[:2] == (1500, 1500)


async def test_a_loop_that_stands_still_is_reset_though_interrupts_go_on(mcu: Emulator) -> None:
    async with open_caller(mcu.thrust, THRUST) as thrust:
        await drive(thrust, mcu)
        await mcu.set_pins("stall 5000")
        status = await wait_for_boot(thrust, 2)
        assert (status.reset_cause, status.enabled) == (ResetCause.WATCHDOG, False)


async def test_a_reset_by_the_button_is_told_from_one_by_the_watchdog(mcu: Emulator) -> None:
    async with open_caller(mcu.guide, INDICATION) as guidance:
        await mcu.reset()
        status = await wait_for_boot(guidance, 2)
        assert (status.reset_cause, status.state) == (ResetCause.PIN, McuState.BOOT)
