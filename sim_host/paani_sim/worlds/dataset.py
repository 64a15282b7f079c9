"""Labelled pictures rendered from the worlds, for training the models. What weather hides has no label.

The folder has the form of the real sources: `images/*.jpg`, `masks/*.png` (0 obstacle, 1 water,
2 sky), `labels/*.txt` (class, then box centre and size, normalised; classes in the detector's
order, C2) and `manifest.json`. The same arguments give the same files.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import cv2
import msgspec
import numpy as np
from tqdm import tqdm

from paani.arrays import U8
from paani.errors import UserError
from paani.whole_file import indented_json, new_folder
from paani_sim.eye.camera import Camera
from paani_sim.eye.labels import CLASSES, Labelled, select_visible_boxes
from paani_sim.eye.renderer import Eye
from paani_sim.eye.scatter import random_pose, scatter
from paani_sim.eye.sky import SKIES
from paani_sim.worlds import WORLDS, load_world
from paani_sim.worlds.world import Light, Wind, World

PICTURES_PER_SESSION = 24
PICTURES_PER_SKY = 4
FOG_FRAC, RAIN_FRAC = 0.12, 0.15  # of the skies
SUN_AHEAD_FRAC, AHEAD_RAD = 0.2, 0.4  # of the skies: the sun before the camera, and glints on the water below it
LENS_FRAC = 0.35  # of the pictures come through a lens that bends
HFOV_DEG = (52.0, 108.0)  # small board cameras, narrow to wide
FLAT_FRAC, FLATTER = 0.35, 0.75  # sessions with a flatter picture, as 16:9 is to 4:3
WATERS: tuple[tuple[float, float, float], ...] = (
    (0.30, 0.34, 0.22),
    (0.40, 0.36, 0.24),
    (0.20, 0.28, 0.26),
    (0.16, 0.24, 0.30),
    (0.46, 0.42, 0.32),
    (0.14, 0.18, 0.16),
)


class Item(msgspec.Struct, frozen=True):
    """One picture of the manifest; paths are relative to the folder."""

    file: str
    seq: str
    wh: tuple[int, int]
    mask: str
    label: str


class Manifest(msgspec.Struct, frozen=True, kw_only=True):
    """What the folder holds."""

    origin: str = "rendered by paani_sim.worlds.dataset"
    seed: int
    class_ids: tuple[str, ...]
    images: int
    boxes: dict[str, int]
    items: tuple[Item, ...]


def write_dataset(
    out: Path,
    n: int,
    seed: int = 0,
    worlds: Sequence[str] = tuple(WORLDS),
    *,
    width_px: int = 320,
    height_px: int = 240,
) -> Manifest:
    """Write `n` labelled pictures to the new folder `out` and return its manifest.

    Some are flatter than `height_px`. Written beside and renamed when complete. Raises `UserError` for a folder that
    exists, an unknown world or missing OpenGL.
    """
    places = [load_world(name) for name in worlds]
    with new_folder(out, "--out") as beside:
        for folder in ("images", "masks", "labels"):
            (beside / folder).mkdir()
        return _draw_pictures(beside, n, seed, places, (width_px, height_px))


def _draw_pictures(folder: Path, n: int, seed: int, places: Sequence[World], size_px: tuple[int, int]) -> Manifest:
    width_px, height_px = size_px
    items: list[Item] = []
    boxes = dict.fromkeys((str(kind) for kind in CLASSES), 0)
    with tqdm(total=n, unit="picture", desc="pictures") as progress:
        session = 0
        while len(items) < n:
            rng = np.random.default_rng([seed, session])
            world = _vary_world(places[session % len(places)], rng)
            seq = f"{world.name}_{seed}_{session:03d}"
            height = round(height_px * FLATTER) if rng.random() < FLAT_FRAC else height_px
            with Eye(world, Camera(width_px=width_px, height_px=height), supersample=2) as eye:
                for k in range(min(PICTURES_PER_SESSION, n - len(items))):
                    view = _render_picture(eye, k, rng)
                    items.append(_write_picture(folder, seq, k, view, rng))
                    for box in view.boxes:
                        boxes[str(box.kind)] += 1
                    progress.update()
            session += 1
    manifest = Manifest(
        seed=seed,
        class_ids=tuple(str(kind) for kind in CLASSES),
        images=len(items),
        boxes=boxes,
        items=tuple(items),
    )
    (folder / "manifest.json").write_bytes(indented_json(manifest))
    return manifest


def _vary_world(world: World, rng: np.random.Generator) -> World:
    """The same shore with other land, plants, season and water."""
    return dataclasses.replace(
        world,
        seed=int(rng.integers(1 << 30)),
        water_rgb=WATERS[int(rng.integers(len(WATERS)))],
        season_frac=float(rng.beta(0.8, 1.6)),
    )


def _render_picture(eye: Eye, k: int, rng: np.random.Generator) -> Labelled:
    """One picture with its own pose, camera and things, and now and then another sky."""
    pose = dataclasses.replace(random_pose(eye.world, rng), yaw_rate_radps=float(rng.normal(0.0, 0.25)))
    if k % PICTURES_PER_SKY == 0:
        light = Light(
            sky=str(rng.choice(SKIES, p=[0.2, 0.3, 0.22, 0.14, 0.14])),
            sun_azimuth_rad=float(rng.uniform(-np.pi, np.pi)),
            sun_elevation_rad=float(rng.uniform(0.15, 1.2)),
            visibility_m=float(120.0 * 15.0 ** rng.random()),
            seed=int(rng.integers(1 << 30)),
        )
        if rng.random() < SUN_AHEAD_FRAC:
            light = dataclasses.replace(light, sun_azimuth_rad=float(rng.normal(pose.yaw_rad, AHEAD_RAD)))
        if rng.random() < FOG_FRAC:
            light = dataclasses.replace(light, visibility_m=float(rng.uniform(18.0, 90.0)))
        if rng.random() < RAIN_FRAC:
            sky = str(rng.choice(["overcast", "overcast", "cloudy", "dusk"]))
            light = dataclasses.replace(light, sky=sky, rain_mmph=float(rng.gamma(1.5, 6.0)))
        wind = Wind(float(rng.gamma(1.6, 1.6)), float(rng.uniform(-np.pi, np.pi)))
        eye.set_weather(light, wind)
    eye.exposure = float(1.15 * np.exp(rng.normal(0.0, 0.28)))
    hfov_deg = float(rng.uniform(*HFOV_DEG))
    bend = min(1.0, (np.tan(np.radians(44.0)) / np.tan(np.radians(0.5 * hfov_deg))) ** 2)  # as much at the edge
    eye.camera = dataclasses.replace(
        eye.camera,
        hfov_deg=hfov_deg,
        up_m=float(rng.uniform(0.35, 1.6)),
        down_deg=float(rng.normal(3.5, 3.0)),
        k1=float(bend * rng.uniform(-0.10, 0.03)) if rng.random() < LENS_FRAC else 0.0,
        shutter_s=float(rng.uniform(0.0, 0.03)),
    )
    eye.place_obstacles(scatter(eye.world, pose, rng))
    view = eye.render_labelled(pose, float(rng.uniform(0.0, 600.0)))
    return dataclasses.replace(view, boxes=select_visible_boxes(view))


def _write_picture(folder: Path, seq: str, k: int, view: Labelled, rng: np.random.Generator) -> Item:
    height, width = view.mask.shape
    stem = f"{seq}_{k:02d}"
    quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(72, 96))]
    _save_image(folder / f"images/{stem}.jpg", _vary_colours(view.bgr, rng), quality)
    _save_image(folder / f"masks/{stem}.png", view.mask, [])
    lines = []
    for box in view.boxes:
        centre = (0.5 * (box.x0_px + box.x1_px) / width, 0.5 * (box.y0_px + box.y1_px) / height)
        size = ((box.x1_px - box.x0_px) / width, (box.y1_px - box.y0_px) / height)
        values = " ".join(f"{v:.6f}" for v in (*centre, *size))
        lines.append(f"{CLASSES.index(box.kind)} {values}\n")
    (folder / f"labels/{stem}.txt").write_text("".join(lines))
    return Item(f"images/{stem}.jpg", seq, (width, height), f"masks/{stem}.png", f"labels/{stem}.txt")


def _vary_colours(bgr: U8, rng: np.random.Generator) -> U8:
    """Another camera's white balance, contrast, saturation and softness."""
    grey = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).astype(np.float32)[..., None]
    colour = grey + (bgr.astype(np.float32) - grey) * rng.uniform(0.45, 1.15)
    colour = (colour - 118.0) * rng.uniform(0.85, 1.3) + 118.0
    colour = colour * rng.normal(1.0, 0.035, 3).astype(np.float32)
    if rng.random() < 0.4:
        colour = cv2.GaussianBlur(colour, (0, 0), float(rng.uniform(0.4, 1.1)))
    if rng.random() < 0.3:
        colour = colour + rng.normal(0.0, rng.uniform(2.0, 8.0), colour.shape)
    return np.asarray(np.clip(colour, 0.0, 255.0), np.uint8)


def _save_image(path: Path, picture: U8, options: list[int]) -> None:
    if not cv2.imwrite(str(path), picture, options):
        raise UserError(f"dataset: cannot write {path}")
