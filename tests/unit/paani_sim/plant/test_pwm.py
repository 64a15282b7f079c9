"""Force from an emulated microcontroller's pulses, and from nothing else."""

from __future__ import annotations

import pytest

from paani.clock import ManualClock
from paani.config import Config, load_config
from paani_sim.plant.pwm import MAX_LINE_BYTES, PulseInput

CONFIG: Config = load_config(profile="hil", sets=["thrusters.left.deadband_us=40", "thrusters.right.reversed=true"])
FULL_N = CONFIG.plant.adapter.force_per_unit_n


def fed(*chunks: bytes) -> PulseInput:
    pulses = PulseInput(CONFIG, ManualClock())
    for chunk in chunks:
        pulses.feed(chunk, 0)
    return pulses


def test_pulses_give_the_force_of_the_curve() -> None:
    left_n, right_n = fed(b"pwm 1720 1300 1 17\n").forces_n(0)
    assert left_n == pytest.approx(0.5 * FULL_N)
    assert right_n == pytest.approx(0.5 * FULL_N)


def test_missing_pulses_give_no_force_after_a_tenth_of_a_second() -> None:
    pulses = fed(b"pwm 1900 1100 1 17\n")
    assert pulses.forces_n(100_000) == (FULL_N, FULL_N)
    assert pulses.forces_n(100_001) == (0.0, 0.0)
    assert not pulses.is_live(100_001)
    assert PulseInput(CONFIG, ManualClock()).forces_n(0) == (0.0, 0.0)


def test_a_dead_enable_line_gives_no_force() -> None:
    assert fed(b"pwm 1900 1100 0 17\n").forces_n(0) == (0.0, 0.0)


def test_lines_come_in_pieces_and_junk_is_counted() -> None:
    pulses = fed(b"pwm 19", b"00 1100 1 17\r\nhello\npwm 1 2 3 4\n", b"pwm -1 0 1 0\n")
    assert pulses.forces_n(0) == (FULL_N, FULL_N)
    assert pulses.unreadable == 3
    pulses.feed(b"x" * 10_000, 0)
    assert len(pulses._rest) <= MAX_LINE_BYTES
