"""Frames of REP-105 for viewers: map -> odom -> base_link -> camera_optical, and the camera's intrinsics. Pure.

Axes are those of REP-103: map and odom east, north, up; base_link ahead, to port, up, its origin on the water;
camera_optical to the right, down, ahead.
"""

from __future__ import annotations

import math

from paani import messages as m
from paani.config import CalibrationConfig
from paani.geometry import quaternion
from paani.logs import protobuf as pb
from paani.logs.viewer import CAMERA_FRAME, MAP_FRAME

ODOM_FRAME, BASE_FRAME = "odom", "base_link"
Quaternion = dict[str, float]
# The rotation from the axes of a camera (right, down, ahead) to those of a body (ahead, to port, up).
OPTICAL: Quaternion = {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5}


def transforms(odometry: m.Odometry, local: m.Odometry, calibration: CalibrationConfig) -> bytes:
    """A foxglove.FrameTransforms: both estimates belong to the same instant, and so does the result.

    The camera has a place on the boat only where its calibration is valid.
    """
    time = pb.timestamp(odometry.source_us)
    turn_rad = odometry.yaw_rad - local.yaw_rad
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    drift = (
        odometry.x_m - (cos * local.x_m - sin * local.y_m),
        odometry.y_m - (sin * local.x_m + cos * local.y_m),
        0.0,
    )
    attitude = quaternion(local.roll_rad, local.pitch_rad, local.yaw_rad)
    chain = [
        _transform(time, MAP_FRAME, ODOM_FRAME, drift, quaternion(0.0, 0.0, turn_rad)),
        _transform(time, ODOM_FRAME, BASE_FRAME, (local.x_m, local.y_m, 0.0), attitude),
    ]
    if calibration.valid:
        at = (calibration.forward_m, 0.0, calibration.height_m)
        chain.append(_transform(time, BASE_FRAME, CAMERA_FRAME, at, camera_rotation(calibration)))
    return pb.encode(pb.FRAME_TRANSFORMS, {"transforms": chain})


def camera_rotation(calibration: CalibrationConfig) -> Quaternion:
    """From camera_optical to base_link."""
    mount = (calibration.roll_deg, calibration.pitch_down_deg, calibration.yaw_deg)
    return multiply(quaternion(*map(math.radians, mount)), OPTICAL)


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Hamilton's product: the rotation `second`, then `first`."""
    a, b = first, second
    return {
        "x": a["w"] * b["x"] + a["x"] * b["w"] + a["y"] * b["z"] - a["z"] * b["y"],
        "y": a["w"] * b["y"] - a["x"] * b["z"] + a["y"] * b["w"] + a["z"] * b["x"],
        "z": a["w"] * b["z"] + a["x"] * b["y"] - a["y"] * b["x"] + a["z"] * b["w"],
        "w": a["w"] * b["w"] - a["x"] * b["x"] - a["y"] * b["y"] - a["z"] * b["z"],
    }


def camera_calibration(header: m.PictureHeader, calibration: CalibrationConfig) -> bytes | None:
    """A foxglove.CameraCalibration of one picture: a pinhole; None where the calibration is not valid."""
    if not calibration.valid or not header.width_px or not header.height_px:
        return None
    focal_px = 0.5 / math.tan(0.5 * math.radians(calibration.hfov_deg)) * header.width_px
    x_px, y_px = calibration.centre_frac[0] * header.width_px, calibration.centre_frac[1] * header.height_px
    fields = {
        "timestamp": pb.timestamp(header.source_us),
        "width": header.width_px,
        "height": header.height_px,
        "K": (focal_px, 0.0, x_px, 0.0, focal_px, y_px, 0.0, 0.0, 1.0),
        "R": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        "P": (focal_px, 0.0, x_px, 0.0, 0.0, focal_px, y_px, 0.0, 0.0, 0.0, 1.0, 0.0),
        "frame_id": CAMERA_FRAME,
    }
    return pb.encode(pb.CAMERA_CALIBRATION, fields)


def _transform(
    time: bytes, parent: str, child: str, at_m: tuple[float, float, float], rotation: Quaternion
) -> dict[str, object]:
    x_m, y_m, z_m = at_m
    return {
        "timestamp": time, "parent_frame_id": parent, "child_frame_id": child,
        "translation": {"x": x_m, "y": y_m, "z": z_m}, "rotation": rotation,
    }  # fmt: skip
