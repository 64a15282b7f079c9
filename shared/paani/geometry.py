"""Angles and the local tangent plane. Map frame: ENU; angles counter-clockwise from east [rad]."""

from __future__ import annotations

import math

from paani import portable

# WGS 84 (NIMA TR8350.2, table 3.1): semi-major axis [m], first eccentricity squared.
SEMI_MAJOR_M = 6_378_137.0
ECCENTRICITY2 = 6.694379990141317e-3
MAX_ORIGIN_LATITUDE_DEG = 85.0  # nearer to a pole a degree of longitude is too short for a plane


def wrap_rad(angle: float) -> float:
    """The same angle in [-pi, pi]; pi only where rounding makes it."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def clip(value: float, low: float, high: float) -> float:
    """`value`, no less than `low` and no more than `high`."""
    return low if value < low else min(value, high)


def heading_true_deg(yaw_rad: float) -> float:
    """Compass heading, clockwise from true north, in [0, 360), of an ENU yaw."""
    return (90.0 - math.degrees(yaw_rad)) % 360.0 % 360.0  # the first of a tiny negative angle rounds to 360


def enu_from_geodetic(
    latitude_deg: float, longitude_deg: float, origin_latitude_deg: float, origin_longitude_deg: float
) -> tuple[float, float]:
    """East and north [m] of a point near the origin, on the tangent plane's radii of curvature.

    Second-order terms are left out: below 0.1 m within 1 km of the origin at mid latitudes.
    """
    east_m_per_deg, north_m_per_deg = _metres_per_degree(origin_latitude_deg)
    return (
        math.remainder(longitude_deg - origin_longitude_deg, 360.0) * east_m_per_deg,
        (latitude_deg - origin_latitude_deg) * north_m_per_deg,
    )


def geodetic_from_enu(
    x_m: float, y_m: float, origin_latitude_deg: float, origin_longitude_deg: float
) -> tuple[float, float]:
    """Inverse of `enu_from_geodetic`: latitude, and longitude within 180 [deg]."""
    east_m_per_deg, north_m_per_deg = _metres_per_degree(origin_latitude_deg)
    longitude_deg = math.remainder(origin_longitude_deg + x_m / east_m_per_deg, 360.0)
    return origin_latitude_deg + y_m / north_m_per_deg, longitude_deg


def _metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    sine = portable.sin(math.radians(latitude_deg))
    w2 = 1.0 - ECCENTRICITY2 * sine * sine
    prime_vertical_m = SEMI_MAJOR_M / math.sqrt(w2)
    meridian_m = prime_vertical_m * (1.0 - ECCENTRICITY2) / w2
    cosine = portable.cos(math.radians(latitude_deg))
    return math.radians(prime_vertical_m * cosine), math.radians(meridian_m)


def quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> dict[str, float]:
    """Of a rotation about z, then y, then x."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return {
        "x": sr * cp * cy - cr * sp * sy,
        "y": cr * sp * cy + sr * cp * sy,
        "z": cr * cp * sy - sr * sp * cy,
        "w": cr * cp * cy + sr * sp * sy,
    }
