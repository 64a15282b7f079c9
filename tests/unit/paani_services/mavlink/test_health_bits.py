"""The health bits: each is set by what is fresh and in order, and by nothing else."""

from __future__ import annotations

from typing import Any

import pytest

from paani import messages as m
from paani_services.mavlink import health_bits as bits
from paani_services.mavlink.snapshot import Snapshot
from tests.mavlink_peer import NOW_US, armed, in_order, odometry

NO_FIX = m.GpsFix(
    source_us=NOW_US, latitude_deg=0.0, longitude_deg=0.0, sog_mps=0.0, cog_rad=0.0, position_std_m=0.0, fix=False
)


def order(*inhibits: m.Inhibit) -> m.NavCommand:
    return m.NavCommand(source_us=NOW_US, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=inhibits)


def zero(cause: m.ZeroCause) -> m.ThrustApplied:
    return m.ThrustApplied(source_us=NOW_US, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=cause)


def advice(direction: m.Direction, reason: m.Reason) -> m.Advisory:
    return m.Advisory(source_us=NOW_US, direction=direction, reason=reason)


def test_a_boat_in_order_has_every_bit() -> None:
    assert bits.healthy_bits(in_order()) == bits.ALWAYS
    assert bits.healthy_bits(armed()) == bits.ALWAYS


def test_a_boat_of_which_nothing_is_known_has_none() -> None:
    assert bits.healthy_bits(Snapshot(now_us=NOW_US)) == 0


@pytest.mark.parametrize(
    ("changes", "lost"),
    [
        ({"odometry": None}, bits.ESTIMATE | bits.HEADING),
        ({"odometry": odometry(healthy=False)}, bits.ESTIMATE | bits.HEADING),
        ({"inertial": None}, bits.INERTIAL),
        ({"inertial": odometry(healthy=False)}, bits.INERTIAL),
        ({"fix": None}, bits.GPS),
        ({"fix": NO_FIX}, bits.GPS),
        ({"advisory": None}, bits.CAMERA | bits.AVOIDANCE),
        ({"advisory": advice(m.Direction.NO_DATA, m.Reason.NO_EVIDENCE)}, bits.CAMERA | bits.AVOIDANCE),
        ({"advisory": advice(m.Direction.STOP, m.Reason.UNUSABLE_IMAGE)}, bits.CAMERA),
        ({"command": order(m.Inhibit.OUTSIDE_FENCE)}, bits.FENCE | bits.PREARM),
        ({"command": order(m.Inhibit.STALE_ODOMETRY)}, bits.PREARM),
        ({"command": order(m.Inhibit.NOT_ARMED, m.Inhibit.ADVISED_STOP)}, 0),  # somebody ahead is no fault
        ({"command": None}, bits.STEERING | bits.FENCE | bits.PREARM),
        ({"applied": None}, bits.THRUSTERS | bits.PREARM),
        ({"applied": zero(m.ZeroCause.LINE_LOST)}, bits.THRUSTERS | bits.PREARM),
        ({"operator": None}, bits.PREARM),
        ({"operator": m.OperatorState(source_us=NOW_US, armed=False, stopped=True)}, bits.PREARM),
    ],
)
def test_what_is_not_in_order_loses_its_bits_alone(changes: dict[str, Any], lost: int) -> None:
    assert bits.healthy_bits(in_order(**changes)) == bits.ALWAYS & ~lost


def test_a_fence_is_enabled_where_there_is_one() -> None:
    corners = tuple(m.Waypoint(x_m=x, y_m=y) for x, y in ((0, 0), (9, 0), (9, 9)))
    fence = (m.FenceArea(keep=m.Keep.IN, corners=corners),)
    fenced = bits.sys_status(in_order(mission=m.Mission(source_us=0, name="a", legs=(), fence=fence)))
    free = bits.sys_status(in_order())
    assert fenced.onboard_control_sensors_enabled & bits.FENCE
    assert not free.onboard_control_sensors_enabled & bits.FENCE
    assert free.onboard_control_sensors_health & bits.FENCE  # else MAVProxy reports a breach


@pytest.mark.parametrize("recording", [True, False])
def test_the_recorder_is_present_where_it_is_heard(recording: bool) -> None:
    status = bits.sys_status(in_order(recorder=m.RecorderState(source_us=NOW_US, recording=recording)))
    assert status.onboard_control_sensors_present & bits.RECORDER
    assert bool(status.onboard_control_sensors_health & bits.RECORDER) is recording
    assert not bits.sys_status(in_order()).onboard_control_sensors_present & bits.RECORDER
