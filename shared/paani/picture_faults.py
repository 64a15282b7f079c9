"""Synthetic picture faults in five severities, for measuring the image-quality check and for simulated cameras. Pure.

A fault is `fault(picture, severity, rng) -> picture`: BGR uint8 [H, W, 3] in and out, severity 1 to 5. A geometric
fault moves the content of the picture and so changes its class mask too: `fault(picture, mask, severity, rng)`.
"""

from collections.abc import Callable
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8

Fault = Callable[[U8, int, np.random.Generator], U8]
GeometricFault = Callable[[U8, U8, int, np.random.Generator], tuple[U8, U8]]
SEVERITIES = (1, 2, 3, 4, 5)
IGNORE = 255  # in class masks: nothing is known of the pixel
WATER = 0  # in class masks
MIN_NO_WATER_FRAC = 0.25  # fraction of the picture's rows above its water from which a view without water is cut
NO_WATER = "above_water"  # name of the fault that shows a view without water
# Mean IoU of the segmenter on a faulty picture, below which the picture must be rejected and above which accepted.
MUST_REJECT, MUST_ACCEPT = 0.60, 0.75


def black(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """No light: sensor noise alone."""
    return _to_uint8(rng.normal(2.0, 0.8 * severity, picture.shape))


def white(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Nothing but light."""
    return _to_uint8(rng.normal(258.0 - severity, 0.8 * severity, picture.shape))


def one_colour(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """A hand, a wall, a lens cap in light: one colour, a slight gradient, sensor noise."""
    height = picture.shape[0]
    slope = np.linspace(-2.0 * severity, 2.0 * severity, height)[:, None, None]
    return _to_uint8(rng.uniform(30, 225, 3) + slope + rng.normal(0.0, 2.0, picture.shape))


def underexposed(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Too short a shutter: light lost, read-out noise left."""
    gain = (0.5, 0.25, 0.12, 0.05, 0.02)[severity - 1]
    return _to_uint8(picture * gain + rng.normal(0.0, 2.0, picture.shape))


def overexposed(picture: U8, severity: int, _: np.random.Generator) -> U8:
    """Too long a shutter."""
    return _to_uint8(picture * (1.4, 2.0, 3.5, 7.0, 15.0)[severity - 1] + 5.0 * severity)


def blur(picture: U8, severity: int, _: np.random.Generator) -> U8:
    """Out of focus, or grease on the lens."""
    sigma = (1.5, 3.0, 8.0, 14.0, 22.0)[severity - 1] * picture.shape[1] / 320
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma), np.uint8)


def motion_blur(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """The camera turned during the exposure."""
    length = round((5, 9, 15, 25, 41)[severity - 1] * picture.shape[1] / 320) | 1
    kernel = np.zeros((length, length), np.float32)
    kernel[length // 2] = 1.0 / length
    turn = cv2.getRotationMatrix2D((length / 2 - 0.5, length / 2 - 0.5), float(rng.uniform(-25, 25)), 1.0)
    kernel = np.asarray(cv2.warpAffine(kernel, turn, (length, length)), np.float32)
    return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()), np.uint8)


def noise(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Gain without light."""
    return _to_uint8(picture + rng.normal(0.0, (8.0, 16.0, 40.0, 70.0, 110.0)[severity - 1], picture.shape))


def salt_and_pepper(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Dead and stuck pixels."""
    chance = rng.random(picture.shape[:2])
    share = (0.01, 0.05, 0.15, 0.3, 0.5)[severity - 1]
    result = picture.copy()
    result[chance < share / 2] = 0
    result[chance > 1.0 - share / 2] = 255
    return result


def cover(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Something dark before part of the lens, out of focus."""
    share = (0.15, 0.35, 0.6, 0.8, 0.97)[severity - 1]
    height, width = picture.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    along = (x / width - 0.5) * np.cos(angle) + (y / height - 0.5) * np.sin(angle)
    edge = np.quantile(along, share)
    hidden = np.clip((edge - along) / 0.04 + 0.5, 0.0, 1.0)[:, :, None]
    return _to_uint8(picture * (1.0 - hidden) + hidden * (rng.uniform(0, 25, 3) + rng.normal(0, 1.5, picture.shape)))


def drops(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Water on the lens: each drop shows a blurred, shifted piece of the scene."""
    share = (0.05, 0.15, 0.35, 0.6, 0.9)[severity - 1]
    height, width = picture.shape[:2]
    soft = cv2.GaussianBlur(picture, (0, 0), 7.0 * width / 320)
    wet = np.zeros((height, width), np.float32)
    while wet.mean() < share:
        centre = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        axes = (round(width * float(rng.uniform(0.03, 0.12))), round(height * float(rng.uniform(0.04, 0.14))))
        cv2.ellipse(wet, centre, axes, float(rng.uniform(0, 180)), 0, 360, (1.0,), -1)
    wet = np.asarray(cv2.GaussianBlur(wet, (0, 0), 2.0), np.float32)
    shift = rng.uniform(-0.2, 0.2, 2) * (width, height)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    refracted = cv2.remap(
        soft,
        np.asarray(width - 1 - x + shift[0], np.float32),
        np.asarray(height - 1 - y + shift[1], np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    return _to_uint8(picture * (1.0 - wet[:, :, None]) + refracted * 1.1 * wet[:, :, None])


def colour_bars(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """A receiver's test card over the picture, at the end nothing but the card."""
    height, width = picture.shape[:2]
    colours = np.array(
        [(192, 192, 192), (0, 192, 192), (192, 192, 0), (0, 192, 0), (192, 0, 192), (0, 0, 192), (192, 0, 0)]
    )
    card = np.broadcast_to(colours[np.arange(width) * 7 // width], (height, width, 3))
    share = (0.6, 0.75, 0.9, 1.0, 1.0)[severity - 1]
    return _to_uint8(picture * (1.0 - share) + card * share + rng.normal(0.0, 1.0 + severity, picture.shape))


def compression(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Few bits, then broken ones: coarse JPEG, from severity 3 with damaged scan data."""
    quality = (20, 8, 8, 5, 3)[severity - 1]
    data = bytearray(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes())
    damages = (0, 0, 3, 8, 25)[severity - 1]
    scan = data.index(b"\xff\xda") + 14
    for at in rng.integers(scan, len(data) - 2, damages):
        data[at] = int(rng.integers(0, 255))
    broken = cv2.imdecode(np.frombuffer(bytes(data), np.uint8), cv2.IMREAD_COLOR)
    whole = broken is not None and broken.shape == picture.shape
    return np.asarray(broken, np.uint8) if whole else np.full_like(picture, 128)


def drop_out(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Bands of the picture were lost on the way and are grey."""
    result = picture.copy()
    rows = picture.shape[0] // 16
    lost = round(rows * (0.1, 0.25, 0.5, 0.8, 0.95)[severity - 1])
    for row in rng.permutation(rows)[:lost]:
        result[row * 16 : row * 16 + 16] = 128
    return result


def glare(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """The low sun in the picture and on the water."""
    height, width = picture.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    sun_x, sun_y = rng.uniform(0.2, 0.8) * width, rng.uniform(0.05, 0.4) * height
    halo = np.exp(-np.hypot(x - sun_x, y - sun_y) / (width * (0.05, 0.1, 0.2, 0.4, 0.8)[severity - 1]))
    streak = np.exp(-np.abs(x - sun_x) / (width * 0.04 * severity)) * (y > sun_y) * 0.6
    return _to_uint8(picture + 255.0 * np.maximum(halo, streak)[:, :, None])


def fog(picture: U8, severity: int, _: np.random.Generator) -> U8:
    """Contrast fades upwards, with distance."""
    left = (0.75, 0.55, 0.4, 0.25, 0.12)[severity - 1]
    clear = left + (1.0 - left) * np.linspace(0.0, 0.6, picture.shape[0])[:, None, None]
    return _to_uint8(picture * clear + 200.0 * (1.0 - clear))


def night(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Little light and the gain turned up."""
    gain = (0.6, 0.45, 0.32, 0.22, 0.15)[severity - 1]
    dim = 255.0 * (picture / 255.0) ** 1.2 * gain * np.array((1.15, 1.0, 0.85))
    return _to_uint8(dim + rng.normal(0.0, 2.0 + severity, picture.shape))


def rain(picture: U8, severity: int, rng: np.random.Generator) -> U8:
    """Streaks and a haze."""
    height, width = picture.shape[:2]
    seeds = (rng.random((height, width)) > 1.0 - 0.004 * severity).astype(np.float32)
    length = 9 + 2 * severity
    kernel = np.zeros((length, length), np.float32)
    cv2.line(kernel, (length // 2 - 2, 0), (length // 2 + 2, length - 1), (1.0,), 1)
    streaks = np.clip(cv2.filter2D(seeds, -1, kernel), 0.0, 1.0)[:, :, None]
    haze = 0.06 * severity
    return _to_uint8((picture * (1.0 - haze) + 180.0 * haze) * (1.0 - 0.5 * streaks) + 220.0 * 0.5 * streaks)


def false_colour(picture: U8, severity: int, _: np.random.Generator) -> U8:
    """Channels mixed up, at the end a negative."""
    orders = ((0, 0, 0), (2, 1, 0), (1, 2, 0), (1, 0, 2), (0, 1, 2))
    result = np.ascontiguousarray(picture[:, :, orders[severity - 1]])
    return np.asarray(255 - result, np.uint8) if severity == 5 else result


def shuffled(picture: U8, mask: U8, severity: int, rng: np.random.Generator) -> tuple[U8, U8]:
    """Blocks in each other's place."""
    rows, columns = 6, 8
    places = np.arange(rows * columns)
    moved = rng.permutation(places)[: round(len(places) * (0.15, 0.3, 0.5, 0.75, 1.0)[severity - 1])]
    places[moved] = rng.permutation(moved)
    return _permute_tiles(picture, places, rows, columns), _permute_tiles(mask, places, rows, columns)


def sheared(picture: U8, mask: U8, severity: int, _: np.random.Generator) -> tuple[U8, U8]:
    """Lines of a wrong length: each row begins further along."""
    step = (0.05, 0.15, 0.4, 1.0, 3.0)[severity - 1]

    def skewed(grid: U8) -> U8:
        scale = grid.shape[1] / 320
        return np.stack([np.roll(row, round(i * step * scale), axis=0) for i, row in enumerate(grid)])

    return skewed(picture), skewed(mask)


def tilted(picture: U8, mask: U8, severity: int, rng: np.random.Generator) -> tuple[U8, U8]:
    """The camera is not upright: 12, 30, 60, 120, 180 degrees."""
    angle_deg = (12.0, 30.0, 60.0, 120.0, 180.0)[severity - 1] * float(rng.choice((-1.0, 1.0)))
    return _rotate(picture, angle_deg, cv2.INTER_LINEAR, cv2.BORDER_REFLECT), _rotate(
        mask, angle_deg, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT
    )


FAULTS: dict[str, Fault] = {
    fault.__name__: fault
    for fault in (
        black, white, one_colour, underexposed, overexposed, blur, motion_blur, noise, salt_and_pepper, cover, drops,
        colour_bars, compression, drop_out, glare, fog, night, rain, false_colour,
    )
}  # fmt: skip
GEOMETRIC_FAULTS: dict[str, GeometricFault] = {move.__name__: move for move in (shuffled, sheared, tilted)}


def apply_fault(name: str, picture: U8, mask: U8, severity: int, rng: np.random.Generator) -> tuple[U8, U8]:
    """The picture with one fault, and the class mask of what it then shows (`IGNORE` where nothing is known)."""
    if name in GEOMETRIC_FAULTS:
        return GEOMETRIC_FAULTS[name](picture, mask, severity, rng)
    return FAULTS[name](picture, severity, rng), mask


def required_verdict(fault: str, miou: float) -> Literal["reject", "accept", "free"]:
    """What the image-quality check must do with pictures on which the segmenter reaches that mean IoU."""
    if miou < MUST_REJECT or fault == NO_WATER:
        return "reject"
    return "accept" if miou > MUST_ACCEPT else "free"


def crop_above_water(picture: U8, mask: U8) -> U8 | None:
    """The part of a picture above its water, scaled to the picture's size; None where that part is too small."""
    height, width = picture.shape[:2]
    rows = np.flatnonzero((mask == WATER).mean(axis=1) > 0.02)
    top = int(rows[0]) * height // mask.shape[0] if rows.size else height
    if top < MIN_NO_WATER_FRAC * height:
        return None
    part = min(width, round(top * width / height))
    left = (width - part) // 2
    return np.asarray(cv2.resize(picture[:top, left : left + part], (width, height)), np.uint8)


def _to_uint8(values: NDArray[np.floating]) -> U8:
    return np.asarray(np.clip(values, 0.0, 255.0), np.uint8)


def _permute_tiles(grid: U8, places: NDArray[np.intp], rows: int, columns: int) -> U8:
    height, width = grid.shape[0] // rows, grid.shape[1] // columns
    result = grid.copy()
    for to, source in enumerate(places.tolist()):
        (ty, tx), (sy, sx) = divmod(to, columns), divmod(source, columns)
        result[ty * height : (ty + 1) * height, tx * width : (tx + 1) * width] = grid[
            sy * height : (sy + 1) * height, sx * width : (sx + 1) * width
        ]
    return result


def _rotate(grid: U8, angle_deg: float, interpolation: int, border: int) -> U8:
    height, width = grid.shape[:2]
    turn = cv2.getRotationMatrix2D((width / 2 - 0.5, height / 2 - 0.5), angle_deg, 1.0)
    return np.asarray(
        cv2.warpAffine(grid, turn, (width, height), flags=interpolation, borderMode=border, borderValue=(IGNORE,) * 3),
        np.uint8,
    )
