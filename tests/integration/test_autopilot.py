"""The thrusters with an autopilot at the end of the line, over a real router: what is lost or changed stops it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from paani import messages as m
from paani.bus import Bus
from paani.config import Config, load_config
from paani_services.thrusters.service import run
from tests.at_work import at_work
from tests.mcu_peer import until
from tests.rover_peer import RoverPeer
from tests.thruster_bus import CLOCK, PULSES, ThrusterBus, opened

pytestmark = pytest.mark.integration


class Boat(ThrusterBus):
    """The bus, and the rover at the end of the line."""

    def __init__(self, config: Config, buses: dict[str, Bus], rover: RoverPeer) -> None:
        super().__init__(config, buses)
        self.rover = rover

    async def arm(self) -> None:
        """Disarm, until the rover is heard, and arm."""
        self.armed = False
        await until(lambda: self.cause is m.ZeroCause.NOT_ARMED and self.is_heard and not self.problem, 8.0)
        self.armed = True

    @property
    def is_heard(self) -> bool:
        return self.state.value is not None and self.state.value.answer_age_ms < 1500.0

    @property
    def problem(self) -> str:
        return self.state.value.problem if self.state.value else ""


@pytest.fixture
async def boat(private_sets: tuple[str, ...]) -> AsyncIterator[Boat]:
    rover = RoverPeer()
    sets = (*private_sets, f"thrusters.autopilot.line={await rover.open()}", PULSES)
    config = load_config(profile="hull", sets=sets)
    async with opened(config) as buses:
        found = Boat(config, buses, rover)
        try:
            async with at_work(run(buses["thrusters"], CLOCK, config), found.speak(), rover.beat()):
                yield found
        finally:
            await rover.close()


@pytest.mark.slow
async def test_it_drives_with_its_failsafe_set_and_stops_with_the_operator(boat: Boat) -> None:
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)
    await until(lambda: boat.rover.sticks[-1][1:] == (200, 0))
    assert (boat.rover.mode, boat.rover.is_armed) == (0, True)
    required = {
        "SYSID_MYGCS": 254, "RC_OVERRIDE_TIME": 0.5, "FS_THR_ENABLE": 1, "FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 2,
        "FS_TIMEOUT": 1, "FS_ACTION": 2, "PILOT_STEER_TYPE": 3, "MANUAL_STR_EXPO": 0, "MOT_SLEWRATE": 0,
        "MOT_THR_MIN": 0,
    }  # fmt: skip
    assert boat.rover.parameters == boat.rover.parameters | required
    boat.is_pulsing = False
    await boat.until_cause(m.ZeroCause.PULSE_LOST)
    await until(lambda: boat.rover.sticks[-1][1:] == (0, 0))
    boat.armed = False
    await until(lambda: not boat.rover.is_armed)


@pytest.mark.slow
async def test_a_lost_heartbeat_stops_it_and_it_stays_stopped(boat: Boat) -> None:
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)
    boat.rover.is_silent = True
    await boat.until_cause(m.ZeroCause.LINE_LOST)
    await until(
        lambda: "no heartbeat of the autopilot; disarm and arm again" in boat.problem and not boat.rover.is_armed
    )
    boat.rover.is_silent, orders = False, boat.rover.orders_to_arm
    await boat.until_cause(m.ZeroCause.REFUSED)
    assert boat.rover.orders_to_arm == orders
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)


@pytest.mark.slow
async def test_a_mode_changed_by_somebody_ends_our_sticks(boat: Boat) -> None:
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)
    boat.rover.mode = 11
    await boat.until_cause(m.ZeroCause.REFUSED)
    await until(lambda: "its mode was changed to RTL, not from here" in boat.problem)
    assert "RTL" in boat.buses["thrusters"].note_text
    count = len(boat.rover.sticks)
    await asyncio.sleep(0.5)
    assert len(boat.rover.sticks) == count


@pytest.mark.slow
async def test_a_line_that_breaks_latches(boat: Boat) -> None:
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)
    boat.rover.drop_line()
    await until(lambda: "the line to the autopilot broke; disarm and arm again" in boat.problem)
    await until(lambda: not boat.rover.is_armed, 8.0)
    await boat.arm()
    await boat.until_cause(m.ZeroCause.NONE)
