"""Seeded picture augmentation. Every function takes its generator; the same seed gives the same bytes.

Pictures are RGB uint8 [H,W,3]; masks are segmenter classes uint8 [H,W].
"""

from __future__ import annotations

import cv2
import numpy as np

from paani.arrays import F32, U8
from paani_models.datasets.sources import IGNORE

Rng = np.random.Generator

# S8: share of pictures with glare, and shares of those with a soft blob and with glitter.
GLARE_FRAC, BLOB_FRAC, GLITTER_FRAC = 0.35, 0.7, 0.6
MIRROR_FRAC = 0.3  # share of pictures with banks mirrored in the water
CONCRETE_FRAC = 0.12  # share of pictures into which synthetic concrete is pasted
LAND_FRAC = 0.15  # share of pictures for which a crop without water is sought; about one in three has one

WATER, OBSTACLE = 0, 1


def random_affine(rng: Rng, source_wh: tuple[int, int], target_wh: tuple[int, int], tilt_deg: float) -> F32:
    """Source pixels -> target pixels: flip, zoom 0.85..2.2 with aspect jitter, shift, roll.

    The roll is up to `tilt_deg`, rarely two and a half times that.

    Zoom 1 stretches the whole source onto the whole target, as the runtime does.
    """
    zoom = float(np.exp(rng.uniform(np.log(0.85), np.log(2.2)))) if rng.random() < 0.85 else 1.0
    aspect = float(np.exp(rng.uniform(-0.15, 0.15)))
    scale_x = target_wh[0] / source_wh[0] * zoom * aspect
    scale_y = target_wh[1] / source_wh[1] * zoom / aspect
    if rng.random() < 0.5:
        scale_x = -scale_x
    reach_deg = tilt_deg * (2.5 if rng.random() < 0.15 else 1.0)
    angle = np.deg2rad(rng.uniform(-reach_deg, reach_deg)) if rng.random() < 0.5 else 0.0
    cos, sin = np.cos(angle), np.sin(angle)
    linear = np.array([[cos * scale_x, -sin * scale_y], [sin * scale_x, cos * scale_y]])
    slack_x = max(0.0, 1.0 - target_wh[0] / (source_wh[0] * abs(scale_x)))
    slack_y = max(0.0, 1.0 - target_wh[1] / (source_wh[1] * abs(scale_y)))
    centre = np.array(
        [
            source_wh[0] * (0.5 + rng.uniform(-0.5, 0.5) * slack_x),
            source_wh[1] * (0.5 + rng.uniform(-0.5, 0.5) * slack_y),
        ]
    )
    shift = np.array(target_wh) / 2.0 - linear @ centre
    return np.hstack([linear, shift[:, None]]).astype(np.float32)


def warp_picture(picture: U8, affine: F32, target_wh: tuple[int, int]) -> U8:
    """Bilinear; the border repeats the edge, so no edge is drawn where the picture ends."""
    moved = cv2.warpAffine(picture, affine, target_wh, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.uint8)


def warp_mask(mask: U8, affine: F32, target_wh: tuple[int, int]) -> U8:
    """Nearest; outside the picture is ignored."""
    moved = cv2.warpAffine(
        mask, affine, target_wh, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=(IGNORE,)
    )
    return np.asarray(moved, np.uint8)


def jitter_colour(rng: Rng, picture: U8) -> U8:
    """Hue, saturation, gamma, contrast, brightness, white balance, within the range that weather and cameras give."""
    if rng.random() < 0.4:
        picture = np.clip(picture * rng.uniform(0.85, 1.15, 3), 0, 255).astype(np.uint8)
    hsv = cv2.cvtColor(picture, cv2.COLOR_RGB2HSV)
    steps = np.arange(256, dtype=np.float32)
    hue = ((steps + rng.uniform(-8, 8)) % 180).astype(np.uint8)
    saturation = np.clip(steps * rng.uniform(0.4, 1.5), 0, 255).astype(np.uint8)
    curve = (steps / 255.0) ** np.exp(rng.uniform(-0.5, 0.5)) * 255.0
    value = np.clip((curve - 128) * rng.uniform(0.7, 1.3) + 128 + rng.uniform(-30, 30), 0, 255).astype(np.uint8)
    planes = [cv2.LUT(plane, table) for plane, table in zip(cv2.split(hsv), (hue, saturation, value), strict=True)]
    return np.asarray(cv2.cvtColor(cv2.merge(planes), cv2.COLOR_HSV2RGB), np.uint8)


def add_glare(rng: Rng, picture: U8) -> U8:
    """Add sun on the water: a soft bright blob, and glitter of small strokes in the lower half (S8, S12)."""
    height, width = picture.shape[:2]
    light = np.zeros((height, width), np.float32)
    if rng.random() < BLOB_FRAC:
        centre = (int(rng.integers(width)), int(rng.integers(height // 4, height)))
        axes = (
            int(rng.integers(width // 16, width // 4)),
            int(rng.integers(height // 16, height // 3)),
        )
        cv2.ellipse(
            light,
            centre,
            axes,
            float(rng.uniform(0, 180)),
            0,
            360,
            (float(rng.uniform(0.4, 1.0)),),
            -1,
        )
        light = cv2.GaussianBlur(light, (0, 0), max(2.0, min(axes) / 2)).astype(np.float32)
    if rng.random() < GLITTER_FRAC:
        middle, spread = rng.uniform(0, width), rng.uniform(width / 20, width / 5)
        for _ in range(int(rng.integers(20, 120))):
            x, y = int(rng.normal(middle, spread)), int(rng.integers(height // 2, height))
            reach = int(rng.integers(1, 2 + width // 64))
            cv2.line(light, (x - reach, y), (x + reach, y), (float(rng.uniform(0.5, 1.0)),), 1)
    tint = np.array([1.0, rng.uniform(0.92, 1.0), rng.uniform(0.75, 1.0)], np.float32) * 255.0
    lit = picture + light[..., None] * (tint - picture)
    return np.clip(lit, 0, 255).astype(np.uint8)


def mirror_banks_in_water(rng: Rng, picture: U8, mask: U8) -> U8:
    """Mirror what stands above the water's far edge in it, rippled, stretched and dimmed, as in calm water."""
    height, width = mask.shape
    water = mask == WATER
    edge = np.where(water.any(0), water.argmax(0), 0).astype(np.float32)
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    depth = rows - edge
    ripple = rng.standard_normal((height // 3, width // 12), dtype=np.float32)
    ripple = np.asarray(cv2.resize(ripple, (width, height)), np.float32) * rng.uniform(0.0, 0.08) * depth
    source = np.clip(edge - depth * rng.uniform(0.6, 1.2) + ripple, 0, height - 1).astype(np.float32)
    mirrored = cv2.remap(picture, columns + ripple * 0.5, source, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    share = rng.uniform(0.25, 0.85) * cv2.blur(water.astype(np.float32), (3, 3))[..., None] * water[..., None]
    return np.clip(picture * (1 - share) + mirrored * rng.uniform(0.65, 1.0) * share, 0, 255).astype(np.uint8)


def degrade_picture(rng: Rng, picture: U8) -> U8:
    """Degrade as lens and sensor do: blur, haze, noise and JPEG blocks, each sometimes."""
    if rng.random() < 0.15:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.4, 1.8)).astype(np.uint8, copy=False)
    if rng.random() < 0.12:
        haze = np.full(3, rng.uniform(150, 235), np.float32)
        share = rng.uniform(0.1, 0.6)
        picture = np.clip(picture * (1 - share) + haze * share, 0, 255).astype(np.uint8)
    if rng.random() < 0.25:
        picture = add_noise(rng, picture, rng.uniform(2, 14))
    if rng.random() < 0.1:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 80))]
        picture = np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, quality)[1], cv2.IMREAD_COLOR), np.uint8)
    return picture


def add_noise(rng: Rng, picture: U8, sigma: float) -> U8:
    """Gaussian sensor noise; sigma in grey levels."""
    noise = rng.standard_normal(picture.shape, dtype=np.float32)
    return np.clip(picture + noise * sigma, 0, 255).astype(np.uint8)


def cover_rectangle(rng: Rng, picture: U8, mask: U8) -> tuple[U8, U8]:
    """Cover one rectangle with a flat colour; what is covered is not judged."""
    height, width = mask.shape
    h, w = int(rng.integers(height // 16, height // 4)), int(rng.integers(width // 16, width // 4))
    y, x = int(rng.integers(height - h)), int(rng.integers(width - w))
    picture, mask = picture.copy(), mask.copy()
    picture[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    mask[y : y + h, x : x + w] = IGNORE
    return picture, mask


def crop_land(rng: Rng, picture: U8, mask: U8) -> tuple[U8, U8] | None:
    """Crop a part without any water, at least 60 % obstacle; None where eight tries find none.

    It stands for the view of a boat against a bank: land down to the bottom of the picture.
    """
    height, width = mask.shape
    for _ in range(8):
        h, w = int(rng.integers(height // 5, height // 2)), int(rng.integers(width // 4, width))
        y, x = int(rng.integers(height - h)), int(rng.integers(width - w))
        part = mask[y : y + h, x : x + w]
        if (
            not (part == WATER).any()
            and (part == OBSTACLE).mean() >= 0.6
            and (part[-h // 4 :] == OBSTACLE).mean() > 0.9
        ):
            return picture[y : y + h, x : x + w], part
    return None


def crop_obstacle(rng: Rng, picture: U8, mask: U8) -> U8 | None:
    """Find a rectangle that is all obstacle, give or take a twentieth; None where six tries find none."""
    height, width = mask.shape
    for _ in range(6):
        h, w = int(rng.integers(height // 8, height // 2)), int(rng.integers(width // 8, width // 2))
        y, x = int(rng.integers(height - h)), int(rng.integers(width - w))
        if (mask[y : y + h, x : x + w] == OBSTACLE).mean() >= 0.95:
            return picture[y : y + h, x : x + w]
    return None


def draw_concrete(rng: Rng) -> U8:
    """Draw a smooth wall: one grey, stained in vertical streaks, sometimes with joints and a wet foot."""
    height, width = 120, 240
    wall = np.full((height, width, 3), rng.uniform(50, 215), np.float32) + rng.normal(0, 6, 3).astype(np.float32)
    streaks = rng.standard_normal((int(rng.integers(1, 4)), int(rng.integers(10, 80))), dtype=np.float32)
    clouds = rng.standard_normal((int(rng.integers(3, 9)), int(rng.integers(4, 16))), dtype=np.float32)
    for grid, reach in ((streaks, 18.0), (clouds, 14.0)):
        wall += np.asarray(cv2.resize(grid, (width, height)), np.float32)[..., None] * rng.uniform(0.1, 1.0) * reach
    if rng.random() < 0.5:
        spacing, dark = int(rng.integers(24, 80)), rng.uniform(5, 40)
        wall[:, ::spacing] -= dark
        wall[int(rng.integers(10, height)) :: spacing] -= dark
    if rng.random() < 0.5:
        wall[int(rng.uniform(0.7, 0.98) * height) :] *= rng.uniform(0.4, 0.8)
    return add_noise(rng, np.clip(wall, 0, 255).astype(np.uint8), rng.uniform(0, 10))


def paste_obstacle(rng: Rng, picture: U8, mask: U8, patch: U8) -> tuple[U8, U8]:
    """Stand a patch in the picture: as a wall along one side, receding, or as a block; what it covers is obstacle.

    On rivers the bottom of the picture is otherwise always water, and the network would learn just that.
    """
    height, width = mask.shape
    if rng.random() < 0.7:
        near, far = rng.uniform(0.0, 0.5), rng.uniform(0.25, 0.55)
        reach, foot = rng.uniform(0.15, 0.6), rng.uniform(0.6, 0.95)
        quad = np.array([[0, min(near, far)], [reach, far], [reach, foot], [0, rng.uniform(foot, 1.6)]], np.float32)
        if rng.random() < 0.5:
            quad[:, 0] = 1.0 - quad[:, 0]
    else:
        x, w = rng.uniform(0.0, 0.9), rng.uniform(0.05, 0.35)
        top, bottom = rng.uniform(0.1, 0.6), rng.uniform(0.62, 1.1)
        quad = np.array([[x, top], [x + w, top], [x + w, bottom], [x, bottom]], np.float32)
    h, w = patch.shape[:2]
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]], np.float32)
    warp = cv2.getPerspectiveTransform(corners, quad * np.array([width, height], np.float32))
    shaded = np.clip(patch * rng.uniform(0.6, 1.3), 0, 255).astype(np.uint8)
    pasted = cv2.warpPerspective(shaded, warp, (width, height), flags=cv2.INTER_LINEAR)
    covered = cv2.warpPerspective(np.ones((h, w), np.uint8), warp, (width, height), flags=cv2.INTER_NEAREST) > 0
    return (
        np.where(covered[..., None], pasted, picture).astype(np.uint8),
        np.where(covered, OBSTACLE, mask).astype(np.uint8),
    )


def draw_null_picture(rng: Rng, target_wh: tuple[int, int]) -> U8:
    """Draw a picture that shows nothing: dark, bright, flat, gradient, covered lens or noise, with sensor noise."""
    width, height = target_wh
    kind = int(rng.integers(7))
    flat = np.zeros((height, width, 3), np.float32)
    if kind == 0:
        flat += rng.uniform(0, 12)
    elif kind == 1:
        flat += rng.uniform(235, 255)
    elif kind == 2:
        flat += rng.uniform(0, 255, 3).astype(np.float32)
    elif kind == 3:
        flat += rng.uniform(20, 235)
    elif kind == 4:
        ends = rng.uniform(0, 255, (2, 3)).astype(np.float32)
        if rng.random() < 0.5:
            ends[:] = ends.mean(1, keepdims=True)
        ramp = np.linspace(0, 1, width if rng.random() < 0.5 else height, dtype=np.float32)
        ramp = (
            ramp[None, :, None]
            if ramp.size == width and rng.random() < 0.5
            else np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
        )
        flat += ends[0] + ramp * (ends[1] - ends[0])
    elif kind == 5:
        flat += np.array([rng.uniform(20, 110), rng.uniform(10, 70), rng.uniform(5, 50)], np.float32)
        shade = rng.uniform(0, 1, (3, 4, 1)).astype(np.float32)
        flat *= 0.4 + 0.8 * cv2.resize(shade, target_wh, interpolation=cv2.INTER_CUBIC)[..., None]
    else:
        coarse = int(2 ** rng.integers(0, 5))
        grid = (height // coarse, width // coarse, 3 if rng.random() < 0.6 else 1)
        noise = rng.uniform(0, 255, grid).astype(np.float32)
        noise = cv2.resize(noise, target_wh, interpolation=cv2.INTER_LINEAR if coarse > 1 else cv2.INTER_NEAREST)
        flat += noise.reshape(height, width, -1)
    return add_noise(rng, np.clip(flat, 0, 255).astype(np.uint8), rng.uniform(0, 8))


def augment_segmenter_pair(
    rng: Rng, picture: U8, mask: U8, target_wh: tuple[int, int], patch: U8 | None = None
) -> tuple[U8, U8]:
    """Make one training pair of the target size; a patch of obstacle, if given, is pasted in."""
    affine = random_affine(rng, (picture.shape[1], picture.shape[0]), target_wh, tilt_deg=8.0)
    picture, mask = warp_picture(picture, affine, target_wh), warp_mask(mask, affine, target_wh)
    if patch is not None:
        picture, mask = paste_obstacle(rng, picture, mask, patch)
    if rng.random() < MIRROR_FRAC:
        picture = mirror_banks_in_water(rng, picture, mask)
    if rng.random() < 0.8:
        picture = jitter_colour(rng, picture)
    if rng.random() < GLARE_FRAC:
        picture = add_glare(rng, picture)
    picture = degrade_picture(rng, picture)
    if rng.random() < 0.2:
        picture, mask = cover_rectangle(rng, picture, mask)
    return picture, mask


def draw_null_pair(rng: Rng, target_wh: tuple[int, int]) -> tuple[U8, U8]:
    """Draw a picture that shows nothing, labelled all obstacle, so that an unusable picture does not read as water."""
    return draw_null_picture(rng, target_wh), np.full((target_wh[1], target_wh[0]), OBSTACLE, np.uint8)
