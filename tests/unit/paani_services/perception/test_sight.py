"""Own hull and roll: what counts of a picture, and corridors that stay level."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import CorridorConfig, load_config
from paani.errors import UserError
from paani_services.perception.corridors import OBSTACLE, SKY, WATER, summarise, water_edge
from paani_services.perception.service import roll_at
from paani_services.perception.sight import counted, followed_roll_rad, is_own_hull, level

HEIGHT, WIDTH = 64, 80
BOW = ((0.25, 1.0), (0.4, 0.8), (0.6, 0.8), (0.75, 1.0))
SURE = np.ones((HEIGHT, WIDTH), np.float32)
ALL = counted((), HEIGHT, WIDTH)


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
def test_corridors_follow_the_horizon(roll_deg: float, aspect: float) -> None:
    """Starboard down, and the horizon rises to the right: the levelled corridors are those of an even keel."""
    roll_rad = math.radians(roll_deg)
    even = summarise(rolled_scene(0.0, aspect), SURE, CorridorConfig())
    seen = rolled_scene(roll_rad, aspect)
    if roll_deg > 0:
        assert (seen[: HEIGHT // 2, -1] == SKY).sum() < (seen[: HEIGHT // 2, WIDTH // 2] == SKY).sum()
    flat = level(seen, SURE, ALL, roll_rad, aspect)
    followed = summarise(flat.mask, flat.confidence, CorridorConfig(), flat.counts)
    for lane in ("left", "center", "right"):
        assert getattr(followed, lane).non_water == pytest.approx(getattr(even, lane).non_water, abs=0.04)
    if abs(roll_deg) > 10:
        unfollowed = summarise(seen, SURE, CorridorConfig())
        assert abs(unfollowed.left.non_water - even.left.non_water) > 0.05


def test_no_roll_changes_no_bit() -> None:
    mask = rolled_scene(0.1, 4 / 3)
    assert level(mask, SURE, ALL, 0.0, 4 / 3).mask is mask


def test_the_own_bow_is_no_obstacle() -> None:
    """A bow in the picture reads as obstacle; inside the polygon it is no evidence, the water beside it is."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    bow = counted(BOW, HEIGHT, WIDTH) < 0.5
    mask[bow] = OBSTACLE
    assert summarise(mask, SURE, CorridorConfig()).center.non_water > 0.1
    assert summarise(mask, SURE, CorridorConfig(), counted(BOW, HEIGHT, WIDTH)).center.non_water < 0.02


@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=3, max_size=6),
    st.floats(-0.35, 0.35),
    st.integers(0, 2**32 - 1),
)
def test_what_is_left_out_is_never_water(corners: list[tuple[float, float]], roll_rad: float, seed: int) -> None:
    """An obstacle all over stays blocked in every corridor, whatever polygon and roll: nothing becomes free."""
    mask = np.full((HEIGHT, WIDTH), np.random.default_rng(seed).choice([OBSTACLE, SKY]), np.uint8)
    flat = level(mask, SURE, counted(tuple(corners), HEIGHT, WIDTH), roll_rad, 4 / 3)
    for lane in summarise(flat.mask, flat.confidence, CorridorConfig(), flat.counts):
        assert lane.non_water == 1.0
        assert lane.clear_width == 0.0


def test_a_corridor_that_cannot_be_seen_is_blocked() -> None:
    hull = ((0.3, 0.3), (0.7, 0.3), (0.7, 1.0), (0.3, 1.0))
    lanes = summarise(np.zeros((HEIGHT, WIDTH), np.uint8), SURE, CorridorConfig(), counted(hull, HEIGHT, WIDTH))
    assert lanes.center == m.LaneEvidence()
    assert lanes.left.non_water == lanes.right.non_water == 0.0


def test_where_the_water_ends_in_each_column() -> None:
    """The lower edge of what lies lowest above the water, however much water shows again behind it."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[:16] = SKY
    mask[32:40, 10] = OBSTACLE  # water again above it
    mask[60:, 11] = OBSTACLE
    mask[:, 12] = WATER
    edge = water_edge(mask, ALL)
    assert edge[:10] == (0.25,) * 10
    assert edge[10:14] == (40 / 64, 1.0, 0.0, 0.25)


def test_a_glint_near_the_boat_ends_nothing() -> None:
    """Up to three cells with water all round, in the lowest third; what is larger, higher up or reaches up ends it."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[:16] = SKY
    mask[62, 5:8] = OBSTACLE
    mask[50, 20] = mask[51, 21] = OBSTACLE
    mask[60:, 30] = OBSTACLE  # four cells
    mask[30, 40] = OBSTACLE  # far away, a swimmer's head
    mask[16:64, 50] = OBSTACLE  # a pole
    edge = water_edge(mask, ALL)
    assert set(edge[5:8] + edge[20:22]) == {0.25}
    assert (edge[30], edge[40], edge[50]) == (1.0, 31 / 64, 1.0)


def test_the_own_hull_does_not_end_the_water() -> None:
    """Skipped where it lies in front of water; a column of nothing else has no water."""
    hull = np.ones((HEIGHT, WIDTH), np.float32)
    hull[48:, 20:30], hull[:, 40] = 0.0, 0.0
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[hull == 0.0] = OBSTACLE
    mask[40:48, 29] = OBSTACLE
    edge = water_edge(mask, hull)
    assert edge[20:29] == (0.0,) * 9
    assert (edge[29], edge[40]) == (48 / 64, 1.0)


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.floats(0.0, 1.0))
def test_no_water_below_the_edge_is_anything_else(seed: int, bare: int, watery: float) -> None:
    """Below its edge each column is water or own hull, and just above it is not. Cells in fours: none is a speck."""
    random = np.random.default_rng(seed)
    coarse = np.where(random.random((HEIGHT // 2, WIDTH // 2)) < watery, WATER, OBSTACLE).astype(np.uint8)
    mask = coarse.repeat(2, axis=0).repeat(2, axis=1)
    counts = np.ones((HEIGHT, WIDTH), np.float32)
    counts[HEIGHT - 2 * bare :, ::4] = counts[HEIGHT - 2 * bare :, 1::4] = 0.0
    for column, edge in enumerate(water_edge(mask, counts)):
        row = round(edge * HEIGHT)
        assert set(mask[row:, column][counts[row:, column] > 0].tolist()) <= {WATER}
        assert row == 0 or mask[row - 1, column] != WATER or not counts[:, column].any()


@pytest.mark.parametrize(
    ("box", "own"),
    [
        ((0.42, 0.85, 0.58, 1.0), True),  # on the bow
        ((0.30, 0.60, 0.70, 1.0), False),  # in front of it and behind it
        ((0.0, 0.9, 0.1, 1.0), False),  # beside it
        ((0.5, 0.9, 0.5001, 0.9001), True),  # smaller than a cell
    ],
)
def test_a_box_on_the_own_hull(box: m.BoxXyxy, own: bool) -> None:
    assert is_own_hull(box, counted(BOW, HEIGHT, WIDTH)) is own
    assert not is_own_hull(box, ALL)


def test_a_polygon_with_two_corners_is_refused() -> None:
    with pytest.raises(UserError, match="ego_polygon: 2 corners"):
        load_config(sets=["perception.ego_polygon=[[0.1, 0.9], [0.9, 0.9]]"])


def test_roll_is_known_only_near_the_picture() -> None:
    odometry = m.Odometry(source_us=1_000_000, x_m=0, y_m=0, yaw_rad=0, surge_mps=0, roll_rad=0.1)
    assert roll_at(1_200_000, odometry, 0.3) == 0.1
    assert roll_at(1_400_000, odometry, 0.3) == 0.0
    assert roll_at(1_000_000, None, 0.3) == 0.0
    assert followed_roll_rad(-0.9, 0.35) == -0.35
