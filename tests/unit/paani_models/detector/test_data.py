"""Boxes and exhaustive masks move with the picture through letterbox, zoom and mosaic (C3)."""

from dataclasses import replace

import numpy as np
import pytest

from paani_models.datasets.sources import NO_CRAFT, Source
from paani_models.detector.data import (
    BoxedPicture,
    augment_example,
    close_up_affine,
    exhaustive_mask_from_classes,
    letterbox_example,
    random_letterbox_affine,
    warp_example,
)
from paani_models.network_input import letterbox_affine

SIZE_WH = (320, 256)
WATER_CLASS, OBSTACLE_CLASS = 0, 1


def boxed(exhaustive: tuple[int, ...]) -> BoxedPicture:
    """A bright square on dark ground, boxed as class 1."""
    picture = np.full((288, 384, 3), 30, np.uint8)
    picture[100:180, 150:260] = 220
    box = np.array([[1, 150 / 384, 100 / 288, 260 / 384, 180 / 288]], np.float32)
    return BoxedPicture("test", picture, box, np.array(exhaustive, np.uint8))


def test_letterbox_is_centred_c3() -> None:
    """A 512 x 288 picture fills the width and leaves 38 px bars above and below."""
    affine = letterbox_affine((512, 288), SIZE_WH)
    np.testing.assert_allclose(affine, [[0.625, 0, 0], [0, 0.625, 38]])


@pytest.mark.slow
def test_boxes_follow_the_picture() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        example = warp_example(
            boxed((1, 1, 1, 1)), random_letterbox_affine(rng, (384, 288), SIZE_WH, (0.6, 1.2)), SIZE_WH
        )
        bright = np.argwhere(example.picture[..., 0] > 170)
        if len(example.boxes) == 0:
            continue
        low, high = bright.min(0)[::-1], bright.max(0)[::-1] + 1
        np.testing.assert_allclose(example.boxes[0, 1:], [*low, *high], atol=2.5)


def test_the_exhaustive_mask_holds_beyond_the_picture_and_not_where_unannotated() -> None:
    example = letterbox_example(boxed((0, 1, 0, 1)), SIZE_WH)
    assert example.exhaustive_mask[1].all()
    assert example.exhaustive_mask[0, 0].all()
    assert not example.exhaustive_mask[0, 4:28].any()


def test_a_box_cut_off_by_the_frame_is_neither_object_nor_background() -> None:
    affine = np.array([[1.0, 0, -245.0], [0, 1.0, 0]], np.float32)
    example = warp_example(boxed((1, 1, 1, 1)), affine, SIZE_WH)
    assert len(example.boxes) == 0
    assert not example.exhaustive_mask[1, 13:22, 0].any()
    assert example.exhaustive_mask[1, 13:22, 4:].all()


def test_mosaic_keeps_each_pictures_exhaustive_mask() -> None:
    example = augment_example(np.random.default_rng(3), [boxed((0, 1, 0, 0)), *[boxed((1, 1, 1, 1))] * 3], SIZE_WH)
    assert example.exhaustive_mask[1].any()
    assert not example.exhaustive_mask[0].all()
    assert example.exhaustive_mask[0].any()


def river_with_bow() -> np.ndarray:
    """Sky, then bank, then water, and a bow in the bottom middle."""
    mask = np.zeros((240, 320), np.uint8)
    mask[:60], mask[60:120] = 2, 1
    mask[200:, 140:180] = 1
    return mask


def test_water_and_sky_of_a_mask_hold_no_object() -> None:
    mask = river_with_bow()
    judged = exhaustive_mask_from_classes(Source("river", "river"), mask, np.zeros((*mask.shape, 3), np.uint8))
    assert judged[:, 150, 20].all()
    assert judged[:, 20, 20].all()
    assert not judged[:, 90, 20].any()
    assert not judged[:, 122, 20].any()  # too near the bank
    assert not judged[:, 230, 160].any()


def test_sources_without_craft_and_the_own_hull_hold_no_object() -> None:
    mask = river_with_bow()
    picture = np.zeros((*mask.shape, 3), np.uint8)
    judged = exhaustive_mask_from_classes(Source("river", "river", empty_of=NO_CRAFT), mask, picture)
    assert judged[[1, 3]].all()
    assert not judged[[0, 2], 90, 20].any()
    judged = exhaustive_mask_from_classes(Source("river", "river", own_hull=True), mask, picture)
    assert judged[:, 230, 160].all()
    assert not judged[:, 90, 20].any()


@pytest.mark.slow
def test_a_close_up_gives_a_small_object_its_pixels_and_keeps_it_in_view() -> None:
    item = BoxedPicture(
        "s",
        np.zeros((240, 480, 3), np.uint8),
        np.array([[0, 0.9, 0.1, 0.91, 0.13], [1, 0.1, 0.1, 0.6, 0.9]], np.float32),
        np.ones(4, np.uint8),
    )
    for seed in range(30):
        affine = close_up_affine(np.random.default_rng(seed), item, (320, 256))
        assert affine is not None
        kept = {int(row[0]): row for row in warp_example(item, affine, (320, 256)).boxes}
        assert 0 in kept
        assert 4.9 <= min(kept[0][3] - kept[0][1], kept[0][4] - kept[0][2]) <= 24.1
    assert close_up_affine(np.random.default_rng(0), replace(item, boxes=item.boxes[1:]), (320, 256)) is None
