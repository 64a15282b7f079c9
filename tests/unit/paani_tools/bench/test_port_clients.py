"""How the bench of ports dates what its clients receive, and knows that the boat obeys."""

from __future__ import annotations

import math
import struct

import pytest

from paani import messages as m
from paani_services.nmea.sentences import position_sentences
from paani_tools.bench.ports.clients import REMEMBERED, PoseStamps, gga_time_s
from paani_tools.bench.ports.steering import follows

NOON_US = 1_700_049_600_000_000  # 12:00:00 UTC


def pose(source_us: int, yaw_rate_radps: float = 0.0) -> m.Odometry:
    return m.Odometry(
        source_us=source_us, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, yaw_rate_radps=yaw_rate_radps, healthy=True,
        latitude_deg=50.0, longitude_deg=8.0,
    )  # fmt: skip


def on_the_wire(value: float) -> float:
    """As a field of four bytes arrives."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def test_a_pose_is_known_by_its_rate_in_the_other_sense() -> None:
    stamps = PoseStamps()
    stamps.note(pose(1, 0.123456789))
    stamps.note(pose(2, -0.5))
    assert stamps.measured_us(on_the_wire(-0.123456789)) == 1
    assert stamps.measured_us(0.5) == 2
    assert stamps.measured_us(0.25) is None


def test_of_two_poses_with_one_rate_it_is_the_later() -> None:
    """And of those that are long gone, none."""
    stamps = PoseStamps()
    for number in range(2):
        stamps.note(pose(number, 0.5))
    assert stamps.measured_us(-0.5) == 1
    stamps.note(pose(2, 0.75))
    stamps.note(pose(3, 0.5))
    for number in range(REMEMBERED - 1):
        stamps.note(pose(number, 1.0 + number))
    assert stamps.measured_us(-0.5) == 3
    for number in range(REMEMBERED):
        stamps.note(pose(number, 1.0 + number))
    assert stamps.measured_us(-0.5) is None


def test_the_time_of_a_position_sentence() -> None:
    of_day_s = [gga_time_s(line) for line in position_sentences(pose(NOON_US + 61_230_000))]
    assert [found for found in of_day_s if found is not None] == pytest.approx([12 * 3600 + 61.23])
    assert [gga_time_s(line) for line in position_sentences(None)] == [None, None]
    assert gga_time_s("") is None


@pytest.mark.parametrize(
    ("left", "right", "turn", "is_followed"),
    [(-0.2, 0.2, 1.0, True), (0.2, -0.2, -1.0, True), (0.2, -0.2, 1.0, False), (0.3, 0.31, 1.0, False)],
)
def test_a_stick_is_followed_by_fans_that_turn_as_it_says(
    left: float, right: float, turn: float, is_followed: bool
) -> None:
    applied = m.ThrustApplied(
        source_us=1, left=left, right=right, left_n=math.copysign(1.0, left), right_n=1.0, zero_cause=m.ZeroCause.NONE
    )
    assert follows(applied, turn) is is_followed
