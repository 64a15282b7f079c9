"""The lens: distortion there and back, motion, white balance; and rain before it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.errors import UserError
from paani_sim.eye import BoatPose, Camera, project
from paani_sim.eye.camera import FAR_M, NEAR_M, linear_depth_m
from paani_sim.eye.lens import Lens
from paani_sim.eye.optics import Optics
from paani_sim.eye.rain import Rain, extinction_per_m

POSE = BoatPose(0.0, 0.0, 0.0)
GREY = np.full((240, 320, 3), 120, np.uint8)


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.15, 0.15), st.floats(0.0, 0.06), st.floats(-0.45, 0.45), st.floats(-0.3, 0.3))
@pytest.mark.slow
def test_what_the_lens_shows_is_where_projection_says(k1: float, k2: float, left: float, up: float) -> None:
    """A point projected through the lens lands on the pixel that samples the pinhole's picture of it, within one."""
    camera = Camera(k1=k1, k2=k2)
    optics = Optics(camera, 2.0)
    point = np.array([[20.55, 20.0 * left, 0.9 + 20.0 * (up - 0.1)]])
    u, v = project(point, POSE, camera)[0]
    if not (4.0 < u < 316.0 and 4.0 < v < 236.0):
        return
    drawn = project(point, POSE, optics.pinhole)[0] * 2.0
    rows, columns = np.mgrid[0:480, 0:640].astype(np.float32)
    assert float(optics.nearest(columns)[int(v), int(u)]) == pytest.approx(drawn[0], abs=4.0)
    assert float(optics.nearest(rows)[int(v), int(u)]) == pytest.approx(drawn[1], abs=4.0)


def test_no_distortion_is_a_pinhole() -> None:
    camera = Camera()
    assert Optics(camera, 1.5).pinhole == camera
    assert np.array_equal(Optics(camera, 1.0).picture(GREY), GREY)


@pytest.mark.slow
def test_barrel_draws_wider_and_leaves_no_border() -> None:
    optics = Optics(Camera(k1=-0.15), 1.0)
    assert optics.pinhole.hfov_deg > 72.0
    assert (optics.picture(GREY) == 120).all()


def test_a_lens_that_folds_is_refused() -> None:
    with pytest.raises(UserError, match=r"k1=-0\.9"):
        Optics(Camera(k1=-0.9), 1.0)


def test_depth_values_become_metres() -> None:
    for ahead in (0.5, 3.0, 80.0):
        ndc = (FAR_M + NEAR_M - 2.0 * FAR_M * NEAR_M / ahead) / (FAR_M - NEAR_M)
        assert linear_depth_m(np.array([0.5 + 0.5 * ndc], np.float32))[0] == pytest.approx(ahead, rel=2e-3)
    assert np.isinf(linear_depth_m(np.array([1.0], np.float32)))[0]


def test_a_turn_smears_sideways_only() -> None:
    picture = GREY.copy()
    picture[:, 160:] = 220
    picture[:120] //= 2
    still = Lens(320, 240, 1).apply(picture, 5).astype(float)
    moved = Lens(320, 240, 1).apply(picture, 5, smear_px=9.0).astype(float)
    assert np.abs(np.diff(moved[180, 150:170, 0])).max() < 0.5 * np.abs(np.diff(still[180, 150:170, 0])).max()
    assert np.abs(np.diff(moved[110:130, 40, 0])).max() > 0.8 * np.abs(np.diff(still[110:130, 40, 0])).max()


def test_white_balance_scales_channels() -> None:
    plain = Lens(320, 240, 1).apply(GREY, 5).mean(axis=(0, 1))
    warm = Lens(320, 240, 1, balance=(0.8, 1.0, 1.2)).apply(GREY, 5).mean(axis=(0, 1))
    assert warm / plain == pytest.approx([0.8, 1.0, 1.2], rel=0.02)


def test_rain_repeats_grows_and_stops() -> None:
    rain = Rain(320, 240, 4)
    assert rain.apply(GREY, 0.0, 3.0) is GREY
    picture = np.random.default_rng(1).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    light, heavy = rain.apply(picture, 2.0, 3.0), rain.apply(picture, 25.0, 3.0)
    assert np.array_equal(heavy, Rain(320, 240, 4).apply(picture, 25.0, 3.0))
    assert not np.array_equal(heavy, rain.apply(picture, 25.0, 3.2))
    change = [np.abs(seen.astype(int) - picture).mean() for seen in (light, heavy)]
    assert 0.0 < change[0] < change[1]


def test_heavy_rain_takes_the_light_within_a_kilometre() -> None:
    """Atlas (1953): 25 mm/h leaves 1/e after about 700 m."""
    assert 1.0 / extinction_per_m(25.0) == pytest.approx(690.0, rel=0.05)
