"""Pictures from the rendered camera. Skipped, saying so, only where OpenGL is missing."""

import dataclasses
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani_sim.eye import BoatPose, Camera, Eye, Labelled, project
from paani_sim.eye.camera import camera_pose
from paani_sim.eye.gl import Context
from paani_sim.worlds import (
    Kind,
    Light,
    Obstacle,
    Pose2,
    Wind,
    World,
    actor_distance_along_m,
    actor_pose_along,
    load_world,
)
from paani_sim.worlds.dataset import DESERTED_EVERY, Manifest, Session, draw_session, write_dataset

pytestmark = [pytest.mark.gl, pytest.mark.timeout(120)]


def _require_gl() -> None:
    try:
        Context().close()
    except UserError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def river() -> World:
    return load_world("river")


@pytest.fixture(scope="module")
def eye(river: World) -> Iterator[Eye]:
    _require_gl()
    with Eye(river) as made:
        yield made


def at_start(world: World) -> BoatPose:
    return BoatPose(*world.start)


def view(eye: Eye, pose: BoatPose, t_s: float = 3.0) -> Labelled:
    return eye.render_labelled(pose, t_s)


def test_same_pose_and_time_give_the_same_bits(eye: Eye, river: World) -> None:
    pose = at_start(river)
    first = eye.render(pose, 12.5).bgr
    eye.render(BoatPose(30.0, -5.0, 1.0), 90.0)
    assert np.array_equal(first, eye.render(pose, 12.5).bgr)
    assert np.array_equal(first, view(eye, pose, 12.5).bgr)


def test_another_eye_gives_the_same_bits(eye: Eye, river: World) -> None:
    first = eye.render(at_start(river), 7.0).bgr
    with Eye(river) as other:
        assert np.array_equal(first, other.render(at_start(river), 7.0).bgr)


def test_water_moves_with_time(eye: Eye, river: World) -> None:
    pose = at_start(river)
    water = view(eye, pose, 1.0).mask == 1
    step = np.abs(eye.render(pose, 1.0).bgr.astype(int) - eye.render(pose, 1.4).bgr.astype(int))
    assert step.max(axis=2)[water].mean() > 2.0


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize("name", ["lake", "river", "canal", "harbour"])
def test_picture_is_well_exposed_all_round_the_route(name: str) -> None:
    _require_gl()
    world = load_world(name)
    with Eye(world) as looking:
        for k in range(0, len(world.route_m), 9):
            step = world.route_m[(k + 1) % len(world.route_m)] - world.route_m[k]
            pose = BoatPose(float(world.route_m[k, 0]), float(world.route_m[k, 1]), float(np.arctan2(step[1], step[0])))
            seen = view(looking, pose)
            if any(b.visible_px > 15_000 for b in seen.boxes):
                continue  # something lies right ahead
            assert seen.bgr.shape == (240, 320, 3)
            assert seen.bgr.dtype == np.uint8
            assert 60.0 < seen.bgr.mean() < 200.0
            assert seen.bgr.std() > 20.0
            shares = np.bincount(seen.mask.ravel(), minlength=3) / seen.mask.size
            assert shares.sum() == pytest.approx(1.0)
            assert shares[1] > 0.15, (name, k)


def test_mask_has_sky_above_water_below_and_land_between(eye: Eye, river: World) -> None:
    mask = view(eye, at_start(river)).mask
    assert (mask[:30] == 2).mean() > 0.5
    assert (mask[200:] == 1).mean() > 0.9
    horizon = mask[95:112]
    assert (horizon == 0).mean() > 0.3
    assert not (mask[:80] == 1).any()
    assert not (mask[130:] == 2).any()


def test_far_scenery_closes_the_view(eye: Eye, river: World) -> None:
    """No column, in any direction, goes from sky straight to water."""
    x_m, y_m, _ = river.start
    for yaw_rad in np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False):
        mask = view(eye, BoatPose(x_m, y_m, float(yaw_rad))).mask
        above, below = mask[:-1], mask[1:]
        assert not ((above == 2) & (below == 1)).any()


def test_buoy_lands_where_the_projection_says(eye: Eye, river: World) -> None:
    """A can of known size in open water: its box is within 3 px of the projected outline."""
    x_m, y_m, yaw_rad = river.start
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    spot = np.array([x_m, y_m]) + 6.0 * ahead
    can = Obstacle("known", Kind.BUOY, "can", Pose2(float(spot[0]), float(spot[1]), 0.0), 0.8, 0.8, 1.2)
    eye.place_obstacles([can])
    try:
        for roll_rad in (0.0, 0.08):
            pose = dataclasses.replace(at_start(river), roll_rad=roll_rad)
            box = next(b for b in view(eye, pose).boxes if b.id == "known")
            around = np.linspace(0.0, 2.0 * np.pi, 64)
            rim = spot + 0.4 * np.column_stack([np.cos(around), np.sin(around)])
            outline = np.vstack([np.column_stack([rim, np.full(64, z)]) for z in (0.0, 1.2)])
            pixels = project(outline, pose, eye.camera)
            expected = (*pixels.min(axis=0), *pixels.max(axis=0))
            assert box[2:6] == pytest.approx(expected, abs=3.0)
    finally:
        eye.place_obstacles([])
    assert "known" not in {b.id for b in view(eye, at_start(river)).boxes}


def test_hidden_things_have_no_box(eye: Eye, river: World) -> None:
    x_m, y_m, yaw_rad = river.start
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])

    def place(number: int, range_m: float, size_m: float) -> Obstacle:
        spot = np.array([x_m, y_m]) + range_m * ahead
        return Obstacle(
            f"n{number}", Kind.BUOY, "can", Pose2(float(spot[0]), float(spot[1]), 0.0), size_m, size_m, size_m
        )

    eye.place_obstacles([place(0, 4.0, 2.0), place(1, 8.0, 0.6)])
    try:
        names = {b.id for b in view(eye, at_start(river)).boxes}
    finally:
        eye.place_obstacles([])
    assert "n0" in names
    assert "n1" not in names


def test_actor_moves_through_the_picture(eye: Eye, river: World) -> None:
    seen = set()
    for t_s in np.arange(0.0, 300.0, 10.0):
        for box in view(eye, BoatPose(60.0, float(river.route_m[6, 1]), 0.3), float(t_s)).boxes:
            if box.id == "boat_under_way":
                seen.add((box.x0_px, box.x1_px))
    assert len(seen) > 3


def test_actors_are_drawn_where_the_plant_says(eye: Eye, river: World) -> None:
    """`actors_along_m` overrides time; what time says gives the same picture."""
    pose = BoatPose(60.0, float(river.route_m[6, 1]), 0.3)
    by_time = [actor_distance_along_m(actor, 40.0) for actor in river.actors]
    assert np.array_equal(eye.render(pose, 40.0).bgr, eye.render(pose, 40.0, by_time).bgr)
    boat = next(k for k, actor in enumerate(river.actors) if actor.id == "boat_under_way")
    seen = set()
    for along_m in range(0, 300, 15):
        by_time[boat] = float(along_m)
        boxes = eye.render_labelled(pose, 40.0, by_time).boxes
        seen |= {b[2:4] for b in boxes if b.id == "boat_under_way"}
    assert len(seen) > 2
    with pytest.raises(ValueError, match="argument"):
        eye.render(pose, 40.0, by_time[:1])


@pytest.mark.rotating(cpu_s=6)
@pytest.mark.parametrize(("supersample", "first_row"), [(1.0, 115), (1.25, 125), (1.5, 125)])
@pytest.mark.parametrize(("roll_rad", "pitch_rad"), [pytest.param(0.0, 0.0, marks=pytest.mark.long), (0.06, -0.03)])
def test_depth_of_water_is_that_of_the_plane(
    river: World, supersample: float, first_row: int, roll_rad: float, pitch_rad: float
) -> None:
    """Within 1 % of the ray through each pixel's middle cut with z = 0; the sky is infinitely far."""
    _require_gl()
    pose = dataclasses.replace(at_start(river), roll_rad=roll_rad, pitch_rad=pitch_rad)
    with Eye(river, supersample=supersample) as looking:
        seen = view(looking, pose)
        camera = looking.camera
    position, turn = camera_pose(pose, camera)
    columns, rows = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    ray = np.stack([(columns - 160.0) / camera.focal_px, (120.0 - rows) / camera.focal_px, -np.ones_like(rows)], -1)
    down = ray @ turn.T[:, 2]
    water = (seen.mask == 1) & (rows > first_row) & (down < 0.0)
    expected = -position[2] / down[water]
    assert water.sum() > 20_000
    assert seen.depth_m[water] == pytest.approx(expected, rel=0.01)
    assert np.isinf(seen.depth_m[seen.mask == 2]).all()
    assert np.isfinite(seen.depth_m[seen.mask != 2]).all()
    assert seen.depth_m.dtype == np.float32


def test_a_lens_bends_picture_mask_and_boxes_alike(river: World) -> None:
    """A buoy at the edge of a barrel lens: its box lies where `project` says, well away from the pinhole's."""
    _require_gl()
    x_m, y_m, yaw_rad = river.start
    way = yaw_rad + 0.5
    spot = np.array([x_m + 6.0 * np.cos(way), y_m + 6.0 * np.sin(way)])
    can = Obstacle("known", Kind.BUOY, "can", Pose2(float(spot[0]), float(spot[1]), 0.0), 0.8, 0.8, 1.2)
    middles = {}
    for camera in (Camera(), Camera(k1=-0.12)):
        with Eye(river, camera) as looking:
            looking.place_obstacles([can])
            box = next(b for b in view(looking, at_start(river)).boxes if b.id == "known")
            middles[camera.k1] = 0.5 * (box.x0_px + box.x1_px)
            middle = project(np.array([[*spot, 0.6]]), at_start(river), camera)[0]
            assert middles[camera.k1] == pytest.approx(middle[0], abs=3.0)
    assert middles[-0.12] > middles[0.0] + 3.0


def test_a_moving_boat_leaves_a_wake(river: World) -> None:
    """Behind it the water differs from that of the same boat at rest; elsewhere it does not."""
    _require_gl()
    boat = river.actors[0]
    moving = dataclasses.replace(river, actors=(dataclasses.replace(boat, speed_mps=2.0),))
    at_rest = dataclasses.replace(river, actors=(dataclasses.replace(boat, speed_mps=0.0),))
    here = actor_pose_along(boat, 200.0)
    pose = BoatPose(here.x_m - 9.0 * np.cos(here.yaw_rad), here.y_m - 9.0 * np.sin(here.yaw_rad), here.yaw_rad)
    pictures = []
    for world in (moving, at_rest):
        with Eye(world) as looking:
            pictures.append(looking.render_labelled(pose, 5.0, (200.0,)))
    water = (pictures[0].mask == 1) & (pictures[1].mask == 1)
    change = np.abs(pictures[0].bgr.astype(int) - pictures[1].bgr).max(axis=2)
    assert np.array_equal(pictures[0].mask, pictures[1].mask)
    middle = np.zeros_like(water)
    middle[150:, 100:220] = True
    assert change[water & middle].mean() > 3.0
    assert change[:90].max() <= 2


def test_rain_and_fog_hide_what_is_far(river: World) -> None:
    _require_gl()
    with Eye(river) as looking:
        pose = at_start(river)
        clear = looking.render(pose, 5.0).bgr[80:105].astype(float)
        contrast = {}
        for name, light in {
            "fog": dataclasses.replace(river.light, visibility_m=40.0),
            "rain": dataclasses.replace(river.light, rain_mmph=40.0),
        }.items():
            looking.set_weather(light, river.wind)
            contrast[name] = float(looking.render(pose, 5.0).bgr[80:105].astype(float).std())
        assert contrast["fog"] < 0.6 * clear.std()
        assert contrast["rain"] < clear.std()


def test_weather_changes_the_picture(river: World) -> None:
    _require_gl()
    with Eye(river) as looking:
        pose = at_start(river)
        calm = looking.render(pose, 5.0).bgr
        looking.set_weather(Light(sky="overcast", visibility_m=150.0), Wind(8.0, 1.0))
        assert np.abs(calm.astype(int) - looking.render(pose, 5.0).bgr).mean() > 10.0


def test_missing_gl_is_one_line_with_the_packages() -> None:
    code = (
        "from paani.errors import UserError\n"
        "from paani_sim.eye.gl import Context\n"
        "try:\n    Context()\nexcept UserError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYOPENGL_PLATFORM": "glx"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.count("\n") == 1
    assert "libegl1 libopengl0 libgl1-mesa-dri" in done.stdout


@pytest.mark.rotating(cpu_s=6)
def test_dataset_has_the_form_of_the_sources(tmp_path: Path) -> None:
    _require_gl()
    out = tmp_path / "pictures"
    manifest = write_dataset(out, 5, seed=3, worlds=("river",))
    assert not (tmp_path / "pictures.part").exists()
    stored = msgspec.json.decode((out / "manifest.json").read_bytes(), type=Manifest)
    assert stored == manifest
    assert stored.images == len(stored.items) == 5
    boxes = 0
    for item in stored.items:
        picture = np.asarray(cv2.imread(str(out / item.file)))
        mask = np.asarray(cv2.imread(str(out / item.mask), cv2.IMREAD_UNCHANGED))
        assert picture.shape == (240, 320, 3)
        assert mask.shape == (240, 320)
        assert set(np.unique(mask)) <= {0, 1, 2}
        for line in (out / item.label).read_text().splitlines():
            number, *centre_size = line.split()
            cx, cy, w, h = map(float, centre_size)
            assert number in {"0", "1", "2", "3"}
            assert w * 320 >= 3.0 - 1e-3
            assert h * 240 >= 3.0 - 1e-3
            assert cx - w / 2 > -1e-5
            assert cx + w / 2 < 1 + 1e-5
            assert cy - h / 2 > -1e-5
            assert cy + h / 2 < 1 + 1e-5
            boxes += 1
    assert boxes == sum(stored.boxes.values()) > 0
    with pytest.raises(UserError, match="already exists"):
        write_dataset(out, 1)
    again = tmp_path / "again"
    write_dataset(again, 5, seed=3, worlds=("river",))
    assert [(again / i.file).read_bytes() for i in stored.items] == [(out / i.file).read_bytes() for i in stored.items]


@pytest.mark.rotating(cpu_s=20)
@pytest.mark.parametrize("world", ["river", "canal"])
def test_every_third_session_of_a_dataset_shows_nobody_but_crews(world: str) -> None:
    """Banks, boats and buoys as in the others, so that a detector learns what stands on a bank and is no person."""
    _require_gl()
    sessions = [
        Session(number=number, pictures=4, seed=11, world=world, width_px=320, height_px=240)
        for number in range(DESERTED_EVERY)
    ]
    *peopled, deserted = [draw_session(session).boxes for session in sessions]
    assert 5 * deserted.get("person", 0) < min(boxes.get("person", 0) for boxes in peopled)
    assert sum(deserted.values()) > 5
