"""Inverse perspective projection: the rays of a pinhole camera meet the water surface (Q1). Pure.

The body frame is x forward, y left, z up (REP-103) with its origin on the water; positive pitch lowers the bow and
positive roll lowers the starboard side. Only elementary arithmetic is used, element by element, so that every machine
computes the same bits: there is no reduction whose order could differ.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from paani import portable
from paani.arrays import F64
from paani.config import CalibrationConfig

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]  # by rows
MIN_DESCENT = 1e-6  # tangent below the horizontal; a flatter ray does not meet the water


class Pose(NamedTuple):
    """Position of the boat in the map, and its attitude."""

    x_m: float
    y_m: float
    yaw_rad: float
    roll_rad: float
    pitch_rad: float


class PinholeCamera(NamedTuple):
    """A pinhole camera in the map: map-from-camera rotation, position [m], focal lengths and principal point.

    Camera axes are outward, right and down. Focal lengths and principal point are fractions of the picture's width and
    height.
    """

    rotation: Matrix
    position_m: Vector
    focal: tuple[float, float]
    centre: tuple[float, float]


class Rays(NamedTuple):
    """Rays as unit directions along the water, east and north, and the tangent of their angle below the horizontal."""

    east: F64
    north: F64
    descent: F64


@functools.lru_cache(maxsize=64)
def pinhole_at(pose: Pose, calibration: CalibrationConfig, aspect: float) -> PinholeCamera:
    """The calibrated camera of a boat with this pose. aspect: picture width over height; pixels are square."""
    body = rotation_matrix(pose.roll_rad, pose.pitch_rad, pose.yaw_rad)
    mount = rotation_matrix(*map(math.radians, (calibration.roll_deg, calibration.pitch_down_deg, calibration.yaw_deg)))
    rotation = _product(_product(body, mount), ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))
    ahead, above = calibration.forward_m, calibration.height_m
    east, north, up = (row[0] * ahead + row[2] * above for row in body)
    focal = 0.5 / portable.tan(0.5 * math.radians(calibration.hfov_deg))
    position_m = (pose.x_m + east, pose.y_m + north, up)
    return PinholeCamera(rotation, position_m, (focal, focal * aspect), calibration.centre_frac)


def rotation_matrix(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Matrix:
    """The rotation matrix of yaw about z, then pitch about y, then roll about x, by rows."""
    cr, sr = portable.cos(roll_rad), portable.sin(roll_rad)
    cp, sp = portable.cos(pitch_rad), portable.sin(pitch_rad)
    cy, sy = portable.cos(yaw_rad), portable.sin(yaw_rad)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def pixel_rays(camera: PinholeCamera, u: F64, v: F64) -> Rays:
    """The rays r = R K^-1 [u, v, 1] of points of the picture (Q1).

    u, v: fractions of the picture's width and height.
    """
    right = (u - camera.centre[0]) / camera.focal[0]
    down = (v - camera.centre[1]) / camera.focal[1]
    east, north, up = (row[0] + row[1] * right + row[2] * down for row in camera.rotation)
    along = np.sqrt(east * east + north * north)
    along = np.where(along > MIN_DESCENT, along, MIN_DESCENT)
    return Rays(east / along, north / along, -up / along)


def ranges_to_water_m(camera: PinholeCamera, rays: Rays, max_range_m: float) -> F64:
    """Distance along the water from below the camera to where each ray meets it (Q1).

    It is infinite for rays at or above the horizon and for rays that meet the water beyond `max_range_m`.
    """
    meets = rays.descent > MIN_DESCENT
    range_m = camera.position_m[2] / np.where(meets, rays.descent, 1.0)
    return np.where(meets & (range_m > 0.0) & (range_m <= max_range_m), range_m, np.inf)


def _product(a: Matrix, b: Matrix) -> Matrix:
    first, second, third = (
        (
            row[0] * b[0][0] + row[1] * b[1][0] + row[2] * b[2][0],
            row[0] * b[0][1] + row[1] * b[1][1] + row[2] * b[2][1],
            row[0] * b[0][2] + row[1] * b[1][2] + row[2] * b[2][2],
        )
        for row in a
    )
    return first, second, third
