"""Thrust over the wire to an emulated Cortex-M33: pulse widths in its timers. Pins and motors need the board."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import pytest

from paani.messages import McuState, McuVerdict
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import THRUST, EscSettings, McuStatus, ThrustCall
from tests.at_work import at_work
from tests.firmware.conftest import open_caller
from tests.firmware.emulator import Emulator

pytestmark = pytest.mark.firmware

ESTOP, RECEIVER, BATTERY, CURRENT, NOT_ARMED = 1, 2, 4, 8, 16
SETTINGS = EscSettings(
    session=9, trim_left_us=20, deadband_right_us=50, slew_per_s=10.0, min_battery_v=10.0, max_current_a=30.0
)
NEUTRAL = (1520, 1500)
FULL = (1920, 1900)


class Boat:
    """Asks for thrust as a process of Linux does, every 50 ms while it drives."""

    def __init__(self, mcu: Emulator, caller: McuCaller) -> None:
        self.mcu, self.caller, self._seq = mcu, caller, 0
        self.left = self.right = 1.0

    async def ask(self, *, armed: bool = True, session: int = 9) -> McuStatus:
        self._seq += 1
        call = ThrustCall(armed=armed, session=session, seq=self._seq, lease_ms=300, left=self.left, right=self.right)
        return await self.caller.call("paani_thrust", call.encode())

    @contextlib.asynccontextmanager
    async def driving(self) -> AsyncIterator[None]:
        """Disarmed once, then armed and asking until the end."""

        async def drive() -> None:
            await self.ask(armed=False)
            while True:
                await self.ask()
                await asyncio.sleep(0.05)

        async with at_work(drive()):
            yield

    async def see(self, left_us: int, right_us: int, enable: bool) -> McuStatus:
        """Wait until the bench port, the status, and the registers behind the image's back all say this."""
        await self.mcu.wait_for_pins(lambda pins: pins[:3] == (left_us, right_us, enable))
        async with asyncio.timeout(10):
            while (status := await self.caller.call("paani_status")).pulse_left_us != left_us:
                await asyncio.sleep(0.01)
        assert (status.pulse_left_us, status.pulse_right_us, status.enabled) == (left_us, right_us, enable)
        assert await self.mcu.read_timers() == (left_us, right_us, enable)
        return status


@pytest.fixture
async def boat(mcu: Emulator) -> AsyncIterator[Boat]:
    await mcu.set_pins("battery 12000 0")
    async with open_caller(mcu.thrust, THRUST) as caller:
        assert (await caller.call("paani_esc", SETTINGS.encode())).verdict is McuVerdict.ACCEPTED
        yield Boat(mcu, caller)


async def test_pulses_are_in_the_timers_and_gone_when_the_lease_is_over(boat: Boat) -> None:
    await boat.see(*NEUTRAL, False)
    changes = list[McuStatus]()
    async with boat.driving():
        await boat.see(*FULL, True)
        boat.left, boat.right = 0.5, -0.5
        await boat.see(1520 + 200, 1500 - 50 - 175, True)
    newest = await boat.ask()
    boat.caller.on_status = changes.append
    await boat.see(*NEUTRAL, False)
    stale = next(status for status in changes if status.state is McuState.STALE)
    assert 300 <= stale.mcu_ms - newest.mcu_ms <= 302
    ended = next(pins for pins in boat.mcu.history if pins.mcu_ms > newest.mcu_ms and not pins.enable)
    assert 300 <= ended.mcu_ms - newest.mcu_ms <= 302


async def test_w9_the_stop_button_wins_over_any_software(boat: Boat) -> None:
    """W9 on an emulated core: the input stops the boat while software asks for more; the button needs the board."""
    async with boat.driving():
        await boat.see(*FULL, True)
        await boat.mcu.set_pins("estop 1")
        assert (await boat.see(*NEUTRAL, False)).holds == ESTOP | NOT_ARMED
        await boat.mcu.set_pins("estop 0")
        await asyncio.sleep(0.3)
        assert (await boat.see(*NEUTRAL, False)).holds == ESTOP | NOT_ARMED
    async with boat.driving():
        assert (await boat.see(*FULL, True)).holds == 0


async def test_the_receiver_wins_over_linux_and_drives_without_it(boat: Boat) -> None:
    async with boat.driving():
        await boat.see(*FULL, True)
        await boat.mcu.set_pins("rc 1500 1500 0")
        async with asyncio.timeout(10):
            while (await boat.caller.call("paani_status")).rc != 1:
                await asyncio.sleep(0.01)
        await boat.mcu.set_pins("rc 1600 1400 1")
        status = await boat.see(1600, 1400, True)
        assert (status.holds, status.rc) == (RECEIVER | NOT_ARMED, 2)
    async with asyncio.timeout(10):
        while (await boat.caller.call("paani_status")).state is not McuState.SAFE:
            await asyncio.sleep(0.05)
    await boat.see(1600, 1400, True)
    await boat.mcu.set_pins("rc none")
    await boat.see(*NEUTRAL, False)


@pytest.mark.parametrize(("line", "hold"), [("battery 9900 0", BATTERY), ("battery 12000 3001", CURRENT)])
async def test_a_limit_of_battery_or_current_wins_over_linux(boat: Boat, line: str, hold: int) -> None:
    async with boat.driving():
        await boat.see(*FULL, True)
        await boat.mcu.set_pins(line)
        status = await boat.see(*NEUTRAL, False)
        assert status.holds == hold | NOT_ARMED
        assert (status.battery_v, status.current_a) == (int(line.split()[1]) / 1000, int(line.split()[2]) / 100)


async def test_a_second_session_and_settings_are_refused_while_thrust_is_live(boat: Boat) -> None:
    async with boat.driving():
        await boat.see(*FULL, True)
        assert (await boat.ask(session=10)).verdict is McuVerdict.FOREIGN_SESSION
        assert (await boat.caller.call("paani_esc", SETTINGS.encode())).verdict is McuVerdict.LOCKED
        await boat.see(*FULL, True)
