"""The chain of frames puts boat and camera where the estimate and the navigator have them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from paani.config import CalibrationConfig
from paani.logs import protobuf as pb
from paani_services.foxglove.transforms import camera_calibration, transforms
from paani_services.navigator.mapping.projection import Pose, pinhole_at
from tests.unit.paani_services.foxglove.seen import CALIBRATION, NOW_US, decoded, header, odometry

LOCAL = odometry(x_m=3.0, y_m=1.5, yaw_rad=-0.4, latitude_deg=0.0, longitude_deg=0.0)
Matrix = NDArray[np.float64]


def matrix(transform: Any) -> Matrix:
    """Homogeneous, of a foxglove.FrameTransform: from the child's frame to the parent's."""
    x, y, z, w = (getattr(transform.rotation, axis) for axis in "xyzw")
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    found = np.eye(4)
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found[:3, 3] = [transform.translation.x, transform.translation.y, transform.translation.z]
    return found


def chain(calibration: CalibrationConfig = CALIBRATION) -> dict[tuple[str, str], Matrix]:
    sent = decoded(pb.FRAME_TRANSFORMS, transforms(odometry(), LOCAL, calibration)).transforms
    assert {each.timestamp.ToMicroseconds() for each in sent} == {NOW_US}
    return {(each.parent_frame_id, each.child_frame_id): matrix(each) for each in sent}


def test_the_boat_is_where_the_estimate_has_it() -> None:
    found = chain()
    boat = found["map", "odom"] @ found["odom", "base_link"]
    assert boat[:3, 3] == pytest.approx([12.0, -5.0, 0.0])
    assert np.arctan2(boat[1, 0], boat[0, 0]) == pytest.approx(0.7)
    assert np.arcsin(-boat[2, 0]) == pytest.approx(-0.03), "the pitch of the estimate"
    assert found["odom", "base_link"][:2, 3] == pytest.approx([3.0, 1.5]), "the local estimate does not jump"


def test_the_camera_looks_where_the_navigator_has_it_look() -> None:
    """Two derivations: quaternions here, the matrices of the navigator's projection there."""
    found = chain()
    camera = found["map", "odom"] @ found["odom", "base_link"] @ found["base_link", "camera_optical"]
    there = pinhole_at(Pose(12.0, -5.0, 0.7, 0.05, -0.03), CALIBRATION, 320 / 240)
    ahead, right, down = np.array(there.rotation).T
    assert pytest.approx(np.array([right, down, ahead]), abs=1e-9) == camera[:3, :3].T
    assert camera[:3, 3] == pytest.approx(there.position_m, abs=1e-9)


def test_an_unmeasured_camera_has_no_place() -> None:
    unmeasured = CalibrationConfig(hfov_deg=70.0, height_m=0.9)
    assert set(chain(unmeasured)) == {("map", "odom"), ("odom", "base_link")}
    assert camera_calibration(header(), unmeasured) is None


def test_the_lens_is_the_calibrations() -> None:
    """A ray at half the field of view meets the edge of the picture."""
    lens = camera_calibration(header(), CALIBRATION)
    assert lens is not None
    found = decoded(pb.CAMERA_CALIBRATION, lens)
    focal_px, centre_px = found.K[0], found.K[2]
    assert centre_px + focal_px * np.tan(np.radians(35.0)) == pytest.approx(320.0)
    assert (found.K[4], found.K[5], found.P[0], found.P[6]) == (focal_px, 120.0, focal_px, 120.0)
    assert (found.width, found.height, found.frame_id) == (320, 240, "camera_optical")
    assert found.timestamp.ToMicroseconds() == header().source_us
