"""The sticks for an autopilot, through ArduPilot's arithmetic: never more thrust than decided, nor the other way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paani_services.thrusters.autopilot_sticks import Channel, StickMixer

ROUND = Channel(1000, 2000, 1500, 0, False)
AS_SHIPPED = Channel(1100, 1900, 1500, 30, False)
CALIBRATED = Channel(987, 2011, 1463, 30, True)


def control_in(stick: int, channel: Channel, full: int) -> int:
    """`manual_override` in GCS_Common.cpp, then `pwm_to_angle_dz_trim` in RC_Channel.cpp, with their types."""
    span = channel.most - channel.least
    pulse = int(np.float32(span * (stick + 1000)) / np.float32(2000) + np.float32(channel.least))
    high, low = channel.rest + channel.dead_zone, channel.rest - channel.dead_zone
    sign = -1 if channel.is_reversed else 1
    if pulse > high:
        return sign * (full * (pulse - high) // (channel.most - high))
    if pulse < low:
        return -sign * (full * (low - pulse) // (low - channel.least))
    return 0


def motors(sticks: tuple[int, int], ahead: Channel, starboard: Channel) -> tuple[float, float]:
    """`get_pilot_desired_steering_and_throttle` in mode.cpp, and `output_skid_steering` in AP_MotorsUGV.cpp."""
    throttle, steering = control_in(sticks[0], ahead, 100) / 100, control_in(sticks[1], starboard, 4500) / 4500
    saturation = max(abs(throttle) + abs(steering), 1.0)
    return (throttle + steering) / saturation, (throttle - steering) / saturation


CHANNELS = st.builds(
    Channel,
    least=st.integers(800, 1300),
    most=st.integers(1700, 2200),
    rest=st.integers(1450, 1550),
    dead_zone=st.integers(0, 50),
    is_reversed=st.booleans(),
)
SIDE = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([-1.0, -0.3, 0.0, 0.004, 0.01, 0.2, 0.5, 1.0]))


@example(left=0.3, right=0.1, ahead=AS_SHIPPED, starboard=AS_SHIPPED, most=1.0)
@example(left=0.5, right=-0.1, ahead=CALIBRATED, starboard=CALIBRATED, most=1.0)
@example(left=1.0, right=0.1, ahead=AS_SHIPPED, starboard=AS_SHIPPED, most=0.3)
@given(left=SIDE, right=SIDE, ahead=CHANNELS, starboard=CHANNELS, most=st.floats(0.3, 1.0))
@pytest.mark.slow
def test_no_side_gets_more_than_was_decided(
    left: float, right: float, ahead: Channel, starboard: Channel, most: float
) -> None:
    mixed = StickMixer(ahead, starboard, most).mix(left, right)
    assert all(-1000 <= stick <= 1000 for stick in mixed.sticks)
    found = motors(mixed.sticks, ahead, starboard)
    half_step = 0.5 / min(starboard.travel(1), starboard.travel(-1)) + 1 / 4500
    assert (mixed.left, mixed.right) == pytest.approx(found, abs=half_step)
    assert abs(sum(found)) / 2 <= most + 1e-9
    for given_thrust, decided in zip(found, (left, right), strict=True):
        least, largest = sorted((0.0, decided))
        assert least - half_step <= given_thrust <= largest + half_step


@given(left=SIDE, right=SIDE, ahead=CHANNELS, starboard=CHANNELS)
def test_little_is_lost(left: float, right: float, ahead: Channel, starboard: Channel) -> None:
    mixed = StickMixer(ahead, starboard).mix(left, right)
    assert abs(mixed.left - left) + abs(mixed.right - right) <= 0.03


@given(ahead=CHANNELS, starboard=CHANNELS)
def test_at_rest_both_sticks_are_in_the_middle_of_their_dead_zones(ahead: Channel, starboard: Channel) -> None:
    still = StickMixer(ahead, starboard).still
    assert StickMixer(ahead, starboard).mix(0.0, 0.0) == still
    wide = [channel._replace(dead_zone=1) for channel in (ahead, starboard)]
    assert motors(still.sticks, *wide) == (0.0, 0.0)


@pytest.mark.parametrize("channel", [ROUND, AS_SHIPPED, CALIBRATED])
def test_full_thrust_is_full_and_turns_are_true(channel: Channel) -> None:
    mixer = StickMixer(channel, channel)
    for sides in [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (0.5, 0.5)]:
        assert motors(mixer.mix(*sides).sticks, channel, channel) == pytest.approx(sides)


@pytest.mark.parametrize(
    ("channel", "text"),
    [
        (Channel(1000, 2000, 1000, 0, False), "no travel"),
        (Channel(2000, 1000, 1500, 0, False), "no travel"),
        (Channel(0, 2000, 1500, 0, False), "no travel"),
        (Channel(1000, 2000, 1500, -30, False), "no travel"),
        (Channel(1000, 2000, 1090, 0, False), "too little travel"),
        (Channel(1000, 2000, 1500, 401, False), "too little travel"),
    ],
)
def test_a_calibration_by_which_nothing_can_be_said(channel: Channel, text: str) -> None:
    assert text in channel.problem


@pytest.mark.parametrize("channel", [ROUND, AS_SHIPPED, CALIBRATED])
def test_a_calibration_of_a_receiver(channel: Channel) -> None:
    assert not channel.problem
