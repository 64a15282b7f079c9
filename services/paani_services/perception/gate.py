"""Is this picture fit to be evidence? A net calls black water, so this is asked first (J19). Pure.

Limits on statistics name what no camera should deliver; a small net, trained on what the segmenter does not survive,
knows the rest: views without water, mixed-up or turned pictures, rain and drops that hide the scene.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32, U8
from paani.config import GateConfig
from paani.messages import UnusableCause

MIDDLE_WH, SMALL_WH, TILE_PX = (320, 240), (80, 60), 20
Fitness = Callable[[U8], float]
DARK_LEVEL, BRIGHT_LEVEL = 6, 250  # of 255
PLAIN_STD, DARK_TILE_STD, DARK_TILE_MEAN = 2.0, 3.0, 40.0
# J. Immerkaer, Fast Noise Variance Estimation, 1996: a mask that image structure does not answer to.
NOISE_LINE = np.array([1, -2, 1], np.float32)  # the mask's factor, across and down
NOISE_SCALE = float(np.sqrt(np.pi / 2.0)) / 6.0
# Held-out pictures on their head have at most 0.023; upright ones 0.09 and more, but for two of stars in a lake.
TURNED_DOUBT = 0.05
SKEW_ROWS, SKEW_PX = 2, (4, 10)  # lines this far apart, moved by so much against each other


class GateState(NamedTuple):
    """The last distinct frame in small, and how many in a row have shown the same."""

    small: F32 | None = None
    same: int = 1
    epoch: int = -1


class Statistics(NamedTuple):
    """What the gate looks at. Levels are of 255, shares of 1; `correlation` is of neighbouring small pixels.

    `upright_residual` is the part of the variation that vertical stripes do not explain: test cards have none.
    `skew` is how unlike lines are at best that are moved against each other, to how unlike they are as they stand.
    """

    mean: float
    dark_frac: float
    bright_frac: float
    range: float
    plain_frac: float
    upright_residual: float
    correlation: float
    sigma: float
    fineness: float
    covered_frac: float
    rest_mean: float
    skew: float


def judge(
    state: GateState, bgr: U8, epoch: int, config: GateConfig, fitness: Fitness | None = None
) -> tuple[GateState, UnusableCause]:
    """Judge one distinct frame; NONE when it is fit.

    bgr: uint8 [H, W, 3]. epoch: the frame's; a new one begins the search for a frozen camera again. The caller
    passes each frame once, so that the same picture again is a camera that repeats itself.
    fitness: from the picture at 320x240, uint8 [240, 320, 3], to 0..1, and not a number where that fails.
    """
    if not config.enabled:
        return state, UnusableCause.NONE
    height, width = bgr.shape[:2]
    if width < config.min_width_px or height < config.min_height_px:
        return GateState(), UnusableCause.WRONG_SIZE
    colour, middle, small = reduced(bgr)
    known = state.small if state.epoch == epoch else None
    still = known is not None and float(np.abs(small - known).mean()) < config.frozen_mad
    state = GateState(small, state.same + 1 if still else 1, epoch)
    cause = cause_of(measure(middle, small), config)
    if fitness is not None and cause in (UnusableCause.NONE, UnusableCause.SKEWED):
        cause = _asked(fitness, colour, cause, config)
    if cause is UnusableCause.NONE and state.same >= config.frozen_frames:
        cause = UnusableCause.FROZEN
    return state, cause


def reduced(bgr: U8) -> tuple[U8, U8, F32]:
    """The picture at 320x240 (BGR uint8), its luma (uint8), and luma at 80x60 (float32)."""
    shrinks = bgr.shape[1] >= MIDDLE_WH[0]
    interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    colour = np.asarray(cv2.resize(bgr, MIDDLE_WH, interpolation=interpolation), np.uint8)
    middle = np.asarray(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), np.uint8)
    return colour, middle, np.asarray(cv2.resize(middle, SMALL_WH, interpolation=cv2.INTER_AREA), np.float32)


def measure(middle: U8, small: F32) -> Statistics:
    """Statistics of one picture, from its two reductions."""
    first, last = small.size // 100, small.size - 1 - small.size // 100
    low, high = np.partition(small, (first, last), axis=None)[[first, last]]
    tile_mean, tile_std = _tiles(middle)
    covered = (tile_std < DARK_TILE_STD) & (tile_mean < DARK_TILE_MEAN)
    centred = small - small.mean()
    variance = float((centred * centred).mean()) + 1e-6
    return Statistics(
        mean=float(small.mean()),
        dark_frac=cv2.countNonZero(cv2.inRange(middle, 0, DARK_LEVEL)) / middle.size,
        bright_frac=cv2.countNonZero(cv2.inRange(middle, BRIGHT_LEVEL, 255)) / middle.size,
        range=float(high - low),
        plain_frac=float((tile_std < PLAIN_STD).mean()),
        upright_residual=float((small - small.mean(axis=0)).std() / (small.std() + 1e-3)),
        correlation=min(float((centred[:, 1:] * centred[:, :-1]).mean()), float((centred[1:] * centred[:-1]).mean()))
        / variance,
        sigma=cv2.norm(cv2.sepFilter2D(middle, cv2.CV_16S, NOISE_LINE, NOISE_LINE), cv2.NORM_L1)
        / middle.size
        * NOISE_SCALE,
        fineness=_edges(middle) / (_edges(small) + 1e-3),
        covered_frac=float(covered.mean()),
        rest_mean=float(tile_mean[~covered].mean()) if not covered.all() else 0.0,
        skew=_skew(middle),
    )


def cause_of(seen: Statistics, config: GateConfig) -> UnusableCause:
    """The first limit that a picture breaks."""
    if seen.mean < config.dark_mean or seen.dark_frac > config.dark_frac:
        return UnusableCause.BLACK
    if seen.bright_frac > config.bright_frac:
        return UnusableCause.WHITE
    if (
        seen.range < config.flat_range
        or seen.plain_frac > config.flat_frac
        or seen.upright_residual < config.flat_residual
    ):
        return UnusableCause.FLAT
    if (
        seen.correlation < config.noise_correlation
        or seen.sigma > config.noise_sigma
        or seen.fineness > config.noise_fineness
    ):
        return UnusableCause.NOISE
    if seen.covered_frac > config.cover_total_frac or (
        seen.covered_frac > config.cover_frac and seen.rest_mean > config.cover_rest_mean
    ):
        return UnusableCause.COVERED
    if seen.fineness < config.blur_fineness:
        return UnusableCause.BLURRED
    if seen.skew < config.skew:
        return UnusableCause.SKEWED
    return UnusableCause.NONE


def _asked(fitness: Fitness, colour: U8, cause: UnusableCause, config: GateConfig) -> UnusableCause:
    """What the net makes of a picture whose statistics are sound, or whose lines may be of a wrong length.

    A blurred or turned picture has such lines too: the net must be sure of it. One that it is not sure of, it is shown
    upside down as well: if it is sure of that, and doubts a small part of what it doubts upright, the picture stands on
    its head.
    """
    doubt = UnusableCause.UNFIT if cause is UnusableCause.NONE else cause
    said = fitness(colour)
    if not said >= config.min_fitness:
        return doubt
    if said >= config.sure_fitness:
        return UnusableCause.NONE
    if cause is not UnusableCause.NONE:
        return doubt
    turned = fitness(np.ascontiguousarray(colour[::-1, ::-1]))
    upright = turned < config.sure_fitness or 1.0 - turned > TURNED_DOUBT * (1.0 - said)
    return UnusableCause.NONE if upright else doubt


def _edges(luma: U8 | F32) -> float:
    """Mean absolute central difference, both ways."""
    across = cv2.norm(luma[:, 2:], luma[:, :-2], cv2.NORM_L1) / luma[:, 2:].size
    down = cv2.norm(luma[2:], luma[:-2], cv2.NORM_L1) / luma[2:].size
    return float(across + down) / 4.0


def _skew(middle: U8) -> float:
    """Lines of a wrong length each begin further along: moved back, every line is like the one above it."""
    lines = np.ascontiguousarray(middle[::SKEW_ROWS])
    above, below = lines[:-1], lines[1:]

    def unlike(first: U8, second: U8) -> float:
        return cv2.norm(first, second, cv2.NORM_L1) / first.size

    moved = min(
        unlike(one[:, by:], other[:, :-by])
        for by in range(SKEW_PX[0], SKEW_PX[1] + 1)
        for one, other in ((above, below), (below, above))
    )
    return moved / (unlike(above, below) + 1e-3)


def _tiles(middle: U8) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation of each tile, from running sums that are exact."""
    sums = (np.asarray(table[::TILE_PX, ::TILE_PX], np.float64) for table in cv2.integral2(middle))
    mean, square = ((x[1:, 1:] - x[1:, :-1] - x[:-1, 1:] + x[:-1, :-1]) / TILE_PX**2 for x in sums)
    return mean, np.sqrt(np.maximum(square - mean * mean, 0.0))
