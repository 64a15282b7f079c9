"""Class mask and corridors, against numbers computed by hand; and the water edge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import CorridorConfig
from paani_services.perception.corridors import (
    OBSTACLE,
    SKY,
    WATER,
    classify_cells,
    find_water_edge,
    overlap_fractions,
    summarise_corridors,
)
from paani_services.perception.pipeline import SEGMENTER_CLASSES

HEIGHT, WIDTH = 64, 80
ALL = np.ones((HEIGHT, WIDTH), np.float32)  # every cell visible


def test_e1_softmax() -> None:
    """E1: scores 2, 1, 0: p = e^2 / (e^2 + e + 1) = 0.6652; a temperature flattens it."""
    logits = np.zeros((1, 3, 256, 320), np.float32)
    logits[0, 0], logits[0, 1] = 2.0, 1.0
    mask, confidence = classify_cells(logits, 1.0)
    assert mask.shape == (64, 80)
    assert mask.dtype == np.uint8
    assert mask.max() == 0
    assert confidence == pytest.approx(math.e**2 / (math.e**2 + math.e + 1.0), abs=1e-6)
    assert classify_cells(logits, 2.0)[1] == pytest.approx(math.e / (math.e + math.e**0.5 + 1.0), abs=1e-6)


@pytest.mark.parametrize("size_hw", [(256, 320), (64, 80), (32, 40)])
@pytest.mark.parametrize("label", [WATER, OBSTACLE, SKY])
def test_e1_each_class_may_be_the_label_whatever_the_size_of_the_output(size_hw: tuple[int, int], label: int) -> None:
    """E1: the largest score is 2, the others are 1 and 0."""
    logits = np.zeros((1, 3, *size_hw), np.float32)
    logits[0, label], logits[0, (label + 1) % 3] = 2.0, 1.0
    mask, confidence = classify_cells(logits, 1.0)
    assert (mask == label).all()
    assert confidence == pytest.approx(math.e**2 / (math.e**2 + math.e + 1.0), abs=1e-6)


def test_d6_a_masks_numbers_are_the_places_of_the_classes() -> None:
    assert SEGMENTER_CLASSES == ("water", "obstacle", "sky")
    assert (WATER, OBSTACLE, SKY) == (0, 1, 2)


@pytest.mark.slow
def test_d4_one_pixel_per_cell_represents_the_upscaled_output() -> None:
    """D4: the paper's last step is a nearest resize by four, so argmax and confidence repeat exactly."""
    small = np.random.default_rng(0).normal(size=(1, 3, 64, 80)).astype(np.float32)
    large = small.repeat(4, axis=2).repeat(4, axis=3)
    mask, confidence = classify_cells(large, 1.0)
    exponentials = np.exp(large[0] - large[0].max(axis=0))
    full = (exponentials / exponentials.sum(axis=0)).max(axis=0)
    assert np.array_equal(mask.repeat(4, 0).repeat(4, 1), large[0].argmax(axis=0))
    assert confidence.repeat(4, 0).repeat(4, 1) == pytest.approx(full, abs=1e-6)


def test_e2_e3_cells_on_a_border_count_in_part() -> None:
    """E2, E3: the shares of the cells add up to the exact size of the range."""
    assert overlap_fractions(64, 0.30, 1.0).sum() / 64 == pytest.approx(0.70)
    assert overlap_fractions(80, 0.31, 0.69).sum() / 80 == pytest.approx(0.38)
    assert overlap_fractions(10, 0.25, 0.50) == pytest.approx([0, 0, 0.5, 1, 1, 0, 0, 0, 0, 0])


@pytest.mark.parametrize(
    ("column", "left", "center", "right"),
    [
        (1, 0.0, 0.0, 0.0),
        (2, 0.6, 0.0, 0.0),
        (24, 1.0, 0.2, 0.0),
        (31, 0.2, 1.0, 0.0),
        (48, 0.0, 1.0, 0.2),
        (55, 0.0, 0.2, 1.0),
        (77, 0.0, 0.0, 0.6),
        (78, 0.0, 0.0, 0.0),
    ],
)
def test_e3_each_corridor_has_its_columns(column: int, left: float, center: float, right: float) -> None:
    """E3: of 80 columns [2.4, 31.2], [24.8, 55.2] and [48.8, 77.6]; how much of one column each corridor counts."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:, column] = OBSTACLE
    lanes = summarise_corridors(mask, ALL, CorridorConfig())
    counted = [lanes.left.non_water * 28.8, lanes.center.non_water * 30.4, lanes.right.non_water * 28.8]
    assert counted == pytest.approx([left, center, right], abs=1e-9)


@pytest.mark.parametrize(("row", "counted"), [(18, 0.0), (19, 0.8), (20, 1.0), (63, 1.0)])
def test_e2_the_region_begins_at_its_row(row: int, counted: float) -> None:
    """E2: 0.30 of 64 rows are 19.2."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[row] = OBSTACLE
    for lane in summarise_corridors(mask, ALL, CorridorConfig()):
        assert lane.non_water * 44.8 == pytest.approx(counted, abs=1e-9)


def test_e4_e5_e6_by_hand() -> None:
    """E4-E6: obstacle below sky in the right half, from the top of the region to the bottom."""
    mask = np.zeros((64, 80), np.uint8)
    mask[30:, 40:], mask[:30, 40:] = OBSTACLE, SKY
    confidence = np.full((64, 80), 0.9, np.float32)
    confidence[:, 40:] = 0.6
    lanes = summarise_corridors(mask, confidence, CorridorConfig())
    assert (lanes.left.non_water, lanes.right.non_water) == pytest.approx((0.0, 1.0))
    assert lanes.center.non_water == pytest.approx(0.5)
    assert lanes.center.uncertainty == pytest.approx(0.25, abs=1e-6)
    assert lanes.left.uncertainty == pytest.approx(0.1, abs=1e-6)
    assert (lanes.left.clear_width, lanes.center.clear_width, lanes.right.clear_width) == pytest.approx((1.0, 0.5, 0.0))


@pytest.mark.parametrize("confidence", [0.34, 0.5, 0.97, 1.0])
def test_e4_e5_labels_alone_make_water_and_every_confidence_counts_as_it_is(confidence: float) -> None:
    """E4, E5: water that the network is hardly sure of is water."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:, 40:] = OBSTACLE
    lanes = summarise_corridors(mask, confidence * ALL, CorridorConfig())
    assert [lane.non_water for lane in lanes] == pytest.approx([0.0, 0.5, 1.0])
    assert [lane.uncertainty for lane in lanes] == pytest.approx([1.0 - confidence] * 3, abs=1e-6)


def test_e4_e5_shares_are_of_the_pixels_that_are_water_or_not_and_no_own_hull() -> None:
    """E4, E5: a quarter of each corridor's columns or fewer lie below the own hull, and count for nothing."""
    mask, visible = np.zeros((HEIGHT, WIDTH), np.uint8), ALL.copy()
    mask[:, 46:], visible[:, 34:40] = OBSTACLE, 0.0
    center = summarise_corridors(mask, 0.8 * ALL, CorridorConfig(), visible).center
    assert center.non_water == pytest.approx((55.2 - 46.0) / (30.4 - 6.0))
    assert center.uncertainty == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_e4_e5_e6_corridors_of_cells_are_those_of_the_full_mask(seed: int) -> None:
    """E4, E5, E6: every pixel counted, with the paper's corridors."""
    rng, corridors = np.random.default_rng(seed), CorridorConfig(open_water=False)
    mask = (rng.random((64, 80)) < 0.4).astype(np.uint8)
    mask[:, rng.random(80) < 0.3] = WATER
    confidence = rng.uniform(0.34, 1.0, (64, 80)).astype(np.float32)
    cells = summarise_corridors(mask, confidence, corridors)
    large = mask.repeat(4, 0).repeat(4, 1), confidence.repeat(4, 0).repeat(4, 1)
    full = summarise_corridors(*large, corridors)
    for name in ("non_water", "uncertainty", "clear_width"):
        for one, other in zip(cells, full, strict=True):
            assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-6), name


def test_e2_nothing_above_the_region_counts() -> None:
    mask = np.zeros((64, 80), np.uint8)
    mask[:19] = 2  # 0.297 of the height
    lanes = summarise_corridors(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert [lane.non_water for lane in lanes] == pytest.approx([0.0] * 3)


@pytest.mark.parametrize(("blocked_rows", "clear"), [(17, 1.0), (18, 0.0)])
def test_e6_a_column_is_clear_at_sixty_percent(blocked_rows: int, clear: float) -> None:
    """E6: of the region's 44.8 cell rows 40 % are 17.92."""
    mask = np.zeros((64, 80), np.uint8)
    mask[64 - blocked_rows :] = 1
    lanes = summarise_corridors(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert lanes.center.clear_width == pytest.approx(clear)


def test_e6_the_longest_run_counts() -> None:
    mask = np.zeros((64, 80), np.uint8)
    mask[:, 45] = 1  # centre corridor: columns 24.8 to 55.2
    lanes = summarise_corridors(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert lanes.center.clear_width == pytest.approx((45 - 24.8) / 30.4)


def test_the_water_edge_is_the_lowest_end_of_water_in_each_column() -> None:
    """The lower edge of what lies lowest above the water, however much water shows again behind it."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[:16] = SKY
    mask[32:40, 10] = OBSTACLE  # water again above it
    mask[60:, 11] = OBSTACLE
    mask[:, 12] = WATER
    edge = find_water_edge(mask, ALL)
    assert edge[:10] == (0.25,) * 10
    assert edge[10:14] == (40 / 64, 1.0, 0.0, 0.25)


def test_small_glints_near_the_boat_do_not_end_the_water() -> None:
    """Up to three cells with water all round, in the lowest third; what is larger, higher up or reaches up ends it."""
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[:16] = SKY
    mask[62, 5:8] = OBSTACLE
    mask[50, 20] = mask[51, 21] = OBSTACLE
    mask[60:, 30] = OBSTACLE  # four cells
    mask[30, 40] = OBSTACLE  # far away, a swimmer's head
    mask[16:64, 50] = OBSTACLE  # a pole
    edge = find_water_edge(mask, ALL)
    assert set(edge[5:8] + edge[20:22]) == {0.25}
    assert (edge[30], edge[40], edge[50]) == (1.0, 31 / 64, 1.0)


def test_the_own_hull_does_not_end_the_water() -> None:
    """Skipped where it lies in front of water; a column of nothing else has no water."""
    hull = np.ones((HEIGHT, WIDTH), np.float32)
    hull[48:, 20:30], hull[:, 40] = 0.0, 0.0
    mask = np.full((HEIGHT, WIDTH), WATER, np.uint8)
    mask[hull == 0.0] = OBSTACLE
    mask[40:48, 29] = OBSTACLE
    edge = find_water_edge(mask, hull)
    assert edge[20:29] == (0.0,) * 9
    assert (edge[29], edge[40]) == (48 / 64, 1.0)


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.floats(0.0, 1.0))
def test_below_the_water_edge_is_nothing_but_water_and_own_hull(seed: int, bare: int, watery: float) -> None:
    """Below its edge each column is water or own hull, and just above it is not. Cells in fours: none is a speck."""
    random = np.random.default_rng(seed)
    coarse = np.where(random.random((HEIGHT // 2, WIDTH // 2)) < watery, WATER, OBSTACLE).astype(np.uint8)
    mask = coarse.repeat(2, axis=0).repeat(2, axis=1)
    counts = np.ones((HEIGHT, WIDTH), np.float32)
    counts[HEIGHT - 2 * bare :, ::4] = counts[HEIGHT - 2 * bare :, 1::4] = 0.0
    for column, edge in enumerate(find_water_edge(mask, counts)):
        row = round(edge * HEIGHT)
        assert set(mask[row:, column][counts[row:, column] > 0].tolist()) <= {WATER}
        assert row == 0 or mask[row - 1, column] != WATER or not counts[:, column].any()


def test_e2_uncertainty_and_clear_width_are_of_the_rows_of_the_region() -> None:
    mask, confidence = np.zeros((HEIGHT, WIDTH), np.uint8), ALL.copy()
    mask[:19], confidence[:19] = OBSTACLE, 0.4
    for lane in summarise_corridors(mask, confidence, CorridorConfig()):
        assert (lane.uncertainty, lane.clear_width) == pytest.approx((0.0, 1.0), abs=1e-6)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[47:] = OBSTACLE
    assert summarise_corridors(mask, ALL, CorridorConfig(top=0.5)).center.clear_width == 0.0


def test_e3_uncertainty_and_clear_width_are_of_the_columns_of_the_corridor() -> None:
    """Column 24 lies in the left corridor, and with 0.2 of its width in the centre's."""
    mask, confidence = np.zeros((HEIGHT, WIDTH), np.uint8), ALL.copy()
    confidence[:, 24] = 0.0
    lanes = summarise_corridors(mask, confidence, CorridorConfig())
    assert [lane.uncertainty for lane in lanes] == pytest.approx([1 / 28.8, 0.2 / 30.4, 0.0], abs=1e-6)
    mask[:, 10] = OBSTACLE
    assert summarise_corridors(mask, ALL, CorridorConfig()).left.clear_width == pytest.approx((31.2 - 11) / 28.8)


def test_e6_the_longest_run_counts_and_sixty_percent_of_water_make_a_column_clear() -> None:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:, 35] = OBSTACLE
    assert summarise_corridors(mask, ALL, CorridorConfig()).center.clear_width == pytest.approx((55.2 - 36) / 30.4)
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[48:] = OBSTACLE  # 16 of 40 rows
    assert summarise_corridors(mask, ALL, CorridorConfig(top=0.375)).center.clear_width == pytest.approx(1.0)
