"""Angles and the tangent plane, against pymap3d."""

from __future__ import annotations

import math

import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.geometry import clip, enu_from_geodetic, geodetic_from_enu, heading_true_deg, wrap_rad


@given(st.floats(-1e3, 1e3))
def test_wrapping_keeps_the_direction(angle: float) -> None:
    wrapped = wrap_rad(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@pytest.mark.parametrize(("yaw_rad", "heading_deg"), [(0.0, 90.0), (math.pi / 2, 0.0), (math.pi, 270.0)])
def test_east_is_ninety(yaw_rad: float, heading_deg: float) -> None:
    assert heading_true_deg(yaw_rad) == pytest.approx(heading_deg)


@given(st.floats(-60, 60), st.floats(-170, 170), st.floats(-500, 500), st.floats(-500, 500))
def test_the_plane_agrees_with_pymap3d(latitude: float, longitude: float, x_m: float, y_m: float) -> None:
    """L2: GPS to the local frame; within 0.1 m half a kilometre out."""
    lat, lon = geodetic_from_enu(x_m, y_m, latitude, longitude)
    east, north, _ = pymap3d.geodetic2enu(lat, lon, 0.0, latitude, longitude, 0.0)
    assert (east, north) == pytest.approx((x_m, y_m), abs=0.1)
    assert enu_from_geodetic(lat, lon, latitude, longitude) == pytest.approx((x_m, y_m), abs=1e-6)


def test_l2_east_goes_on_across_the_date_line() -> None:
    assert enu_from_geodetic(0.0, -179.999, 0.0, 179.999) == pytest.approx((222.64, 0.0), abs=0.1)


def test_clip() -> None:
    assert [clip(v, -1.0, 1.0) for v in (-2.0, 0.5, 3.0)] == [-1.0, 0.5, 1.0]
