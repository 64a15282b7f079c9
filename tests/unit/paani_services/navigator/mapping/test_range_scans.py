"""Scans in the frame of dead reckoning, and the segments of their echoes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from paani_services.navigator.mapping.observation import ObservationMemory, update_memory
from paani_services.navigator.mapping.range_scans import CM, Scan, find_echoes, find_segments
from paani_sim.eye.camera import BoatPose
from tests.synthetic_scans import MAX_RANGE_M, SCAN_US, scan_from, scan_of
from tests.synthetic_water import AT_REST, PLANNER, START_US, Bar, distance_to_bar_m, odometry

PILE = (5.0, -0.5, 6.0, 0.5)


def scan_at(boat: BoatPose, *bars: Bar) -> Scan:
    return scan_from(START_US, boat, bars, ObservationMemory()).scans[-1]


@given(st.floats(-math.pi, math.pi), st.floats(0.0, math.pi / 2.0), st.floats(3.0, 15.0), st.floats(-1.0, 1.0))
@settings(deadline=None)
def test_echoes_lie_on_what_was_met(yaw_rad: float, bearing_rad: float, range_m: float, forward_m: float) -> None:
    """However the boat lies, and wherever on it the scanner is: within a centimetre of the surface."""
    boat = BoatPose(0.0, 0.0, yaw_rad)
    x_m, y_m = range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad)
    bar = (x_m, y_m, x_m + 1.0, y_m + 1.0)
    scan = scan_from(START_US, boat, (bar,), ObservationMemory(), forward_m).scans[-1]
    east_m, north_m = (each[scan.ranges_m > 0.0] for each in find_echoes(scan))
    assert east_m.size > 0
    assert all(distance_to_bar_m(x, y, bar) < 1.0 / CM for x, y in zip(east_m, north_m, strict=True))


def test_nothing_within_range_is_no_echo() -> None:
    assert not scan_at(AT_REST, (MAX_RANGE_M + 1.0, -5.0, 30.0, 5.0)).ranges_m.any()


def test_one_turn_is_remembered_once_and_forgotten_after_the_time_of_a_fit() -> None:
    memory = scan_from(START_US, AT_REST, (PILE,), ObservationMemory())
    again = update_memory(memory, None, None, PLANNER, scan_of(START_US, AT_REST, (PILE,)))
    assert again.scans == memory.scans
    for number in range(1, 40):
        memory = scan_from(START_US + number * SCAN_US, AT_REST, (PILE,), memory)
    spanned_s = (memory.scans[-1].stamp_us - memory.scans[0].stamp_us) * 1e-6
    assert spanned_s == pytest.approx(PLANNER.fit_s, abs=0.2)


def test_a_scan_whose_pose_is_unknown_is_not_used() -> None:
    """Before the boat's pose is known, long before it, or once dead reckoning has begun anew."""
    scan = scan_of(START_US, AT_REST, (PILE,))
    assert update_memory(ObservationMemory(), None, None, PLANNER, scan).scans == ()
    memory = scan_from(START_US, AT_REST, (PILE,), ObservationMemory())
    late = replace(scan, source_us=START_US + round(PLANNER.max_pose_gap_s * 1e6) + 100_000)
    assert update_memory(memory, None, None, PLANNER, late).scans == memory.scans
    assert update_memory(memory, odometry(START_US + 100_000, AT_REST, epoch=7), None, PLANNER).scans == ()


def test_a_boat_that_wants_none_keeps_none() -> None:
    without = replace(PLANNER, scan_max_age_s=0.0)
    memory = update_memory(ObservationMemory(), odometry(START_US, AT_REST), None, without)
    assert update_memory(memory, None, None, without, scan_of(START_US, AT_REST, (PILE,))).scans == ()


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0, math.pi])
def test_a_surface_is_one_segment_and_two_are_two(yaw_rad: float) -> None:
    """Also where the first and the last beam meet it, which are neighbours."""
    boat = BoatPose(0.0, 0.0, yaw_rad)
    wall = (6.0, -7.0, 7.0, 7.0)
    assert len(find_segments(scan_at(boat, wall))) == 1
    pair = ((6.0, -3.0, 7.0, -1.0), (6.0, 1.0, 7.0, 3.0))
    assert len(find_segments(scan_at(boat, *pair))) == 2
    before = scan_at(boat, wall, (3.0, -0.5, 3.5, 0.5))
    assert len(find_segments(before)) == 3  # the wall left and right of what stands before it


def test_every_echo_is_in_one_segment() -> None:
    scan = scan_at(BoatPose(0.0, 0.0, 1.0), PILE, (-9.0, -9.0, 9.0, -8.0), (-3.0, 2.0, -2.0, 3.0))
    beams = np.concatenate(find_segments(scan))
    assert sorted(beams.tolist()) == np.flatnonzero(scan.ranges_m).tolist()


def test_in_a_round_basin_all_is_one_segment() -> None:
    scan = replace(scan_at(AT_REST, PILE), ranges_cm=np.full(360, 500, "<u2").tobytes())
    assert [each.size for each in find_segments(scan)] == [360]
