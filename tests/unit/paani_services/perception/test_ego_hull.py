"""The own hull in the picture is no evidence, and nothing hidden by it becomes free water."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import CorridorConfig, load_config
from paani.errors import UserError
from paani_services.perception.corridors import OBSTACLE, SKY, WATER, summarise_corridors
from paani_services.perception.ego_hull import compute_visible_fractions, is_own_hull
from paani_services.perception.roll_compensation import level_mask

HEIGHT, WIDTH = 64, 80
BOW = ((0.25, 1.0), (0.4, 0.8), (0.6, 0.8), (0.75, 1.0))
SURE = np.ones((HEIGHT, WIDTH), np.float32)
ALL = compute_visible_fractions((), HEIGHT, WIDTH)


def test_the_own_hull_is_no_obstacle() -> None:
    """A bow in the picture reads as obstacle; inside the polygon it is no evidence, the water beside it is."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    bow = compute_visible_fractions(BOW, HEIGHT, WIDTH) < 0.5
    mask[bow] = OBSTACLE
    assert summarise_corridors(mask, SURE, CorridorConfig()).center.non_water > 0.1
    assert (
        summarise_corridors(
            mask, SURE, CorridorConfig(), compute_visible_fractions(BOW, HEIGHT, WIDTH)
        ).center.non_water
        < 0.02
    )


@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=3, max_size=6),
    st.floats(-0.35, 0.35),
    st.integers(0, 2**32 - 1),
)
@pytest.mark.slow
def test_hidden_cells_never_count_as_water(corners: list[tuple[float, float]], roll_rad: float, seed: int) -> None:
    """An obstacle all over stays blocked in every corridor, whatever polygon and roll: nothing becomes free."""
    mask = np.full((HEIGHT, WIDTH), np.random.default_rng(seed).choice([OBSTACLE, SKY]), np.uint8)
    flat = level_mask(mask, SURE, compute_visible_fractions(tuple(corners), HEIGHT, WIDTH), roll_rad, 4 / 3)
    for lane in summarise_corridors(flat.mask, flat.confidence, CorridorConfig(), flat.visible_frac):
        assert lane.non_water == 1.0
        assert lane.clear_width == 0.0


def test_a_corridor_that_is_hidden_is_blocked() -> None:
    hull = ((0.3, 0.3), (0.7, 0.3), (0.7, 1.0), (0.3, 1.0))
    lanes = summarise_corridors(
        np.zeros((HEIGHT, WIDTH), np.uint8), SURE, CorridorConfig(), compute_visible_fractions(hull, HEIGHT, WIDTH)
    )
    assert lanes.center == m.LaneEvidence()
    assert lanes.left.non_water == lanes.right.non_water == 0.0


@pytest.mark.parametrize(("visible", "is_seen"), [(0.49, False), (0.51, True), (1.0, True)])
def test_a_corridor_of_which_less_than_half_is_seen_is_blocked(visible: float, *, is_seen: bool) -> None:
    """However clear the water is that shows."""
    water = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    for lane in summarise_corridors(water, SURE, CorridorConfig(), SURE * np.float32(visible)):
        assert lane.non_water == pytest.approx(0.0 if is_seen else 1.0, abs=1e-6)
        assert lane.clear_width == pytest.approx(1.0 if is_seen else 0.0)


@pytest.mark.parametrize(
    ("box", "own"),
    [
        ((0.42, 0.85, 0.58, 1.0), True),  # on the bow
        ((0.30, 0.60, 0.70, 1.0), False),  # in front of it and behind it
        ((0.0, 0.9, 0.1, 1.0), False),  # beside it
        ((0.5, 0.9, 0.5001, 0.9001), True),  # smaller than a cell
    ],
)
def test_a_box_on_the_own_hull_is_recognised(box: m.BoxXyxy, own: bool) -> None:
    assert is_own_hull(box, compute_visible_fractions(BOW, HEIGHT, WIDTH)) is own
    assert not is_own_hull(box, ALL)


def test_an_ego_polygon_with_two_corners_is_refused() -> None:
    with pytest.raises(UserError, match="ego_polygon: 2 corners"):
        load_config(sets=["perception.ego_polygon=[[0.1, 0.9], [0.9, 0.9]]"])
