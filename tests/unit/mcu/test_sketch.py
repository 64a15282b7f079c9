"""The sketch itself, compiled for this computer, on a board of pins, registers and time."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from typing import Any

import pytest

from paani.microcontroller.payloads import EscSettings
from tests.unit.mcu.core import BUILD, CLOCK, HEADS, Payload, build, thrust

pytestmark = pytest.mark.slow

LEFT, RIGHT, SWITCH, STOP_LOOP, ENABLE, NOTHING = 2, 3, 5, 7, 4, 20  # pins
BATTERY, CURRENT = 14, 15  # pins of the converter
LOW, HIGH = 0, 1
OUTPUT, INPUT_PULLUP = 1, 2
FED, STARTED_MS = 0xAAAA, 300


class Board:
    """The program of the sketch, which was set up with the stop loop closed."""

    def __init__(self) -> None:
        build()
        self._program = subprocess.Popen(
            [BUILD / "sketch"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="ascii"
        )
        self.say(f"level {STOP_LOOP} {LOW}", "setup")

    def close(self) -> None:
        self._program.communicate(timeout=10.0)
        assert self._program.returncode == 0, "the sanitizer has found something"

    def say(self, *lines: str) -> None:
        assert self._program.stdin is not None
        self._program.stdin.write("".join(f"{line}\n" for line in lines))
        self._program.stdin.flush()

    def ask(self, line: str) -> str:
        assert self._program.stdout is not None
        self.say(line)
        return self._program.stdout.readline()

    @property
    def state(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.ask("state"))
        return found

    @property
    def is_enabled(self) -> bool:
        return bool(self.state["enable"])

    def call(self, payload: Payload) -> None:
        self.ask(f"call {HEADS[type(payload)]} {payload.encode().hex()}")

    def drive(self, turns: int = 300, **limits: float) -> None:
        """By Linux: the settings, a disarmed frame, then armed ones."""
        self.call(EscSettings(session=9, slew_per_s=10.0, **limits))  # type: ignore[arg-type]  # of the test's choice
        self.call(thrust(1, armed=False))
        for number in range(turns // 100):
            self.call(thrust(number + 2, 1.0, 1.0))
            self.say("loop 100")

    def hold_sticks(self, left_us: int, right_us: int, turns: int = 1) -> None:
        """By hand: the switch is on, and pulses come every few turns."""
        for _ in range(turns):
            self.say(f"pulse {LEFT} {left_us}", f"pulse {RIGHT} {right_us}", f"pulse {SWITCH} 1900", "loop 5")

    def take_over(self) -> None:
        self.hold_sticks(1500, 1500, turns=4)
        self.hold_sticks(1800, 1800, turns=4)


@pytest.fixture
def board() -> Iterator[Board]:
    board = Board()
    yield board
    board.close()


def test_it_begins_safe_and_watched(board: Board) -> None:
    state = board.state
    assert (state["enable"], state["pulses_us"]) == (LOW, [1500, 1500])
    assert state["modes"][str(ENABLE)] == OUTPUT
    assert state["modes"][str(STOP_LOOP)] == INPUT_PULLUP, "a broken wire opens the loop"
    assert (state["watchdog_ms"], state["key"]) == (STARTED_MS, FED)


def test_linux_drives_and_an_open_stop_loop_ends_it_at_once(board: Board) -> None:
    board.say("loop 10")
    assert not board.is_enabled
    board.drive()
    state = board.state
    assert state["enable"]
    assert min(state["pulses_us"]) > 1500
    board.say(f"level {STOP_LOOP} {HIGH}", "loop 1")
    state = board.state
    assert (state["enable"], state["pulses_us"]) == (LOW, [1500, 1500])
    board.say(f"level {STOP_LOOP} {LOW}", "loop 400")
    assert not board.is_enabled, "nothing re-arms itself"


def test_the_receiver_drives_until_its_pulses_are_lost_or_the_stop_loop_opens(board: Board) -> None:
    board.take_over()
    assert board.state["pulses_us"] == [1800, 1800]
    assert board.is_enabled
    board.say("loop 80")
    assert board.is_enabled
    board.say("loop 40")
    assert not board.is_enabled, "no pulse for 100 ms"
    board.take_over()
    board.say(f"level {STOP_LOOP} {HIGH}", "loop 1")
    assert not board.is_enabled


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("width_us", [700, 2300, 65_536 + 1700, 3 * 65_536 + 1500])
def test_what_is_too_long_or_too_short_is_no_pulse(board: Board, width_us: int, side: int) -> None:
    board.take_over()
    board.hold_sticks(1800, 1800)
    assert board.is_enabled
    board.hold_sticks(*((width_us, 1800) if side == 0 else (1800, width_us)))
    state = board.state
    assert (state["enable"], state["pulses_us"]) == (LOW, [1500, 1500])


def test_a_receiver_that_was_lost_does_not_come_back_when_the_clock_has_wrapped(board: Board) -> None:
    board.take_over()
    board.say("loop 200")
    assert not board.is_enabled
    board.say(f"skip {CLOCK - 250}", "loop 100")
    assert not board.is_enabled
    board.hold_sticks(1800, 1800)
    assert board.is_enabled


def test_a_receiver_that_stands_by_leaves_the_boat_to_linux(board: Board) -> None:
    board.drive()
    for _ in range(40):
        board.say(f"pulse {LEFT} 1500", f"pulse {RIGHT} 1500", f"pulse {SWITCH} 1700", "loop 5")
    board.call(thrust(10, 1.0, 1.0))
    board.say("loop 1")
    assert board.is_enabled
    board.say(f"pulse {SWITCH} 1701", "loop 1")
    board.call(thrust(11, 1.0, 1.0))
    board.say(f"pulse {SWITCH} 1700", "loop 1")
    assert not board.is_enabled


@pytest.mark.parametrize(
    ("pin", "reading"),
    [
        (BATTERY, 309),  # 10.96 V
        (CURRENT, 311),  # 20.06 A
        *((pin, reading) for pin in (BATTERY, CURRENT) for reading in (-5, 1023)),  # failed, and the end of the scale
    ],
)
def test_a_limit_holds_where_it_is_passed_and_where_nobody_can_tell(board: Board, pin: int, reading: int) -> None:
    board.say(f"analog {BATTERY} 310", f"analog {CURRENT} 310")  # 11 V and 20 A, as far as each may go
    board.drive(min_battery_v=11.0, max_current_a=20.0)
    assert board.is_enabled
    board.say(f"analog {pin} {reading}")
    board.call(thrust(10, 1.0, 1.0))
    board.say("loop 150")
    assert not board.is_enabled
    board.say(f"analog {pin} 310")
    board.call(thrust(11, 1.0, 1.0))
    board.say("loop 50")
    assert not board.is_enabled, "nothing re-arms itself"


def test_a_pulse_that_ends_while_the_loop_looks_is_no_lost_receiver(board: Board) -> None:
    """Its time is later than the one at which the turn began."""
    board.take_over()
    for _ in range(3):
        board.say(f"level {SWITCH} {HIGH}", f"pulse {NOTHING} 900", f"fall {SWITCH}", "loop 1")
        assert board.is_enabled
        board.hold_sticks(1800, 1800)


def test_a_board_without_linux_is_reset_but_not_under_the_receivers_hand(board: Board) -> None:
    """A router that was restarted has forgotten the routes."""
    board.drive()
    board.say("loop 9000")
    assert board.state["key"] == FED
    board.say("loop 2000")
    assert board.state["key"] == FED, "the feed before"
    board.say("loop 100")
    assert board.state["key"] != FED
    board.hold_sticks(1500, 1500)
    assert board.state["key"] == FED
