"""The memory of observations: which are kept, from which pose, and for how long."""

from __future__ import annotations

import itertools
import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.geometry import wrap_rad
from paani.messages import Odometry, SegmentationSource, TimeBase
from paani_services.navigator.mapping.observation import (
    OLD_OBSERVATIONS,
    VIEW_SIZE_M,
    VIEW_SIZE_RAD,
    ObservationMemory,
    is_free_space_evidence,
    update_memory,
)
from paani_services.navigator.mapping.observed_cells import project_to_cells
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.stamped_pose import interpolate_pose
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import AT_REST, CAMERA, PLANNER, START_US, evidence, observe_from, odometry, water_edge_of

STEP_S, TURN_RADPS = 0.4, 0.1
AHEAD_5_M = ((5.0, -1.0, 5.6, 1.0),)


def grid_of(memory: ObservationMemory, age_s: float) -> OccupancyGrid:
    assert memory.odom_pose is not None
    now_us = memory.observations[-1].stamp_us + round(age_s * 1e6)
    return build_occupancy_grid(
        memory.observations, (memory.odom_pose.x_m, memory.odom_pose.y_m), now_us, CAMERA, PLANNER
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"usable": False},
        {"navigation_eligible": False, "segmentation": SegmentationSource.FALLBACK},
        {"time_base": TimeBase.MEDIA},
        {"water_edge": ()},
        {"height_px": 0},
    ],
)
def test_only_free_space_evidence_is_remembered(changes: dict[str, object]) -> None:
    """F2: a fallback mask never frees a cell, nor does a recording or an unusable picture."""
    clear_evidence = evidence(START_US, water_edge_of(AT_REST))
    assert is_free_space_evidence(clear_evidence)
    assert not is_free_space_evidence(msgspec.structs.replace(clear_evidence, **changes))
    memory = update_memory(
        ObservationMemory(), odometry(START_US, AT_REST), msgspec.structs.replace(clear_evidence, **changes), PLANNER
    )
    assert memory.observations == ()


def test_a_picture_without_odometry_near_it_is_not_remembered() -> None:
    """Attitude and position must be known within `max_pose_gap_s` of the picture."""
    known = update_memory(ObservationMemory(), odometry(START_US, AT_REST), None, PLANNER)
    gap_us = round(PLANNER.max_pose_gap_s * 1e6)
    open_water = water_edge_of(AT_REST)
    assert update_memory(known, None, evidence(START_US + gap_us, open_water), PLANNER).observations
    assert not update_memory(known, None, evidence(START_US + gap_us + 1, open_water), PLANNER).observations
    assert not update_memory(ObservationMemory(), None, evidence(START_US, open_water), PLANNER).observations


def test_the_pose_between_two_odometries_lies_between_them() -> None:
    memory = update_memory(ObservationMemory(), odometry(START_US, BoatPose(0.0, 0.0, 3.1)), None, PLANNER)
    later = odometry(START_US + 100_000, BoatPose(0.0, 0.0, -3.1, pitch_rad=0.02), surge_mps=1.0)
    memory = update_memory(memory, later, None, PLANNER)
    pose = interpolate_pose(memory.poses, START_US + 25_000, 0.15)
    assert pose is not None
    assert pose.x_m == pytest.approx(-0.025, abs=1e-4)
    assert pose.pitch_rad == pytest.approx(0.005)
    assert pose.yaw_rad == pytest.approx(3.1 + 0.25 * (2.0 * math.pi - 6.2))


def test_observations_do_not_move_with_the_gps_position() -> None:
    """The GPS position of a boat at rest strays by 3 m, and jumps by 8: nothing observed comes nearer or goes away."""
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    before = grid_of(memory, age_s=1.5)
    for k in range(1, 16):
        stray = BoatPose(0.2 * k + (8.0 if k > 7 else 0.0), -0.1 * k, 0.0)
        memory = update_memory(memory, odometry(START_US + 100_000 * k, stray), None, PLANNER)
    assert memory.odom_pose is not None
    assert (memory.odom_pose.x_m, memory.odom_pose.y_m) == (0.0, 0.0)
    assert before.occupied.any()
    assert (grid_of(memory, age_s=1.5).occupied == before.occupied).all()


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.8, 0.8), st.floats(-0.3, 0.3), st.floats(-3.1, 3.1), st.floats(-0.3, 0.3))
@pytest.mark.slow
def test_the_position_is_dead_reckoned_from_the_velocity_over_ground(
    surge: float, sway: float, yaw: float, rate: float
) -> None:
    """It agrees with the sum of the steps of 1/20 s over 5 s."""
    memory = update_memory(ObservationMemory(), odometry(START_US, BoatPose(3.0, 4.0, yaw)), None, PLANNER)
    x_m, y_m = 3.0, 4.0
    for k in range(1, 101):
        heading = yaw + rate * 0.05 * k
        boat = BoatPose(0.0, 0.0, heading)
        memory = update_memory(memory, odometry(START_US + 50_000 * k, boat, surge, sway_mps=sway), None, PLANNER)
        x_m += 0.05 * (surge * math.cos(heading) - sway * math.sin(heading))
        y_m += 0.05 * (surge * math.sin(heading) + sway * math.cos(heading))
    assert memory.odom_pose is not None
    assert (memory.odom_pose.x_m, memory.odom_pose.y_m) == pytest.approx((x_m, y_m), abs=1e-6)


@pytest.mark.parametrize(
    "after",
    [
        odometry(START_US + 100_000, AT_REST, epoch=2),
        odometry(START_US + round(PLANNER.max_reckon_s * 1e6) + 1, AT_REST),
    ],
)
def test_another_epoch_or_a_gap_forgets_all_observations(after: Odometry) -> None:
    """The boat may be anywhere on the grid: unknown is the safe direction."""
    assert update_memory(observe_from(), after, None, PLANNER).observations == ()


@pytest.mark.parametrize("changes", [{"surge_mps": math.nan}, {"sway_mps": math.inf}, {"healthy": False}])
def test_unusable_odometry_is_not_dead_reckoned(changes: dict[str, float]) -> None:
    memory = observe_from()
    assert update_memory(memory, odometry(START_US + 50_000, AT_REST, **changes), None, PLANNER) == memory


@pytest.mark.slow
def test_every_picture_in_use_is_projected_once_and_few_others_are_kept() -> None:
    """At 30 Hz. Cells of pictures that are out of use are megabytes that come and go with what is seen."""
    memory, period_us, edge = ObservationMemory(), 33_333, water_edge_of(AT_REST)
    for k in range(round(32e6 / period_us)):
        at_us = START_US + k * period_us
        seen = msgspec.structs.replace(evidence(at_us, edge), frame_seq=k)
        memory = update_memory(memory, odometry(at_us, BoatPose(0.0, 0.0, k * TURN_RADPS / 30.0)), seen, PLANNER)
    grid_of(memory, 0.0)
    made = project_to_cells.cache_info()
    grid_of(memory, 0.0)
    assert project_to_cells.cache_info().misses == made.misses
    assert made.maxsize is not None
    assert made.maxsize <= 2 * len(memory.observations)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    yaws_rad=st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=12),
    lies_s=st.floats(0.0, PLANNER.hidden_s),
    steps_m=st.sampled_from([0.0, 0.02, 0.2]),
)
def test_each_side_is_remembered_as_it_was_looked_at_last(yaws_rad: list[float], lies_s: float, steps_m: float) -> None:
    """By a boat that lies still or makes little way; and what a plan costs does not grow with how long it lies."""
    memory, at_us, seen_from = ObservationMemory(), START_US, []
    edge = water_edge_of(AT_REST)
    for number, yaw_rad in enumerate([*yaws_rad, *[yaws_rad[-1]] * round(lies_s / STEP_S)]):
        at_us += round(STEP_S * 1e6)
        pose = BoatPose(0.5 * VIEW_SIZE_M + steps_m * min(number, len(yaws_rad)), 0.5 * VIEW_SIZE_M, yaw_rad)
        memory = observe_from(pose, edge, at_us, memory)
        seen_from.append((at_us, pose))
    kept = [each for each in memory.observations if each.water_edge]
    for then_us, pose in seen_from:
        if (at_us - then_us) * 1e-6 <= PLANNER.hidden_s:
            assert any(
                each.stamp_us >= then_us
                and abs(wrap_rad(each.yaw_rad - pose.yaw_rad)) <= VIEW_SIZE_RAD
                and math.hypot(each.x_m - pose.x_m, each.y_m - pose.y_m) <= 2.0 * VIEW_SIZE_M
                for each in kept
            )
    old_us = at_us - round(PLANNER.occupied_s * 1e6)
    assert sum(each.stamp_us < old_us for each in kept) <= min(2 * len(yaws_rad) + 2, OLD_OBSERVATIONS)


def test_the_newest_old_pictures_are_kept_of_a_boat_that_goes_on() -> None:
    memory, edge = ObservationMemory(), water_edge_of(AT_REST)
    for number in range(240):
        memory = observe_from(BoatPose(0.24 * number, 0.0, 0.0), edge, START_US + number * 400_000, memory)
    newest_us = memory.observations[-1].stamp_us
    old_us = newest_us - round(PLANNER.occupied_s * 1e6)
    old = [each for each in memory.observations if each.water_edge and each.stamp_us < old_us]
    assert len(old) == OLD_OBSERVATIONS or (newest_us - old[0].stamp_us) * 1e-6 > PLANNER.hidden_s - 3.0
    assert all(later.x_m - earlier.x_m > 0.5 * VIEW_SIZE_M for earlier, later in itertools.pairwise(old[:-1]))
