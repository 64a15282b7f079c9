"""Corridors stay level with the horizon while the boat rolls."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paani import messages as m
from paani.config import CorridorConfig
from paani_services.perception.corridors import OBSTACLE, SKY, WATER, summarise_corridors
from paani_services.perception.roll_compensation import level_mask, limit_roll_rad
from paani_services.perception.service import roll_at_capture_rad

HEIGHT, WIDTH = 64, 80
SURE = np.ones((HEIGHT, WIDTH), np.float32)
ALL = np.ones((HEIGHT, WIDTH), np.float32)  # every cell visible


def rolled_scene(roll_rad: float, aspect: float) -> np.ndarray:
    """What a camera with that roll sees: sky above the horizon, water below it, a bank to port."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    right = (x - (WIDTH - 1) / 2) * aspect * HEIGHT / WIDTH
    down = y - (HEIGHT - 1) / 2
    level_right = right * math.cos(roll_rad) - down * math.sin(roll_rad)
    level_down = right * math.sin(roll_rad) + down * math.cos(roll_rad)
    scene = np.where(level_down < -10.0, SKY, WATER)
    return np.where((level_down >= -10.0) & (level_right < -25.0), OBSTACLE, scene).astype(np.uint8)


@pytest.mark.parametrize("aspect", [4 / 3, 16 / 9])
@pytest.mark.parametrize("roll_deg", [-12.0, -4.0, 4.0, 12.0])
def test_levelled_corridors_equal_those_of_an_even_keel(roll_deg: float, aspect: float) -> None:
    """Starboard down, and the horizon rises to the right: the levelled corridors are those of an even keel."""
    roll_rad = math.radians(roll_deg)
    even = summarise_corridors(rolled_scene(0.0, aspect), SURE, CorridorConfig())
    seen = rolled_scene(roll_rad, aspect)
    if roll_deg > 0:
        assert (seen[: HEIGHT // 2, -1] == SKY).sum() < (seen[: HEIGHT // 2, WIDTH // 2] == SKY).sum()
    flat = level_mask(seen, SURE, ALL, roll_rad, aspect)
    followed = summarise_corridors(flat.mask, flat.confidence, CorridorConfig(), flat.visible_frac)
    for lane in ("left", "center", "right"):
        assert getattr(followed, lane).non_water == pytest.approx(getattr(even, lane).non_water, abs=0.04)
    if abs(roll_deg) > 10:
        unfollowed = summarise_corridors(seen, SURE, CorridorConfig())
        assert abs(unfollowed.left.non_water - even.left.non_water) > 0.05


def test_without_roll_the_mask_is_returned_unchanged() -> None:
    mask = rolled_scene(0.1, 4 / 3)
    assert level_mask(mask, SURE, ALL, 0.0, 4 / 3).mask is mask


def test_roll_is_used_only_near_the_capture_and_up_to_its_limit() -> None:
    odometry = m.Odometry(source_us=1_000_000, x_m=0, y_m=0, yaw_rad=0, surge_mps=0, roll_rad=0.1)
    assert roll_at_capture_rad(1_200_000, odometry, 0.3) == 0.1
    assert roll_at_capture_rad(1_400_000, odometry, 0.3) == 0.0
    assert roll_at_capture_rad(1_000_000, None, 0.3) == 0.0
    assert limit_roll_rad(-0.9, 0.35) == -0.35
