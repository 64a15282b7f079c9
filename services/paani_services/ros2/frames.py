"""Frames of the port by REP 103 and REP 105, and the rotations between them. Pure.

`map` and `odom`: x east, y north, z up. `base_link`: x ahead, y to port, z up, at the point whose position the odometry
gives. `camera_optical`: x right, y down, z outward.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from paani.config import CalibrationConfig
from paani.geometry import quaternion


class Vector(NamedTuple):
    x: float
    y: float
    z: float


class Quaternion(NamedTuple):
    """A rotation, of length 1."""

    x: float
    y: float
    z: float
    w: float


class Transform(NamedTuple):
    """Where a child frame lies in its parent: a point of the child turned by `rotation`, then moved [m]."""

    translation_m: Vector
    rotation: Quaternion


class Frames(NamedTuple):
    """Names of the frames. `prefix` keeps the frames of several boats in one graph apart."""

    prefix: str = ""

    @property
    def map(self) -> str:
        return f"{self.prefix}map"

    @property
    def odom(self) -> str:
        return f"{self.prefix}odom"

    @property
    def base_link(self) -> str:
        return f"{self.prefix}base_link"

    @property
    def camera_optical(self) -> str:
        return f"{self.prefix}camera_optical"


# From the camera's mount, which looks along x with z up, to its optical axes.
OPTICAL = Quaternion(-0.5, 0.5, -0.5, 0.5)


def rotation_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Yaw about z, then pitch about y (bow down positive), then roll about x (starboard down positive)."""
    return Quaternion(**quaternion(roll_rad, pitch_rad, yaw_rad))


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    return Quaternion(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    )


def inverse(rotation: Quaternion) -> Quaternion:
    """The rotation back."""
    return Quaternion(-rotation.x, -rotation.y, -rotation.z, rotation.w)


def rotate(rotation: Quaternion, vector: Vector) -> Vector:
    """The vector turned."""
    turned = product(product(rotation, Quaternion(*vector, 0.0)), inverse(rotation))
    return Vector(turned.x, turned.y, turned.z)


def parent_between(outer: Transform, inner: Transform) -> Transform:
    """Where the parent of `inner` lies in the parent of `outer`, both of one child: `map` to `odom` by `base_link`."""
    rotation = product(outer.rotation, inverse(inner.rotation))
    moved = rotate(rotation, inner.translation_m)
    return Transform(Vector(*(a - b for a, b in zip(outer.translation_m, moved, strict=True))), rotation)


def camera_mount(calibration: CalibrationConfig) -> Transform:
    """The camera's optical frame on the boat; of a valid calibration."""
    mount = (calibration.roll_deg, calibration.pitch_down_deg, calibration.yaw_deg)
    rotation = product(rotation_of(*map(math.radians, mount)), OPTICAL)
    return Transform(Vector(calibration.forward_m, 0.0, calibration.height_m), rotation)
