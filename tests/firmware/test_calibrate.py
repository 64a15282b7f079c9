"""`paani calibrate thrusters` at a terminal, with the emulated microcontroller at its serial line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.firmware.emulator import Emulator, open_emulator
from tests.integration.test_calibrate_thrusters import calibrating, require_found

pytestmark = pytest.mark.firmware


class TimerPulses:
    """The pulses that drive the motors, as the microcontroller's timer holds them."""

    def __init__(self, mcu: Emulator) -> None:
        self._mcu = mcu

    def pulses_us(self) -> tuple[int, int]:
        return self._mcu.pins.left_us, self._mcu.pins.right_us

    def is_live(self) -> bool:
        return self._mcu.pins.enable


@pytest.mark.rotating(cpu_s=4)
async def test_both_sides_are_found_on_the_emulated_microcontroller(tmp_path: Path) -> None:
    """And the thrusters have been driven while the key was held, and only then."""
    async with open_emulator(pty=True) as mcu, calibrating(tmp_path, TimerPulses(mcu), mcu.thrust) as operator:
        await operator.calibrate()
        assert not mcu.pins.enable
    require_found(tmp_path)
