"""The curve of a speed controller, there and back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import EscConfig, ThrustersConfig
from paani.esc_curve import pulse_us, thrust_of

SETTINGS = ThrustersConfig()
ESCS = st.builds(
    EscConfig, reversed=st.booleans(), trim_us=st.integers(-200, 200), deadband_us=st.integers(0, 100)
)  # fmt: skip


@given(esc=ESCS, thrust=st.floats(-1.0, 1.0))
def test_a_pulse_gives_the_thrust_that_asked_for_it(esc: EscConfig, thrust: float) -> None:
    assert thrust_of(pulse_us(thrust, SETTINGS, esc), SETTINGS, esc) == pytest.approx(thrust, abs=1e-9)


@given(esc=ESCS, offset=st.floats(-1.0, 1.0))
def test_within_the_deadband_and_without_a_pulse_there_is_no_thrust(esc: EscConfig, offset: float) -> None:
    rest = SETTINGS.neutral_us + esc.trim_us
    assert thrust_of(rest + offset * esc.deadband_us, SETTINGS, esc) == 0.0
    assert thrust_of(0.0, SETTINGS, esc) == 0.0


def test_known_pulses() -> None:
    esc = EscConfig(trim_us=10, deadband_us=20)
    assert [pulse_us(thrust, SETTINGS, esc) for thrust in (-1.0, 0.0, 0.5, 1.0)] == [1110.0, 1510.0, 1720.0, 1910.0]
    assert pulse_us(1.0, SETTINGS, EscConfig(reversed=True)) == 1100.0
    assert thrust_of(3000.0, SETTINGS, esc) == 1.0


def test_a_deadband_that_leaves_no_pulse_is_refused() -> None:
    with pytest.raises(ValueError, match=r"right\.deadband_us 100: leaves nothing of span_us 100"):
        ThrustersConfig(span_us=100, right=EscConfig(deadband_us=100))
