"""Labelled pictures rendered from the worlds, for training the models. What weather hides has no label.

The folder has the form of the real sources: `images/*.jpg`, `masks/*.png` (0 obstacle, 1 water,
2 sky), `labels/*.txt` (class, then box centre and size, normalised; classes in the detector's
order, C2) and `manifest.json`. The same arguments give the same files.
"""

import collections
import contextlib
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import cv2
import msgspec
import numpy as np
from tqdm import tqdm

from paani.arrays import U8
from paani.cluster import InProcess, Workers
from paani.whole_file import indented_json, new_folder
from paani_sim.eye.camera import Camera
from paani_sim.eye.labels import CLASSES, Labelled, select_visible_boxes
from paani_sim.eye.renderer import Eye
from paani_sim.eye.scatter import random_pose, scatter
from paani_sim.eye.sky import SKIES
from paani_sim.worlds import FIXED_WORLDS, load_world
from paani_sim.worlds.world import Kind, Light, Obstacle, Wind, World

PICTURES_PER_SESSION = 24
PICTURES_PER_SKY = 4
DESERTED_EVERY = 3  # of so many sessions one shows nobody: what stands on a bank without people is told from people
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


class Session(msgspec.Struct, frozen=True, kw_only=True):
    """One piece of work: pictures of one shore. number: from 0; it chooses the world and seeds the pictures."""

    number: int
    pictures: int
    seed: int
    world: str
    width_px: int
    height_px: int


class DrawnSession(msgspec.Struct, frozen=True):
    """Files by their path in the folder, their rows of the manifest, and the number of boxes of each kind."""

    files: dict[str, bytes]
    items: tuple[Item, ...]
    boxes: dict[str, int]


def write_dataset(
    out: Path,
    n: int,
    seed: int = 0,
    worlds: Sequence[str] = FIXED_WORLDS,
    *,
    width_px: int = 320,
    height_px: int = 240,
    workers: Workers | None = None,
) -> Manifest:
    """Write `n` labelled pictures to the new folder `out` and return its manifest.

    Some are flatter than `height_px`. Written beside and renamed when complete. workers: who draws; this process if not
    given. Raises `UserError` for a folder that exists, an unknown world or missing OpenGL.
    """
    for name in worlds:
        load_world(name)
    sessions = [
        Session(
            number=number,
            pictures=min(PICTURES_PER_SESSION, n - first),
            seed=seed,
            world=worlds[number % len(worlds)],
            width_px=width_px,
            height_px=height_px,
        )
        for number, first in enumerate(range(0, n, PICTURES_PER_SESSION))
    ]
    with new_folder(out, "--out") as beside:
        for folder in ("images", "masks", "labels"):
            (beside / folder).mkdir()
        rows: dict[int, DrawnSession] = {}

        def keep(index: int, drawn: DrawnSession) -> None:
            for name, data in drawn.files.items():
                (beside / name).write_bytes(data)
            rows[index] = msgspec.structs.replace(drawn, files={})

        with (
            tqdm(total=n, unit="picture", desc="pictures") as progress,
            contextlib.closing((workers or InProcess()).run(draw_session, sessions, keep)) as done,
        ):
            for index in done:
                progress.update(sessions[index].pictures)
        manifest = _list_sessions(seed, [rows[index] for index in range(len(sessions))])
        (beside / "manifest.json").write_bytes(indented_json(manifest))
        return manifest


def draw_session(session: Session) -> DrawnSession:
    """Draw the pictures of one session. Raises UserError for missing OpenGL."""
    rng = np.random.default_rng([session.seed, session.number])
    world = _vary_world(load_world(session.world), rng)
    deserted = session.number % DESERTED_EVERY == DESERTED_EVERY - 1
    if deserted:
        world = dataclasses.replace(world, obstacles=_without_people(world.obstacles))
    seq = f"{world.name}_{session.seed}_{session.number:03d}"
    height = round(session.height_px * FLATTER) if rng.random() < FLAT_FRAC else session.height_px
    files: dict[str, bytes] = {}
    items: list[Item] = []
    boxes: collections.Counter[str] = collections.Counter()
    with Eye(world, Camera(width_px=session.width_px, height_px=height), supersample=2) as eye:
        for k in range(session.pictures):
            view = _render_picture(eye, k, rng, deserted=deserted)
            items.append(_encode_picture(files, seq, k, view, rng))
            boxes.update(str(box.kind) for box in view.boxes)
    return DrawnSession(files, tuple(items), dict(boxes))


def _list_sessions(seed: int, sessions: Sequence[DrawnSession]) -> Manifest:
    kinds = tuple(str(kind) for kind in CLASSES)
    items = tuple(item for drawn in sessions for item in drawn.items)
    return Manifest(
        seed=seed,
        class_ids=kinds,
        images=len(items),
        boxes={kind: sum(drawn.boxes.get(kind, 0) for drawn in sessions) for kind in kinds},
        items=items,
    )


def _vary_world(world: World, rng: np.random.Generator) -> World:
    """The same shore with other land, plants, season and water."""
    return dataclasses.replace(
        world,
        seed=int(rng.integers(1 << 30)),
        water_rgb=WATERS[int(rng.integers(len(WATERS)))],
        season_frac=float(rng.beta(0.8, 1.6)),
    )


def _render_picture(eye: Eye, k: int, rng: np.random.Generator, *, deserted: bool) -> Labelled:
    """One picture with its own pose, camera and things, and now and then another sky. deserted: with nobody in it."""
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
    things = scatter(eye.world, pose, rng)
    eye.place_obstacles(_without_people(things) if deserted else things)
    view = eye.render_labelled(pose, float(rng.uniform(0.0, 600.0)))
    return dataclasses.replace(view, boxes=select_visible_boxes(view))


def _without_people(things: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Leave out whoever stands, walks, sits or swims; boats keep their crews."""
    return tuple(thing for thing in things if thing.kind is not Kind.PERSON)


def _encode_picture(files: dict[str, bytes], seq: str, k: int, view: Labelled, rng: np.random.Generator) -> Item:
    """Add picture, mask and label to the files."""
    height, width = view.mask.shape
    stem = f"{seq}_{k:02d}"
    quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(72, 96))]
    files[f"images/{stem}.jpg"] = cv2.imencode(".jpg", _vary_colours(view.bgr, rng), quality)[1].tobytes()
    files[f"masks/{stem}.png"] = cv2.imencode(".png", view.mask)[1].tobytes()
    lines = []
    for box in view.boxes:
        centre = (0.5 * (box.x0_px + box.x1_px) / width, 0.5 * (box.y0_px + box.y1_px) / height)
        size = ((box.x1_px - box.x0_px) / width, (box.y1_px - box.y0_px) / height)
        values = " ".join(f"{v:.6f}" for v in (*centre, *size))
        lines.append(f"{CLASSES.index(box.kind)} {values}\n")
    files[f"labels/{stem}.txt"] = "".join(lines).encode()
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
