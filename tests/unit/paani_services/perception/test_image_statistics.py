"""The statistics of a picture are what they say, and each limit on them lets in what equals it and nothing beyond."""

from __future__ import annotations

import math

import cv2
import msgspec
import numpy as np
import pytest

from paani.arrays import F32, U8
from paani.config import ImageQualityConfig
from paani.messages import UnusableCause
from paani_services.perception.image_quality import (
    ImageQualityState,
    PictureStatistics,
    check_image_quality,
    find_cause,
    measure_statistics,
    reduce_picture,
)
from tests.pictures import river

C = UnusableCause
ON = ImageQualityConfig()
SOUND = PictureStatistics(
    mean=100.0, dark_frac=0.0, bright_frac=0.0, range=100.0, plain_frac=0.0, stripe_residual=1.0, correlation=0.9,
    noise_sigma=2.0, fineness=1.0, covered_frac=0.0, uncovered_mean=100.0, skew=1.0,
)  # fmt: skip
BLANK = np.full((60, 80), 100.0, np.float32)
COLUMNS, ROWS = np.meshgrid(np.arange(320), np.arange(240))


def grey(luma: np.ndarray) -> U8:
    return np.repeat(luma.astype(np.uint8)[:, :, None], 3, axis=2)


def measured(luma: np.ndarray | None = None, thumbnail: np.ndarray = BLANK) -> PictureStatistics:
    luma = np.full((240, 320), 100) if luma is None else luma
    return measure_statistics(luma.astype(np.uint8), thumbnail.astype(np.float32))


@pytest.mark.parametrize(("statistic", "limit", "worse", "cause"), [
    ("mean", "dark_mean", -1, C.BLACK),
    ("dark_frac", "dark_frac", 1, C.BLACK),
    ("bright_frac", "bright_frac", 1, C.WHITE),
    ("range", "flat_range", -1, C.FLAT),
    ("plain_frac", "flat_frac", 1, C.FLAT),
    ("stripe_residual", "flat_residual", -1, C.FLAT),
    ("correlation", "noise_correlation", -1, C.NOISE),
    ("noise_sigma", "noise_sigma", 1, C.NOISE),
    ("fineness", "noise_fineness", 1, C.NOISE),
    ("fineness", "blur_fineness", -1, C.BLURRED),
    ("skew", "skew", -1, C.SKEWED),
])  # fmt: skip
def test_a_limit_refuses_what_exceeds_it_and_not_what_equals_it(
    statistic: str, limit: str, worse: int, cause: UnusableCause
) -> None:
    bound = getattr(ON, limit)
    assert find_cause(SOUND._replace(**{statistic: bound}), ON) is C.NONE
    assert find_cause(SOUND._replace(**{statistic: math.nextafter(bound, worse * math.inf)}), ON) is cause


@pytest.mark.parametrize(("covered_frac", "rest", "cause"), [
    (ON.cover_frac, 255.0, C.NONE),
    (math.nextafter(ON.cover_frac, 1.0), 255.0, C.COVERED),
    (0.7, ON.cover_rest_mean, C.NONE),  # dusk
    (0.7, math.nextafter(ON.cover_rest_mean, 255.0), C.COVERED),
    (ON.cover_total_frac, 0.0, C.NONE),
    (math.nextafter(ON.cover_total_frac, 1.0), 0.0, C.COVERED),
])  # fmt: skip
def test_what_is_covered_counts_beside_a_bright_rest_or_alone(
    covered_frac: float, rest: float, cause: UnusableCause
) -> None:
    assert find_cause(SOUND._replace(covered_frac=covered_frac, uncovered_mean=rest), ON) is cause


@pytest.mark.parametrize(("size_wh", "is_taken"), [((160, 120), True), ((159, 120), False), ((160, 119), False)])
def test_the_least_size_is_taken(size_wh: tuple[int, int], is_taken: bool) -> None:
    _, cause = check_image_quality(ImageQualityState(), cv2.resize(river(), size_wh), 1, ON)
    assert (cause is not C.WRONG_SIZE) is is_taken


@pytest.mark.parametrize("change", [1, -1])
def test_pictures_that_differ_by_the_limit_are_not_the_same(change: int) -> None:
    still, other = (np.full((240, 320, 3), level, np.uint8) for level in (100, 100 + change))
    for limit, repeats in ((1.0, 1), (1.001, 2)):
        config = msgspec.structs.replace(ON, frozen_mad=limit)
        state, _ = check_image_quality(ImageQualityState(), still, 1, config)
        assert check_image_quality(state, other, 1, config)[0].repeats == repeats


@pytest.mark.parametrize(("answer", "upside_down", "cause", "looks"), [
    (ON.min_fitness, ON.sure_fitness, C.UNFIT, 2),
    (math.nextafter(ON.min_fitness, 0.0), 0.0, C.UNFIT, 1),
    (ON.sure_fitness, 1.0, C.NONE, 1),
    (math.nextafter(ON.sure_fitness, 0.0), 1.0, C.UNFIT, 2),
    (ON.min_fitness, math.nextafter(ON.sure_fitness, 0.0), C.NONE, 2),
    (0.96, 0.998, C.UNFIT, 2),  # on its head a twentieth of the doubt
    (0.96, math.nextafter(0.998, 0.0), C.NONE, 2),
])  # fmt: skip
def test_a_fitness_that_equals_its_limit_reaches_it(
    answer: float, upside_down: float, cause: UnusableCause, looks: int
) -> None:
    answers = iter((answer, upside_down))
    assert check_image_quality(ImageQualityState(), river(), 1, ON, lambda _: next(answers))[1] is cause
    assert len(list(answers)) == 2 - looks


@pytest.mark.parametrize("size_wh", [(960, 720), (320, 720)])
def test_a_larger_picture_is_averaged(size_wh: tuple[int, int]) -> None:
    width, height = size_wh
    picture = np.random.default_rng(1).integers(0, 256, (height, width))
    reduced, luma, thumbnail = reduce_picture(grey(picture))
    means = picture.reshape(240, height // 240, 320, width // 320).mean(axis=(1, 3))
    assert np.abs(reduced - means[:, :, None]).max() <= 1.0
    assert np.array_equal(luma, reduced[:, :, 0])
    assert np.abs(thumbnail - luma.reshape(60, 4, 80, 4).mean(axis=(1, 3))).max() <= 1.0
    assert [str(of.dtype) for of in (reduced, luma, thumbnail)] == ["uint8", "uint8", "float32"]


@pytest.mark.parametrize("width", [160, 240])
def test_a_smaller_picture_is_interpolated(width: int) -> None:
    line = np.random.default_rng(1).integers(0, 256, width)
    reduced, _, _ = reduce_picture(grey(np.tile(line, (240, 1))))
    expected = np.interp((np.arange(320) + 0.5) * width / 320 - 0.5, np.arange(width), line)
    assert np.abs(reduced[:, :, 0] - expected).max() <= 1.0


def test_the_range_leaves_out_a_hundredth_at_both_ends() -> None:
    levels = np.random.default_rng(1).permutation(4800).reshape(60, 80)
    assert measured(thumbnail=levels).range == 4751 - 48


def test_dark_and_bright_pixels_are_counted_from_their_level_on() -> None:
    levels = np.array([0, 6, 7, 100, 249, 250, 255, 100])[COLUMNS // 40]
    assert (measured(levels).dark_frac, measured(levels).bright_frac) == (0.25, 0.25)


def test_a_tile_is_plain_or_covered_below_each_of_its_limits() -> None:
    """Of each quarter of the tiles: mean and standard deviation (30, 3), (30, 2), (40, 0), (39, 0)."""
    kind, is_odd = COLUMNS // 80, (COLUMNS + ROWS) % 2
    luma = np.array([30, 30, 40, 39])[kind] + np.array([3, 2, 0, 0])[kind] * (2 * is_odd - 1)
    found = measured(luma)
    assert (found.covered_frac, found.plain_frac, found.uncovered_mean) == (0.5, 0.5, 35.0)
    assert measured(np.zeros((240, 320))).uncovered_mean == 0.0


@pytest.mark.parametrize("thumbnail", [BLANK + np.arange(80) % 2, BLANK + 6.0 * (np.arange(60)[:, None] % 2)])
def test_the_lower_correlation_of_both_directions_counts(thumbnail: F32) -> None:
    """Neighbours across stripes are opposites, neighbours along them alike."""
    assert -1.0 <= measured(thumbnail=thumbnail).correlation == pytest.approx(-1.0, abs=1e-4)
    assert measured().correlation == 0.0


def test_stripes_that_stand_upright_explain_all_variation_and_others_none() -> None:
    assert measured(thumbnail=BLANK + np.arange(80) % 2).stripe_residual == 0.0
    lying = measured(thumbnail=BLANK + 6.0 * (np.arange(60)[:, None] % 2))
    assert 1.0 > lying.stripe_residual == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("luma", "strength"), [(COLUMNS // 2, 0.25), (ROWS, 0.5), (COLUMNS // 2 + ROWS // 3, 0.416)])
def test_fineness_is_the_mean_slope_over_that_of_the_thumbnail(luma: np.ndarray, strength: float) -> None:
    """A thumbnail without edges counts as one of a thousandth of a level."""
    assert measured(luma).fineness == pytest.approx(strength / 1e-3, rel=2e-3)
    ramp = BLANK + np.arange(80)
    assert measured(luma, ramp).fineness == pytest.approx(strength / 0.501, rel=2e-3)


@pytest.mark.parametrize(("shift_px", "is_skew"), [(3, False), (4, True), (10, True), (11, False)])
@pytest.mark.parametrize("sense", [1, -1])
def test_lines_are_compared_at_these_shifts(shift_px: int, is_skew: bool, sense: int) -> None:
    line = np.random.default_rng(1).integers(0, 256, 320)
    lines = np.array([np.roll(line, sense * shift_px * (row // 2)) for row in range(240)])
    assert (measured(lines).skew < 0.1) is is_skew


def test_skew_is_the_best_shifts_difference_over_that_in_place() -> None:
    """Upright lines on a ramp of half a level a pixel: two levels at the least shift, none in place."""
    assert measured(COLUMNS // 2).skew == pytest.approx(2.0 / 1e-3)
