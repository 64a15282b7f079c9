"""Augmentation is seeded, and picture, mask and boxes move together (S8, S12)."""

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from paani_models.segmenter.paper_augmentation import (
    AUGMENTATIONS,
    BRIGHTNESS,
    CONTRAST,
    FLIP_FRAC,
    HUE,
    JITTER_FRAC,
    SATURATION,
    augment_paper_pair,
    jitter_colour_slightly,
)
from paani_models.training import augment
from paani_models.training.augment import BLOB_FRAC, GLARE_FRAC, GLITTER_FRAC, augment_segmenter_pair

SIZE_WH = (320, 256)
WATER_CLASS, OBSTACLE_CLASS = 0, 1


def scene() -> tuple[np.ndarray, np.ndarray]:
    """A bright square, class 1, on dark ground, class 0."""
    picture, mask = np.full((288, 384, 3), 30, np.uint8), np.zeros((288, 384), np.uint8)
    picture[100:180, 150:260] = 220
    mask[100:180, 150:260] = OBSTACLE_CLASS
    return picture, mask


@pytest.mark.parametrize(
    "function",
    [
        augment.add_glare,
        augment.jitter_colour,
        augment.degrade_picture,
        lambda rng, _: augment.draw_null_picture(rng, SIZE_WH),
    ],
    ids=["glare", "jitter", "degrade", "null"],
)
@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_s12(function: Callable[..., np.ndarray]) -> None:
    picture = scene()[0]
    pairs = [
        (function(np.random.default_rng(s), picture), function(np.random.default_rng(s), picture)) for s in range(9)
    ]
    assert all(np.array_equal(a, b) for a, b in pairs)
    assert len({a.tobytes() for a, _ in pairs}) > 1


@pytest.mark.slow
def test_glare_leaves_its_input_alone_and_brightens_the_dark_s8() -> None:
    picture = scene()[0]
    before = picture.copy()
    lit = [augment.add_glare(np.random.default_rng(s), picture) for s in range(20)]
    assert np.array_equal(picture, before)
    dark = picture[..., 0] == 30
    assert all((out[dark] >= 30).all() for out in lit)
    assert sum(bool((out[dark] > 60).any()) for out in lit) >= 15


def is_within(count: int, n: int, frac: float) -> bool:
    """Whether a count of `n` draws is within four standard deviations of this share."""
    return abs(count - n * frac) < 4.0 * math.sqrt(n * frac * (1.0 - frac))


@pytest.mark.slow
def test_glare_has_a_blob_in_seven_and_glitter_in_six_of_ten_s8() -> None:
    """On black only light shows: a blob above the lower half, or wide and soft; strokes of glitter are in the lower."""
    black, n = np.zeros((256, 320, 3), np.uint8), 600
    lit = [augment.add_glare(np.random.default_rng(s), black)[..., 0] for s in range(n)]
    sharp = [int(np.abs(np.diff(out[128:].astype(int), axis=0)).max()) > 100 for out in lit]
    assert is_within(sum(sharp), n, 0.6)
    assert is_within(sum(not out.any() for out in lit), n, 0.3 * 0.4)


@pytest.mark.slow
def test_the_papers_augmentation_has_its_shares_s8() -> None:
    """Mirrored in half, other colours in half, glare in 0.35: told apart on a picture of two even greys."""
    picture, mask = np.full((256, 320, 3), 90, np.uint8), np.zeros((256, 320), np.uint8)
    picture[:, :160], mask[:, :160] = 60, OBSTACLE_CLASS
    n, mirrored, jittered, plain = 800, 0, 0, 0
    for seed in range(n):
        out, labels = augment_paper_pair(np.random.default_rng(seed), picture, mask, SIZE_WH)
        flipped = bool(labels[0, 0] == 0)
        mirrored += flipped
        assert labels[:, :160].min() == labels[:, :160].max() != labels[0, 300]
        upright = out[:, ::-1] if flipped else out
        corner = (int(upright[0, 0, 0]), int(upright[0, -1, 0]))  # glare seldom reaches the upper corners
        jittered += corner != (60, 90)
        plain += np.array_equal(upright, picture)
    assert is_within(mirrored, n, 0.5)
    assert is_within(jittered, n, 0.5)
    assert 0.30 * n < plain < 0.5 * n  # neither glare (0.35, an eighth of it without light) nor jitter


@pytest.mark.parametrize("left_out", AUGMENTATIONS)
@pytest.mark.slow
def test_each_of_the_papers_augmentations_may_be_left_out_alone(left_out: str) -> None:
    """And nothing is left of a picture's change without all three."""
    picture, mask = np.full((256, 320, 3), 90, np.uint8), np.zeros((256, 320), np.uint8)
    picture[:, :160], mask[:, :160] = 60, OBSTACLE_CLASS
    for seed in range(40):
        draw = np.random.default_rng(seed).random
        flips = draw() < 0.5
        jitters = draw() < 0.5
        rngs = [np.random.default_rng(seed) for _ in range(2)]
        out, labels = augment_paper_pair(rngs[0], picture, mask, SIZE_WH, (left_out,))
        whole, _ = augment_paper_pair(rngs[1], picture, mask, SIZE_WH)
        assert rngs[0].random() == rngs[1].random()
        acts = {"flip": flips, "jitter": jitters, "glare": True}[left_out]
        assert acts or np.array_equal(out, whole)
        assert bool(labels[0, 0] == 0) is (flips and left_out != "flip")
        upright = out[:, ::-1] if labels[0, 0] == 0 else out
        if left_out == "glare":
            assert np.array_equal(upright, picture) is not jitters
        none, _ = augment_paper_pair(np.random.default_rng(seed), picture, mask, SIZE_WH, AUGMENTATIONS)
        assert np.array_equal(none, picture)


@pytest.mark.slow
def test_the_papers_jitter_stays_within_its_ranges_s8() -> None:
    """Brightness and contrast by a fifth of a grey; hue by 0.05 of the circle and saturation by a fifth of a colour."""
    grey, n = np.full((8, 8, 3), 100, np.uint8), 400
    levels = [int(jitter_colour_slightly(np.random.default_rng(s), grey)[0, 0, 0]) for s in range(n)]
    assert 80 <= min(levels) < 84
    assert 116 < max(levels) <= 120
    colour = np.asarray(cv2.cvtColor(np.full((8, 8, 3), (90, 150, 150), np.uint8), cv2.COLOR_HSV2RGB), np.uint8)
    drawn = [jitter_colour_slightly(np.random.default_rng(s), colour) for s in range(n)]
    hsv = np.array([cv2.cvtColor(each, cv2.COLOR_RGB2HSV)[0, 0] for each in drawn]).astype(int)
    assert 80 <= hsv[:, 0].min() <= 82
    assert 98 <= hsv[:, 0].max() <= 100
    assert 96 <= hsv[:, 1].min() < 114  # contrast changes it by a fifth as well
    assert 186 < hsv[:, 1].max() <= 216


def test_mask_follows_the_picture() -> None:
    picture, mask = scene()
    for seed in range(20):
        affine = augment.random_affine(np.random.default_rng(seed), (384, 288), SIZE_WH, tilt_deg=8.0)
        moved, labels = (
            augment.warp_picture(picture, affine, SIZE_WH),
            augment.warp_mask(mask, affine, SIZE_WH),
        )
        known = labels != 255
        agree = (moved[..., 0] > 125) == (labels == OBSTACLE_CLASS)
        assert agree[known].mean() > 0.98


@pytest.mark.slow
def test_null_pictures_are_all_obstacle_and_of_many_kinds() -> None:
    pictures = []
    for seed in range(60):
        picture, mask = augment.draw_null_pair(np.random.default_rng(seed), SIZE_WH)
        assert (mask == OBSTACLE_CLASS).all()
        pictures.append(picture)
    means = [p.mean() for p in pictures]
    assert min(means) < 15
    assert max(means) > 235


@pytest.mark.slow
def test_a_pasted_patch_is_obstacle_and_nothing_else_changes() -> None:
    picture, mask = np.full((256, 320, 3), 30, np.uint8), np.zeros((256, 320), np.uint8)
    patch = np.full((60, 80, 3), 220, np.uint8)
    shares = []
    for seed in range(40):
        pasted, labels = augment.paste_obstacle(np.random.default_rng(seed), picture, mask, patch)
        covered = labels == OBSTACLE_CLASS
        assert (pasted[~covered] == 30).all()
        assert np.isin(labels, (0, OBSTACLE_CLASS)).all()
        assert (pasted[covered] > 100).mean() > 0.9
        shares.append(covered.mean())
    assert 0.02 < np.mean(shares) < 0.5
    assert not mask.any()


def test_concrete_is_smooth_grey_and_its_own_every_time() -> None:
    walls = [augment.draw_concrete(np.random.default_rng(seed)) for seed in range(12)]
    assert len({wall.tobytes() for wall in walls}) == 12
    assert all(np.abs(wall.astype(int) - wall.mean(2, keepdims=True)).mean() < 16 for wall in walls)


def test_patches_are_cut_from_obstacle_only() -> None:
    picture = np.zeros((288, 384, 3), np.uint8)
    mask = np.zeros((288, 384), np.uint8)
    mask[:200] = OBSTACLE_CLASS
    picture[:200] = 9
    patches = [augment.crop_obstacle(np.random.default_rng(seed), picture, mask) for seed in range(20)]
    found = [patch for patch in patches if patch is not None]
    assert len(found) >= 10
    assert all((patch == 9).mean() >= 0.95 for patch in found)
    assert augment.crop_obstacle(np.random.default_rng(0), picture, np.zeros_like(mask)) is None


def test_mirrored_water_changes_water_only() -> None:
    """Above the far edge the picture stays; in the water it takes on what stands there."""
    picture = np.full((96, 128, 3), 40, np.uint8)
    picture[:48] = (220, 30, 30)
    mask = np.full((96, 128), 1, np.uint8)
    mask[48:] = 0
    mirrored = augment.mirror_banks_in_water(np.random.default_rng(0), picture, mask)
    assert np.array_equal(mirrored[:48], picture[:48])
    assert mirrored[50:, :, 0].mean() > 60
    dry = np.full((96, 128), 1, np.uint8)
    assert np.array_equal(augment.mirror_banks_in_water(np.random.default_rng(0), picture, dry), picture)


@pytest.mark.slow
@pytest.mark.parametrize("augment_pair", [augment_paper_pair, augment_segmenter_pair])
def test_s12_a_whole_augmentation_repeats_to_the_byte(augment_pair: Callable[..., Any]) -> None:
    picture, mask = scene()[:2]
    for seed in range(12):
        one, other = (augment_pair(np.random.default_rng(seed), picture, mask, SIZE_WH)[0] for _ in range(2))
        np.testing.assert_array_equal(one, other)


def test_s8_every_share_and_range_is_the_papers() -> None:
    assert (FLIP_FRAC, JITTER_FRAC, GLARE_FRAC, BLOB_FRAC, GLITTER_FRAC) == (0.5, 0.5, 0.35, 0.7, 0.6)
    assert (BRIGHTNESS, CONTRAST, SATURATION, HUE) == (0.2, 0.2, 0.2, 0.05)
