"""Frames by REP 103 and REP 105: against the rotation matrices that the navigator maps the water with, and scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from paani.config import CalibrationConfig
from paani_services.navigator.mapping.projection import Pose, pinhole_at
from paani_services.ros2.frames import (
    Frames,
    Quaternion,
    Transform,
    Vector,
    camera_mount,
    parent_between,
    product,
    rotate,
    rotation_of,
)

ANGLE = st.floats(-math.pi, math.pi)
TILT = st.floats(-1.0, 1.0)
METRES = st.floats(-1e4, 1e4)
ROTATIONS = st.builds(rotation_of, TILT, TILT, ANGLE)
TRANSFORMS = st.builds(Transform, st.builds(Vector, METRES, METRES, METRES), ROTATIONS)


def moved(transform: Transform, point: Vector) -> Vector:
    """A point of the child in the parent."""
    turned = rotate(transform.rotation, point)
    return Vector(*(a + b for a, b in zip(turned, transform.translation_m, strict=True)))


@given(TILT, TILT, ANGLE)
def test_a_rotation_is_yaw_then_pitch_then_roll(roll_rad: float, pitch_rad: float, yaw_rad: float) -> None:
    found = rotation_of(roll_rad, pitch_rad, yaw_rad)
    expected = Rotation.from_euler("ZYX", (yaw_rad, pitch_rad, roll_rad))
    assert math.hypot(*found) == pytest.approx(1.0)
    assert (Rotation.from_quat(found) * expected.inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


@given(ROTATIONS, ROTATIONS)
def test_a_product_turns_by_the_second_first(a: Quaternion, b: Quaternion) -> None:
    expected = Rotation.from_quat(a) * Rotation.from_quat(b)
    assert (Rotation.from_quat(product(a, b)) * expected.inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


def test_a_heading_to_port_turns_ahead_to_the_left() -> None:
    ahead = rotate(rotation_of(0.0, 0.0, math.pi / 2), Vector(1.0, 0.0, 0.0))
    assert ahead == pytest.approx((0.0, 1.0, 0.0))
    bow_down = rotate(rotation_of(0.0, 0.1, 0.0), Vector(1.0, 0.0, 0.0))
    assert bow_down.z == pytest.approx(-math.sin(0.1))


@given(TRANSFORMS, TRANSFORMS, st.builds(Vector, METRES, METRES, METRES))
@pytest.mark.slow
def test_map_to_odom_closes_the_chain(in_map: Transform, in_odom: Transform, point: Vector) -> None:
    """A point of the boat lies in the same place of the map, by the odometry and by way of `odom`."""
    between = parent_between(in_map, in_odom)
    assert moved(between, moved(in_odom, point)) == pytest.approx(moved(in_map, point), abs=1e-6)


@given(st.floats(-20.0, 40.0), st.floats(-20.0, 20.0), st.floats(-50.0, 50.0), TILT, TILT, ANGLE)
@pytest.mark.slow
def test_the_camera_looks_where_the_navigator_has_it(
    down_deg: float, roll_deg: float, yaw_deg: float, roll_rad: float, pitch_rad: float, heading_rad: float
) -> None:
    calibration = CalibrationConfig(
        valid=True, hfov_deg=70.0, height_m=0.9, forward_m=0.4, pitch_down_deg=down_deg, roll_deg=roll_deg,
        yaw_deg=yaw_deg,
    )  # fmt: skip
    boat = Transform(Vector(3.0, -4.0, 0.0), rotation_of(roll_rad, pitch_rad, heading_rad))
    mount = camera_mount(calibration)
    camera = pinhole_at(Pose(3.0, -4.0, heading_rad, roll_rad, pitch_rad), calibration, 4 / 3)
    assert moved(boat, mount.translation_m) == pytest.approx(camera.position_m)
    rows = np.array(camera.rotation)  # columns: outward, right, down
    rotation = product(boat.rotation, mount.rotation)
    for axis, column in ((Vector(1.0, 0.0, 0.0), 1), (Vector(0.0, 1.0, 0.0), 2), (Vector(0.0, 0.0, 1.0), 0)):
        assert rotate(rotation, axis) == pytest.approx(tuple(rows[:, column]), abs=1e-9)


def test_frames_of_two_boats_have_two_names() -> None:
    assert Frames().base_link == "base_link"
    names = Frames("otter/")
    assert (names.map, names.odom, names.base_link, names.camera_optical) == (
        "otter/map", "otter/odom", "otter/base_link", "otter/camera_optical",
    )  # fmt: skip
