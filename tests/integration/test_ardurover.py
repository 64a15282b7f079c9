"""The thrusters with ArduPilot Rover itself, simulated, at the end of the line: armed, driven, taken away, let go.

`PAANI_ARDUROVER` names its program; docs/how-to/autopilot.md says how to build it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from paani import messages as m
from paani.bus import Bus
from paani.clock import stopwatch_ms
from paani.config import Config, load_config
from tests.ardurover import HOLD, MANUAL, ArduRover, ardurover
from tests.at_work import at_work
from tests.mcu_peer import until
from tests.thruster_bus import PULSES, ThrusterBus, opened

PROGRAM = os.environ.get("PAANI_ARDUROVER", "")
pytestmark = [
    pytest.mark.integration,
    pytest.mark.slow,
    pytest.mark.timeout(240),
    pytest.mark.skipif(not PROGRAM, reason="no ArduPilot Rover; set PAANI_ARDUROVER to its program"),
]
BOOT_S = 90.0  # its pre-arm checks refuse for the first half minute
LETS_GO_S = 2.5  # from the last stick to no thrust; 0.5 s by its settings
STEP = 0.003  # of a motor's output, in microseconds of 500


class Boat(ThrusterBus):
    """The bus, the autopilot, and the thrusters as a process of their own."""

    def __init__(self, config: Config, buses: dict[str, Bus], rover: ArduRover, sets: tuple[str, ...]) -> None:
        super().__init__(config, buses)
        self.rover, self._sets = rover, sets
        self.refusals: list[str] = []

    @property
    def problem(self) -> str:
        return self.state.value.problem if self.state.value else ""

    @contextlib.asynccontextmanager
    async def thrusters(self) -> AsyncIterator[asyncio.subprocess.Process]:
        words = [word for setting in self._sets for word in ("--set", setting)]
        process = await asyncio.create_subprocess_exec(sys.executable, "-m", "paani", "run", "thrusters", *words)
        try:
            yield process
        finally:
            if process.returncode is None:
                process.kill()
            await process.wait()

    async def arm(self) -> None:
        """Disarm and arm until the autopilot consents, which it does once its own checks pass."""
        async with asyncio.timeout(BOOT_S):
            while self.cause is not m.ZeroCause.NONE:
                self.armed = False
                await until(lambda: self.cause is m.ZeroCause.NOT_ARMED and not self.problem, BOOT_S)
                self.armed = True
                await until(self._is_answered, BOOT_S)
                self.refusals += [self.problem] if self.problem else []

    def _is_answered(self) -> bool:
        """Armed, refused, or never heard to be disarmed."""
        is_refused = "disarm and arm again" in self.problem
        return is_refused or self.cause in {m.ZeroCause.NONE, m.ZeroCause.REARM}

    async def until_motors(self, left: float, right: float) -> None:
        """Until the autopilot's outputs are these."""
        await until(lambda: self.rover.thrust == pytest.approx((left, right), abs=STEP), 10.0)


@pytest.fixture
async def boat(private_sets: tuple[str, ...], tmp_path: Path) -> AsyncIterator[Boat]:
    async with ardurover(Path(PROGRAM), tmp_path) as rover:
        more = ("profile=hull", f"thrusters.autopilot.line={rover.line}", "plant.adapter.astern=0.3", PULSES)
        sets = (*private_sets, *more)
        config = load_config(sets=sets)
        async with opened(config) as buses:
            await buses["thrusters"].close()
            found = Boat(config, buses, rover, sets)
            async with at_work(found.speak()):
                yield found


async def test_it_is_driven_by_the_decision_and_stops_with_it(boat: Boat) -> None:
    rover = boat.rover
    async with boat.thrusters():
        await boat.arm()
        assert (rover.mode, rover.is_armed) == (MANUAL, True)
        for name, value in (("FS_ACTION", 2), ("FS_GCS_ENABLE", 1), ("RC_OVERRIDE_TIME", 0.5), ("MOT_SLEWRATE", 0)):
            assert await rover.read_parameter(name) == value
        assert all(" does not arm: " in refusal and "rm: " in refusal for refusal in boat.refusals), boat.refusals
        for boat.thrust, boat.turn in (
            (0.2, 0.0),
            (0.3, 0.1),
            (0.3, -0.1),
            (0.05, 0.05),
            (0.0, 0.2),
            (-0.2, 0.0),
            (0.9, 0.0),
        ):
            await boat.until_motors(boat.thrust + boat.turn, boat.thrust - boat.turn)
        boat.is_pulsing = False
        await boat.until_cause(m.ZeroCause.PULSE_LOST)
        await boat.until_motors(0.0, 0.0)
        boat.armed = False
        await until(lambda: not rover.is_armed)


@pytest.mark.parametrize("gone", [signal.SIGKILL, signal.SIGSTOP])
async def test_without_its_process_the_motors_stop_and_it_holds(boat: Boat, gone: signal.Signals) -> None:
    rover = boat.rover
    async with boat.thrusters() as process:
        await boat.arm()
        await boat.until_motors(0.2, 0.2)
        process.send_signal(gone)
        since_ms = stopwatch_ms()
        await boat.until_motors(0.0, 0.0)
        assert stopwatch_ms() - since_ms < LETS_GO_S * 1000
        await until(lambda: rover.mode == HOLD)
        count = len(rover.outputs)
        if gone is signal.SIGSTOP:
            process.send_signal(signal.SIGCONT)
            await until(lambda: "disarm and arm again" in boat.problem)
            boat.armed = False
            await until(lambda: not rover.is_armed)
        assert all(abs(output.left_us - 1500) <= 1 for output in rover.outputs[count:])


async def test_what_another_ground_station_does_ends_the_drive(boat: Boat) -> None:
    rover = boat.rover
    async with boat.thrusters():
        await boat.arm()
        await boat.until_motors(0.2, 0.2)
        rover.set_mode(HOLD)
        await until(lambda: "its mode was changed to HOLD, not from here" in boat.problem)
        await boat.until_motors(0.0, 0.0)
        assert rover.is_armed
        rover.set_mode(MANUAL)
        await until(lambda: not rover.is_armed)
        await boat.arm()
        rover.disarm()
        await until(lambda: "it was disarmed, not from here" in boat.problem)
        await boat.until_motors(0.0, 0.0)
