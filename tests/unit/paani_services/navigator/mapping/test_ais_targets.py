"""Vessels told by AIS: where they are by now, which of them count, and that they only ever add caution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from paani.config import CalibrationConfig
from paani.geometry import geodetic_from_enu
from paani.messages import AisVessel, AisVessels, Label
from paani_services.navigator.avoidance.clearance import predicted_clearance_m
from paani_services.navigator.mapping.ais_targets import (
    MAX_TARGETS,
    POSITION_STD_M,
    AisTarget,
    locate_targets,
    predict_unseen_targets,
)
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.stamped_pose import StampedPose
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import PLANNER, START_US, odometry

ORIGIN_DEG = (51.44, -0.95)
HERE = StampedPose(START_US, 100.0, 50.0, 0.0, 0.0, 0.0)  # of the memory, which began elsewhere than the map
ODOMETRY = replace(odometry(START_US, BoatPose(0.0, 0.0, 0.0)), latitude_deg=ORIGIN_DEG[0], longitude_deg=ORIGIN_DEG[1])
NARROW = CalibrationConfig(valid=True, hfov_deg=70.0, height_m=0.9)
BOAT = (100.0, 50.0, 0.0)


def vessel(
    east_m: float, north_m: float, speed_mps: float = 2.0, course_rad: float = 0.0, age_s: float = 0.0, **more: float
) -> AisVessel:
    latitude_deg, longitude_deg = geodetic_from_enu(east_m, north_m, *ORIGIN_DEG)
    sizes = {"to_bow_m": 7.0, "to_stern_m": 7.0, "to_port_m": 1.5, "to_starboard_m": 1.5} | more
    return AisVessel(
        mmsi=1, fixed_us=START_US - round(age_s * 1e6), latitude_deg=latitude_deg, longitude_deg=longitude_deg,
        sog_mps=speed_mps, cog_rad=course_rad, **sizes,
    )  # fmt: skip


def located(*vessels: AisVessel) -> tuple[AisTarget, ...]:
    ais = AisVessels(source_us=START_US, vessels=vessels)
    return locate_targets(ais, ODOMETRY, HERE, START_US, PLANNER)


def unseen(*targets: AisTarget, seen: tuple[DynamicObstacle, ...] = ()) -> list[DynamicObstacle]:
    return predict_unseen_targets(targets, seen, BOAT, NARROW)


def test_a_vessel_has_gone_on_since_it_spoke_and_lies_along_its_course() -> None:
    [target] = located(
        vessel(-30.0, 4.0, 2.0, age_s=5.0, to_bow_m=10.0, to_stern_m=4.0, to_port_m=1.0, to_starboard_m=3.0)
    )
    assert (target.east_m, target.north_m) == pytest.approx((100.0 - 30.0 + 10.0 + 3.0, 50.0 + 4.0 - 1.0), abs=0.05)
    assert (target.length_m, target.beam_m, target.age_s) == (14.0, 4.0, 5.0)


def test_who_does_not_tell_its_size_is_taken_to_be_large() -> None:
    [target] = located(vessel(-30.0, 0.0, to_bow_m=0.0, to_stern_m=0.0, to_port_m=0.0, to_starboard_m=0.0))
    assert (target.length_m, target.beam_m) == (20.0, 5.0)


@pytest.mark.parametrize(
    "reported",
    [
        vessel(-30.0, 0.0, age_s=PLANNER.ais_max_age_s + 0.1),
        replace(vessel(-30.0, 0.0), fixed_us=START_US + 1),
        vessel(-30.0, 0.0, 0.2),
        vessel(-500.0, 0.0),
    ],
    ids=["old", "of the future", "at rest", "far away"],
)
def test_who_does_not_count(reported: AisVessel) -> None:
    assert located(reported) == ()
    assert locate_targets(None, ODOMETRY, HERE, START_US, PLANNER) == ()


def test_of_a_crowd_the_nearest_count() -> None:
    crowd = [replace(vessel(-10.0 - 5.0 * number, 0.0), mmsi=number) for number in range(12)]
    found = located(*reversed(crowd))
    assert len(found) == MAX_TARGETS
    assert [target.east_m for target in found] == pytest.approx([90.0 - 5.0 * number for number in range(8)], abs=0.05)


@given(st.floats(-math.pi, math.pi), st.floats(3.0, 60.0))
@example(math.radians(34.5), 20.0)
@example(math.radians(-35.5), 20.0)
def test_what_the_camera_looks_at_is_left_to_it(bearing_rad: float, away_m: float) -> None:
    at = (100.0 + away_m * math.cos(bearing_rad), 50.0 + away_m * math.sin(bearing_rad))
    found = unseen(AisTarget(1, *at, 0.0, 2.0, 14.0, 3.0, 0.0))
    assert bool(found) is (abs(bearing_rad) > math.radians(35.0))


@pytest.mark.parametrize(
    ("label", "off_m", "is_added"), [(Label.VESSEL, 4.0, False), (Label.VESSEL, 9.0, True), (Label.PERSON, 4.0, True)]
)
def test_the_vessel_that_the_camera_saw_counts_where_it_saw_it(label: Label, off_m: float, is_added: bool) -> None:
    beside = (np.array([100.0]), np.array([60.0 - off_m]))
    saw = DynamicObstacle(*beside, 0.2, Velocity(1.0, 0.0, 0.1), 1.0, frozenset(), label=label)
    assert bool(unseen(AisTarget(1, 100.0, 60.0, 0.0, 2.0, 14.0, 3.0, 0.0), seen=(saw,))) is is_added


@given(st.floats(-math.pi, math.pi), st.floats(4.0, 60.0), st.floats(1.0, 4.0), st.floats(0.0, 10.0))
def test_the_room_that_it_takes_holds_its_hull(
    course_rad: float, length_m: float, beam_m: float, then_s: float
) -> None:
    """Now and later: from any point of the hull's outline there is no clearance left."""
    [vessel] = unseen(AisTarget(1, 60.0, 50.0, course_rad, 2.0, length_m, beam_m, 3.0))
    along_m, across_m = np.meshgrid(np.linspace(-0.5, 0.5, 40) * length_m, np.array([-0.5, 0.5]) * beam_m)
    cos, sin = math.cos(course_rad), math.sin(course_rad)
    x_m = 60.0 + (along_m + 2.0 * then_s) * cos - across_m * sin
    y_m = 50.0 + (along_m + 2.0 * then_s) * sin + across_m * cos
    clearance_m = predicted_clearance_m(vessel, x_m, y_m, np.full(x_m.shape, then_s))
    assert clearance_m.max() < 0.3 * beam_m - POSITION_STD_M
