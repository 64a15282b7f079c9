"""Image-quality check: whether a picture may be evidence at all (J19). Pure.

The segmenter can take a black picture for water, so every picture passes this check before its evidence counts:
  1. Limits on image statistics refuse what no working camera delivers: black, white, flat, noisy, covered or blurred
     pictures, and pictures whose lines have a wrong length.
  2. A small network, the fitness network, refuses what statistics cannot tell: views without water, shuffled or turned
     pictures, rain and drops that hide the scene. It is trained on pictures on which the segmenter fails.
  3. A comparison with the pictures before refuses a frozen camera.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.config import ImageQualityConfig
from paani.messages import UnusableCause

FitnessFunction = Callable[[U8], float]  # picture at 320x240, BGR uint8, to the fitness network's answer in [0, 1]
REDUCED_WH, THUMBNAIL_WH = (320, 240), (80, 60)  # pixels; every statistic is taken at one of these two sizes
TILE_PX = 20  # side of the square tiles of the reduced picture
DARK_LEVEL, BRIGHT_LEVEL = 6, 250  # luma of 255: at most this is dark, at least this is bright
PLAIN_TILE_STD = 2.0  # luma of 255; a tile that varies less has no texture
COVERED_TILE_STD, COVERED_TILE_MEAN = 3.0, 40.0  # luma of 255; a tile below both shows what covers the lens
# Noise estimate of J. Immerkaer, Fast Noise Variance Estimation, 1996. Its mask is the outer product of this row with
# itself, and it does not respond to edges and gradients.
NOISE_KERNEL = np.array([1, -2, 1], np.float32)
NOISE_SCALE = float(np.sqrt(np.pi / 2.0)) / 6.0  # mean absolute response to standard deviation, the same paper
# Doubt (1 - fitness) of the picture turned by 180 degrees, over its doubt upright, below which it stands on its head.
# Measured on held-out pictures: at most 0.023 on their head; 0.09 and more upright, but for two of stars in a lake.
UPSIDE_DOWN_DOUBT_RATIO = 0.05
SKEW_ROW_STEP = 2  # rows of the reduced picture between two lines that are compared
SKEW_SHIFT_PX = (4, 10)  # least and largest shift tried between them


class ImageQualityState(NamedTuple):
    """Thumbnail of the last distinct frame (luma float32 [60, 80]), and how many frames in a row have equalled it."""

    thumbnail: F32 | None = None
    repeats: int = 1
    epoch: int = -1


class PictureStatistics(NamedTuple):
    """Image statistics of one picture: luma in levels of 255, fractions of 1."""

    mean: float
    dark_frac: float  # of pixels
    bright_frac: float  # of pixels
    range: float  # 1st to 99th percentile
    plain_frac: float  # of tiles
    stripe_residual: float  # part of the variation that vertical stripes do not explain; a test card has none
    correlation: float  # of neighbouring pixels of the thumbnail, the lower of both directions
    noise_sigma: float  # standard deviation of the noise
    fineness: float  # edge strength of the reduced picture over that of the thumbnail
    covered_frac: float  # of tiles
    uncovered_mean: float  # of the other tiles
    skew: float  # difference of adjacent lines under the best shift, over their difference without one


def check_image_quality(
    state: ImageQualityState, bgr: U8, epoch: int, config: ImageQualityConfig, fitness: FitnessFunction | None = None
) -> tuple[ImageQualityState, UnusableCause]:
    """Check one distinct frame; the cause is NONE when the picture is usable.

    bgr: uint8 [H, W, 3]. epoch: of the frame; a new one restarts the search for a frozen camera. The caller passes
    each frame once, so that an unchanged picture means a camera that repeats itself.
    fitness: answer of the fitness network, None to leave it out; an answer that is not a number counts as unfit.
    """
    if not config.enabled:
        return state, UnusableCause.NONE
    height, width = bgr.shape[:2]
    if width < config.min_width_px or height < config.min_height_px:
        return ImageQualityState(), UnusableCause.WRONG_SIZE
    reduced, luma, thumbnail = reduce_picture(bgr)
    before = state.thumbnail if state.epoch == epoch else None
    is_same = before is not None and float(np.abs(thumbnail - before).mean()) < config.frozen_mad
    state = ImageQualityState(thumbnail, state.repeats + 1 if is_same else 1, epoch)
    cause = find_cause(measure_statistics(luma, thumbnail), config)
    if fitness is not None and cause in (UnusableCause.NONE, UnusableCause.SKEWED):
        cause = _apply_fitness(fitness, reduced, cause, config)
    if cause in (UnusableCause.NONE, UnusableCause.UNFIT) and state.repeats >= config.frozen_frames:
        cause = UnusableCause.FROZEN
    return state, cause


def reduce_picture(bgr: U8) -> tuple[U8, U8, F32]:
    """The picture at 320x240 (BGR uint8), its luma (uint8), and its thumbnail: luma at 80x60 (float32)."""
    shrinks = bgr.shape[1] >= REDUCED_WH[0]
    interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    reduced = np.asarray(cv2.resize(bgr, REDUCED_WH, interpolation=interpolation), np.uint8)
    luma = np.asarray(cv2.cvtColor(reduced, cv2.COLOR_BGR2GRAY), np.uint8)
    return reduced, luma, np.asarray(cv2.resize(luma, THUMBNAIL_WH, interpolation=cv2.INTER_AREA), np.float32)


def measure_statistics(luma: U8, thumbnail: F32) -> PictureStatistics:
    """Statistics of one picture, from its two reductions."""
    first, last = thumbnail.size // 100, thumbnail.size - 1 - thumbnail.size // 100
    low, high = np.partition(thumbnail, (first, last), axis=None)[[first, last]]
    tile_mean, tile_std = _tile_statistics(luma)
    covered = (tile_std < COVERED_TILE_STD) & (tile_mean < COVERED_TILE_MEAN)
    centred = thumbnail - thumbnail.mean()
    variance = float((centred * centred).mean()) + 1e-6
    return PictureStatistics(
        mean=float(thumbnail.mean()),
        dark_frac=cv2.countNonZero(cv2.inRange(luma, 0, DARK_LEVEL)) / luma.size,
        bright_frac=cv2.countNonZero(cv2.inRange(luma, BRIGHT_LEVEL, 255)) / luma.size,
        range=float(high - low),
        plain_frac=float((tile_std < PLAIN_TILE_STD).mean()),
        stripe_residual=float((thumbnail - thumbnail.mean(axis=0)).std() / (thumbnail.std() + 1e-3)),
        correlation=min(float((centred[:, 1:] * centred[:, :-1]).mean()), float((centred[1:] * centred[:-1]).mean()))
        / variance,
        noise_sigma=cv2.norm(cv2.sepFilter2D(luma, cv2.CV_16S, NOISE_KERNEL, NOISE_KERNEL), cv2.NORM_L1)
        / luma.size
        * NOISE_SCALE,
        fineness=_edge_strength(luma) / (_edge_strength(thumbnail) + 1e-3),
        covered_frac=float(covered.mean()),
        uncovered_mean=float(tile_mean[~covered].mean()) if not covered.all() else 0.0,
        skew=_line_skew(luma),
    )


def find_cause(statistics: PictureStatistics, config: ImageQualityConfig) -> UnusableCause:
    """The cause that belongs to the first limit which the statistics exceed; NONE where they exceed none."""
    if statistics.mean < config.dark_mean or statistics.dark_frac > config.dark_frac:
        return UnusableCause.BLACK
    if statistics.bright_frac > config.bright_frac:
        return UnusableCause.WHITE
    if (
        statistics.range < config.flat_range
        or statistics.plain_frac > config.flat_frac
        or statistics.stripe_residual < config.flat_residual
    ):
        return UnusableCause.FLAT
    if (
        statistics.correlation < config.noise_correlation
        or statistics.noise_sigma > config.noise_sigma
        or statistics.fineness > config.noise_fineness
    ):
        return UnusableCause.NOISE
    if statistics.covered_frac > config.cover_total_frac or (
        statistics.covered_frac > config.cover_frac and statistics.uncovered_mean > config.cover_rest_mean
    ):
        return UnusableCause.COVERED
    if statistics.fineness < config.blur_fineness:
        return UnusableCause.BLURRED
    if statistics.skew < config.skew:
        return UnusableCause.SKEWED
    return UnusableCause.NONE


def _apply_fitness(
    fitness: FitnessFunction, reduced: U8, cause: UnusableCause, config: ImageQualityConfig
) -> UnusableCause:
    """The cause after the fitness network has seen a picture that the statistics call sound, or skewed.

    Below `min_fitness` the picture is unfit. From `sure_fitness` on it is usable, even if its lines seem skewed:
    motion blur makes sound pictures look so. In between, a skewed picture stays refused, and a sound one is shown to
    the network upside down as well: if the network is sure of that view and its doubt falls to a small part of what it
    was, the picture stands on its head and is unfit.
    """
    refusal = UnusableCause.UNFIT if cause is UnusableCause.NONE else cause
    answer = fitness(reduced)
    if not answer >= config.min_fitness:
        return refusal
    if answer >= config.sure_fitness:
        return UnusableCause.NONE
    if cause is not UnusableCause.NONE:
        return refusal
    turned = fitness(np.ascontiguousarray(reduced[::-1, ::-1]))
    is_upright = turned < config.sure_fitness or 1.0 - turned > UPSIDE_DOWN_DOUBT_RATIO * (1.0 - answer)
    return UnusableCause.NONE if is_upright else refusal


def _edge_strength(luma: U8 | F32) -> float:
    """Mean absolute central difference over both directions."""
    across = cv2.norm(luma[:, 2:], luma[:, :-2], cv2.NORM_L1) / luma[:, 2:].size
    down = cv2.norm(luma[2:], luma[:-2], cv2.NORM_L1) / luma[2:].size
    return float(across + down) / 4.0


def _line_skew(luma: U8) -> float:
    """`PictureStatistics.skew`: low where a wrong line length makes each line begin further along than the one above.

    Shifted back by as much, such a line equals the one above it far better than it does in place.
    """
    lines = np.ascontiguousarray(luma[::SKEW_ROW_STEP])
    above, below = lines[:-1], lines[1:]

    def mean_difference(first: U8, second: U8) -> float:
        return cv2.norm(first, second, cv2.NORM_L1) / first.size

    best = min(
        mean_difference(one[:, shift:], other[:, :-shift])
        for shift in range(SKEW_SHIFT_PX[0], SKEW_SHIFT_PX[1] + 1)
        for one, other in ((above, below), (below, above))
    )
    return best / (mean_difference(above, below) + 1e-3)


def _tile_statistics(luma: U8) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation of each tile, from integral images, which are exact."""
    sums = (np.asarray(table[::TILE_PX, ::TILE_PX], np.float64) for table in cv2.integral2(luma))
    mean, square = ((x[1:, 1:] - x[1:, :-1] - x[:-1, 1:] + x[:-1, :-1]) / TILE_PX**2 for x in sums)
    return mean, np.sqrt(np.maximum(square - mean * mean, 0.0))
