"""The last gate before two speed controllers: what moves them, and what keeps them still."""

from __future__ import annotations

import itertools

import pytest

from paani.messages import McuState, McuVerdict
from paani.microcontroller.payloads import EscSettings, McuStatus, ThrustCall, append_crc
from tests.unit.mcu.core import (
    BATTERY,
    CLOCK,
    CURRENT,
    ESTOP,
    NOT_ARMED,
    RECEIVER,
    THRUST_LINE,
    Core,
    notification,
    thrust,
)

NEUTRAL = (1500, 1500)
FAST = EscSettings(session=9, slew_per_s=10.0)


class Boat:
    """A core whose thrusters are driven, with the sequence numbers counted."""

    def __init__(self, core: Core, settings: EscSettings = FAST) -> None:
        self.core, self._seq = core, itertools.count(1)
        assert core.call(settings).verdict is McuVerdict.ACCEPTED

    def ask(self, left: float = 1.0, right: float = 1.0, *, armed: bool = True) -> McuStatus:
        return self.core.call(thrust(next(self._seq), left, right, armed=armed))

    def drive(self, duration_ms: int = 300, left: float = 1.0, right: float = 1.0) -> None:
        for _ in range(0, duration_ms, 100):
            self.ask(left, right)
            self.core.wait(100)

    def arm(self) -> None:
        self.ask(armed=False)
        self.drive()

    @property
    def status(self) -> McuStatus:
        return self.core.status(THRUST_LINE)

    @property
    def pulses(self) -> tuple[int, int]:
        return self.status.pulse_left_us, self.status.pulse_right_us


@pytest.fixture
def boat(core: Core) -> Boat:
    """Driven at full thrust on both sides."""
    boat = Boat(core)
    boat.arm()
    assert (boat.pulses, boat.status.enabled, boat.status.holds) == ((1900, 1900), True, 0)
    return boat


def test_thrust_needs_a_disarmed_frame_before_an_armed_one(core: Core) -> None:
    boat = Boat(core)
    boat.drive()
    assert (boat.status.holds, boat.status.enabled, boat.pulses) == (NOT_ARMED, False, NEUTRAL)
    boat.arm()
    assert (boat.status.holds, boat.status.enabled, boat.pulses) == (0, True, (1900, 1900))


def test_without_a_newer_frame_thrust_is_over_with_its_lease(boat: Boat) -> None:
    boat.ask()
    boat.core.wait(299)
    assert (boat.status.enabled, boat.status.state) == (True, McuState.FRESH)
    boat.core.wait(1)
    assert (boat.status.enabled, boat.pulses, boat.status.state) == (False, NEUTRAL, McuState.STALE)


def test_a_short_gap_is_forgiven_and_a_long_one_disarms(boat: Boat) -> None:
    boat.core.wait(900)
    boat.drive()
    assert boat.status.enabled
    boat.core.wait(1300)
    assert boat.status.state is McuState.SAFE
    boat.drive()
    assert (boat.status.holds, boat.status.enabled) == (NOT_ARMED, False)


def test_thrust_of_a_session_without_settings_is_refused(core: Core) -> None:
    assert core.call(thrust(1)).verdict is McuVerdict.NOT_CONFIGURED
    Boat(core)
    assert core.call(thrust(1, session=10)).verdict is McuVerdict.NOT_CONFIGURED
    assert core.status(THRUST_LINE).refusals.not_ready == 2


def test_settings_are_locked_and_a_second_session_is_refused_while_thrust_is_fresh(boat: Boat) -> None:
    assert boat.core.call(EscSettings(session=10)).verdict is McuVerdict.LOCKED
    assert boat.core.call(thrust(1, session=10)).verdict is McuVerdict.FOREIGN_SESSION
    boat.core.wait(300)
    assert boat.core.call(EscSettings(session=10)).verdict is McuVerdict.ACCEPTED
    assert boat.core.call(thrust(1, session=10)).holds == NOT_ARMED


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ((1, 2), McuVerdict.RANGE),  # flags
        ((0, 3), McuVerdict.VERSION),
        ((11, 0x27 + 1), McuVerdict.RANGE),  # left 10256
        ((9, 2), McuVerdict.LEASE),
    ],
)
def test_thrust_out_of_range_is_refused(boat: Boat, change: tuple[int, int], verdict: McuVerdict) -> None:
    data = bytearray(thrust(1000).encode()[:-2])
    data[change[0]] = change[1]
    assert boat.core.call(append_crc(bytes(data)), ThrustCall).verdict is verdict


def test_settings_out_of_range_are_refused_whole(core: Core) -> None:
    data = EscSettings(session=9, trim_left_us=50).encode()[:-2]
    for at, value in ((1, 4), (4, 201), (8, 0), (10, 99), (12, 101), (16, 99), (22, 1)):
        patched = bytearray(data)
        patched[at : at + (1 if at == 1 else 2)] = value.to_bytes(1 if at == 1 else 2, "little")
        assert core.call(append_crc(bytes(patched)), EscSettings).verdict is McuVerdict.RANGE, at
    core.wait(1)
    assert core.status(THRUST_LINE).pulse_left_us == 1500


def test_each_side_has_its_direction_trim_and_deadband(core: Core) -> None:
    settings = EscSettings(
        session=9,
        left_reversed=True,
        trim_left_us=-20,
        trim_right_us=30,
        span_us=300,
        deadband_left_us=40,
        deadband_right_us=100,
        slew_per_s=10.0,
    )
    boat = Boat(core, settings)
    boat.ask(armed=False)
    core.wait(1)
    assert boat.pulses == (1480, 1530)
    boat.drive(300, 0.5, -0.5)
    assert boat.pulses == (1480 - 40 - 130, 1530 - 100 - 100)
    boat.drive(300, -1.0, 1.0)
    assert boat.pulses == (1480 + 300, 1530 + 300)
    boat.drive(100, 0.0001, 0.0)
    assert boat.pulses == (1480 - 40, 1530)


def test_no_pulse_leaves_the_range_of_speed_controllers(core: Core) -> None:
    boat = Boat(core, EscSettings(session=9, neutral_us=1600, trim_left_us=200, span_us=500, slew_per_s=10.0))
    boat.arm()
    assert boat.pulses == (2000, 2000)


def test_thrust_grows_by_its_slew_and_falls_at_once(core: Core) -> None:
    boat = Boat(core, EscSettings(session=9, slew_per_s=0.5))
    boat.ask(armed=False)
    boat.drive(1000)
    assert boat.pulses == (1700, 1700)
    boat.ask(0.25, 0.0)
    core.wait(1)
    assert boat.pulses == (1600, 1500)
    boat.ask(-1.0, -1.0)
    core.wait(1)
    assert boat.pulses[0] == 1500
    core.wait(100)
    assert 1478 <= boat.pulses[0] <= 1480


def test_w9_an_open_stop_loop_wins_and_stays_until_disarmed_and_armed(boat: Boat) -> None:
    """W9: no frame of the software moves anything while the loop is open, nor after it, by itself, when it closes."""
    boat.core.set_pins(estop=True)
    boat.core.wait(1)
    assert (boat.status.enabled, boat.pulses) == (False, NEUTRAL)
    boat.ask(armed=False)
    boat.drive()
    assert (boat.status.enabled, boat.status.holds) == (False, ESTOP | NOT_ARMED)
    boat.core.set_pins()
    boat.drive()
    assert (boat.status.enabled, boat.status.holds) == (False, ESTOP | NOT_ARMED)
    boat.ask(armed=False)
    assert boat.status.holds == NOT_ARMED
    boat.drive()
    assert (boat.status.enabled, boat.pulses) == (True, (1900, 1900))


def test_the_receiver_wins_over_linux_and_hands_back_only_to_a_disarmed_frame(boat: Boat) -> None:
    boat.core.set_pins(receiver="standby", receiver_us=NEUTRAL)
    boat.drive()
    assert (boat.pulses, boat.status.rc) == ((1900, 1900), 1)
    boat.core.set_pins(receiver="takes over", receiver_us=(1600, 1400))
    boat.drive()
    assert (boat.pulses, boat.status.enabled, boat.status.rc) == ((1600, 1400), True, 2)
    assert boat.status.holds == RECEIVER | NOT_ARMED
    boat.core.set_pins(receiver="standby", receiver_us=(1600, 1400))
    boat.drive()
    assert (boat.pulses, boat.status.enabled) == (NEUTRAL, False)
    boat.arm()
    assert boat.pulses == (1900, 1900)


def test_the_receiver_drives_a_boat_whose_linux_is_dead_within_the_span_and_until_its_signal_is_lost(
    core: Core,
) -> None:
    core.set_pins(receiver="takes over", receiver_us=NEUTRAL)
    core.wait(5000)
    core.set_pins(receiver="takes over", receiver_us=(2000, 1100), battery_mv=1)
    core.wait(200)
    status = core.status(THRUST_LINE)
    assert (status.pulse_left_us, status.pulse_right_us, status.enabled) == (1900, 1100, True)
    core.set_pins(receiver="takes over", receiver_us=(0, 1100))
    core.wait(1)
    status = core.status(THRUST_LINE)
    assert (status.pulse_left_us, status.pulse_right_us, status.enabled) == (1500, 1500, False)


def test_the_receiver_moves_nothing_until_its_sticks_were_at_rest(core: Core) -> None:
    def is_moving(**pins: object) -> bool:
        core.set_pins(receiver="takes over", **pins)  # type: ignore[arg-type]
        core.wait(1)
        return core.status(THRUST_LINE).enabled

    assert not is_moving(receiver_us=(1800, 1800))
    assert is_moving(receiver_us=(1520, 1480))
    assert is_moving(receiver_us=(1800, 1800))
    assert not is_moving(receiver_us=(1800, 1800), estop=True)
    assert not is_moving(receiver_us=(1800, 1800))
    assert is_moving(receiver_us=NEUTRAL)


def test_a_boat_that_is_driven_by_hand_goes_on_when_linux_comes_back(core: Core) -> None:
    """Whoever has the sticks decides, whatever Linux sends: its process was started anew, and sets the curves again."""
    core.set_pins(receiver="takes over", receiver_us=NEUTRAL)
    core.wait(3000)
    core.set_pins(receiver="takes over", receiver_us=(1800, 1700))
    boat = Boat(core)
    for armed in (False, True, True):
        boat.ask(armed=armed)
        core.wait(10)
        assert (boat.status.enabled, boat.pulses) == (True, (1800, 1700))


@pytest.mark.parametrize(
    ("settings", "pins", "bit"),
    [
        (EscSettings(session=9, slew_per_s=10.0, min_battery_v=11.0), {"battery_mv": 10_999}, BATTERY),
        (EscSettings(session=9, slew_per_s=10.0, min_battery_v=11.0), {"battery_mv": 0}, BATTERY),
        (EscSettings(session=9, slew_per_s=10.0, max_current_a=20.0), {"current_ca": 2001}, CURRENT),
    ],
)
def test_a_limit_passed_for_100_ms_holds_until_disarmed(
    core: Core, settings: EscSettings, pins: dict[str, int], bit: int
) -> None:
    boat = Boat(core, settings)
    boat.arm()
    boat.ask()
    core.set_pins(**pins)  # type: ignore[arg-type]
    core.wait(99)
    assert boat.status.enabled
    core.set_pins()
    core.wait(1)
    core.set_pins(**pins)  # type: ignore[arg-type]
    core.wait(101)
    assert (boat.status.enabled, boat.pulses, boat.status.holds) == (False, NEUTRAL, bit | NOT_ARMED)
    core.set_pins()
    boat.drive()
    assert not boat.status.enabled
    boat.arm()
    assert boat.status.enabled


def test_limits_of_zero_are_none(boat: Boat) -> None:
    boat.core.set_pins(battery_mv=0, current_ca=32_767)
    boat.drive()
    assert boat.status.enabled


def test_over_current_wins_over_the_receiver(core: Core) -> None:
    Boat(core, EscSettings(session=9, max_current_a=20.0))
    core.set_pins(receiver="takes over", receiver_us=NEUTRAL)
    core.wait(10)
    core.set_pins(receiver="takes over", receiver_us=(1700, 1700), current_ca=2001)
    core.wait(90)
    assert core.status(THRUST_LINE).enabled
    core.wait(20)
    assert not core.status(THRUST_LINE).enabled


def test_a_watchdogs_first_expiry_disarms(boat: Boat) -> None:
    boat.core.disarm()
    boat.drive()
    assert (boat.status.enabled, boat.status.holds) == (False, NOT_ARMED)


def test_thrust_goes_on_across_the_wrap_of_the_clock() -> None:
    core = Core(CLOCK - 1000)
    core.set_pins()
    boat = Boat(core)
    boat.ask(armed=False)
    boat.drive(2000)
    assert (boat.status.enabled, boat.pulses, boat.status.mcu_ms) == (True, (1900, 1900), 1000)
    core.close()


def test_the_thrust_line_serves_no_guidance_and_the_guidance_line_no_thrust(core: Core) -> None:
    """A7: each line has its own calls, whoever is connected to it."""
    core.receive(0, notification(FAST) + notification(thrust(1, armed=False)))
    assert core.status(THRUST_LINE).accepted == 0
    core.receive(1, notification(FAST) + notification(thrust(1, armed=False)))
    assert core.status(THRUST_LINE).accepted == 2


def test_a_receivers_rest_and_span_are_those_of_the_calibrated_sides(core: Core) -> None:
    """Sticks are at rest within 50 us of where each side stands still, and go no further from there than thrust may."""
    Boat(core, EscSettings(session=9, trim_left_us=100, trim_right_us=-100, span_us=300))
    for sticks_us, is_at_rest in (
        ((1500, 1500), False),
        ((1651, 1400), False),
        ((1600, 1349), False),
        ((1650, 1350), True),
    ):
        core.set_pins(receiver="takes over", receiver_us=sticks_us)
        core.wait(1)
        assert core.status(THRUST_LINE).enabled is is_at_rest
    core.set_pins(receiver="takes over", receiver_us=(2000, 1000))
    core.wait(1)
    status = core.status(THRUST_LINE)
    assert (status.pulse_left_us, status.pulse_right_us) == (1900, 1100)


def test_a_watchdogs_first_expiry_stops_the_receiver_until_its_sticks_were_at_rest(core: Core) -> None:
    core.set_pins(receiver="takes over", receiver_us=NEUTRAL)
    core.wait(1)
    core.set_pins(receiver="takes over", receiver_us=(1800, 1800))
    core.wait(1)
    assert core.status(THRUST_LINE).enabled
    core.disarm()
    core.wait(100)
    assert not core.status(THRUST_LINE).enabled
    core.set_pins(receiver="takes over", receiver_us=NEUTRAL)
    core.wait(1)
    assert core.status(THRUST_LINE).enabled


def test_settings_of_the_same_session_need_arming_anew(boat: Boat) -> None:
    boat.core.wait(300)
    assert boat.status.state is McuState.STALE
    assert boat.core.call(FAST).verdict is McuVerdict.ACCEPTED
    boat.drive()
    assert (boat.status.enabled, boat.status.holds) == (False, NOT_ARMED)


def test_thrust_grows_by_the_millisecond_and_by_no_more_than_100_after_a_turn_that_took_longer(core: Core) -> None:
    boat = Boat(core, EscSettings(session=9, slew_per_s=0.15))
    boat.ask(armed=False)
    boat.drive(1000)
    assert boat.pulses == (1560, 1560)
    boat.ask()
    core.stand_still(250)
    boat.core.wait(0)
    assert boat.pulses == (1566, 1566)
