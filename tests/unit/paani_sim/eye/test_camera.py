"""The camera's geometry and the pure parts of the eye."""

import numpy as np
import pytest

from paani_sim.eye import BoatPose, Camera, project
from paani_sim.eye.camera import camera_pose
from paani_sim.eye.labels import read_labels, select_visible_boxes
from paani_sim.eye.mesh import box, ellipsoid, rotation
from paani_sim.eye.scatter import random_pose, scatter
from paani_sim.eye.scene import FIRST_THING, Thing, make_scene, place_obstacles
from paani_sim.eye.sky import SKIES, paint_sky
from paani_sim.eye.sprites import paint_sprites
from paani_sim.eye.wave_textures import SLOPE_RANGE, mean_square_slope, slope_tile
from paani_sim.worlds import Kind, Light, load_world

pytestmark = pytest.mark.slow

CAMERA = Camera()


def test_camera_is_0_9_m_above_the_water_at_rest() -> None:
    position, _ = camera_pose(BoatPose(0.0, 0.0, 0.0), CAMERA)
    assert position == pytest.approx([0.55, 0.0, 0.9])


def test_point_straight_ahead_at_camera_height_lies_above_the_middle() -> None:
    """Six degrees of mounting pitch put the horizon f tan(6 deg) above the middle row."""
    u, v = project(np.array([[1000.55, 0.0, 0.9]]), BoatPose(0.0, 0.0, 0.0), CAMERA)[0]
    assert u == pytest.approx(160.0)
    assert v == pytest.approx(120.0 - CAMERA.focal_px * np.tan(np.radians(6.0)), abs=1e-6)


def test_left_is_left_and_roll_to_starboard_lowers_it() -> None:
    ahead_left = np.array([[20.0, 4.0, 0.9]])
    level = project(ahead_left, BoatPose(0.0, 0.0, 0.0), CAMERA)[0]
    rolled = project(ahead_left, BoatPose(0.0, 0.0, 0.0, roll_rad=0.1), CAMERA)[0]
    assert level[0] < 160.0
    assert rolled[1] > level[1]


def test_bow_down_lifts_the_horizon() -> None:
    far = np.array([[500.0, 0.0, 0.9]])
    level = project(far, BoatPose(0.0, 0.0, 0.0), CAMERA)[0]
    diving = project(far, BoatPose(0.0, 0.0, 0.0, pitch_rad=0.1), CAMERA)[0]
    assert diving[1] < level[1]


def test_points_behind_do_not_project() -> None:
    assert np.isnan(project(np.array([[-5.0, 0.0, 0.0]]), BoatPose(0.0, 0.0, 0.0), CAMERA)).all()


def test_own_hull_is_out_of_view() -> None:
    """The bow, 0.65 m ahead of the boat's origin, lies below the picture."""
    bow = np.array([[0.65, 0.285, 0.15], [0.65, -0.285, 0.15]])
    assert (project(bow, BoatPose(0.0, 0.0, 0.0), CAMERA)[:, 1] > CAMERA.height_px).all()


def test_rotation_is_yaw_pitch_roll() -> None:
    assert rotation(0.0, 0.0, 0.5 * np.pi) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assert (rotation(0.0, 0.2, 0.0) @ [1.0, 0.0, 0.0])[2] < 0.0
    assert (rotation(0.2, 0.0, 0.0) @ [0.0, 1.0, 0.0])[2] > 0.0


def test_solid_shapes_have_their_size() -> None:
    points = box((2.0, 4.0, 6.0), (0.5, 0.5, 0.5)).vertices[:, :3]
    assert np.ptp(points, axis=0) == pytest.approx([2.0, 4.0, 6.0])
    ball = ellipsoid((1.0, 2.0, 3.0), (0.5, 0.5, 0.5), 16).vertices[:, :3]
    assert np.abs(ball).max(axis=0) == pytest.approx([1.0, 2.0, 3.0], rel=0.03)


@pytest.mark.parametrize("name", ["lake", "river", "canal", "harbour"])
def test_every_obstacle_has_a_body_of_its_stated_size(name: str) -> None:
    world = load_world(name)
    for obstacle in world.obstacles:
        stands = place_obstacles([obstacle], FIRST_THING)
        assert stands.things[0].id == obstacle.id
        afloat = [own.rows.rows for own in stands.afloat]
        rows = afloat[0] if afloat else stands.still.rows - [*obstacle.pose[:2], *[0.0] * 9]
        own = rows[rows[:, 10] == FIRST_THING, :2]
        reach_m = np.linalg.norm(own, axis=1).max()
        slack_m = {"bridge": 22.0, "crane": 10.0, "sitting": 0.5, "warehouse": 0.7}.get(
            obstacle.look, 0.3
        )  # ramps, a jib, legs, eaves
        assert 0.35 * obstacle.length_m < reach_m < obstacle.radius_m + slack_m, obstacle.id


def test_crew_are_things_of_their_own() -> None:
    world = load_world("lake")
    kayak = next(a for a in world.actors if a.look == "kayak")
    names = {t.id: t for t in make_scene(world).things}
    assert names[f"{kayak.id}_crew_1"].kind is Kind.PERSON
    assert names[f"{kayak.id}_crew_1"].part_of == kayak.id


def test_labels_of_a_hand_made_picture() -> None:
    """Sky over water, a person in a boat: the boat's box holds both, the person's its own."""
    things = (
        Thing(3, "boat", Kind.VESSEL, ""),
        Thing(4, "boat_crew_1", Kind.PERSON, "boat"),
        Thing(300, "dot", Kind.BUOY, ""),
        Thing(301, "bridge", Kind.OTHER, ""),
    )
    number = np.zeros((40, 60), np.int32)
    number[20:] = 1
    number[15:25, 10:30] = 3
    number[10:15, 18:22] = 4
    number[30:32, 50:52] = 300
    number[0:4, :] = 301
    picture = np.stack([number % 256, number // 256, number * 0, number * 0], -1).astype(np.uint8)
    labelled = read_labels(np.zeros((40, 60, 3), np.uint8), picture, np.ones((40, 60), np.float32), things)
    boxes = {b.id: b[2:6] for b in labelled.boxes}
    assert boxes == {"boat": (10, 10, 30, 25), "boat_crew_1": (18, 10, 22, 15)}
    assert labelled.mask[8, 5] == 2
    assert labelled.mask[39, 5] == 1
    assert labelled.mask[2, 5] == labelled.mask[20, 20] == labelled.mask[31, 51] == 0


@pytest.mark.parametrize("sky", SKIES)
def test_sky_is_brighter_than_a_dark_picture_and_repeats(sky: str) -> None:
    light = Light(sky=sky, seed=5)
    first, again = paint_sky(light), paint_sky(light)
    assert np.array_equal(first.panorama, again.panorama)
    assert first.panorama.mean() > 90.0
    assert np.linalg.norm(first.sun_direction) == pytest.approx(1.0, abs=1e-6)
    other = paint_sky(Light(sky=sky, seed=6))
    assert not np.array_equal(first.panorama, other.panorama)


def test_slopes_have_unit_variance_and_tile() -> None:
    tile = slope_tile(3).astype(float) / 255.0
    slope = (tile[..., :2] - 0.5) * 2.0 * SLOPE_RANGE
    assert (slope**2).sum(axis=-1).mean() == pytest.approx(1.0, rel=0.05)
    seam = np.abs(slope[:, 0] - slope[:, -1]).mean()
    assert seam < 2.0 * np.abs(np.diff(slope, axis=1)).mean()


def test_cox_munk_slope_grows_with_wind() -> None:
    assert mean_square_slope(0.0) == pytest.approx(0.003)
    assert mean_square_slope(5.0) == pytest.approx(0.0286)


@pytest.mark.rotating(cpu_s=4)
def test_sprites_are_seeded() -> None:
    first = paint_sprites(1)
    assert np.array_equal(first, paint_sprites(1))
    assert not np.array_equal(first, paint_sprites(2))
    cover = (first[..., 3] > 128).mean(axis=(1, 2))
    assert (cover > 0.08).all()


def test_scatter_is_seeded_and_keeps_the_boat_free() -> None:
    world = load_world("river")
    for seed in range(12):
        rng = np.random.default_rng(seed)
        pose = random_pose(world, rng)
        found = scatter(world, pose, rng)
        again_rng = np.random.default_rng(seed)
        assert scatter(world, random_pose(world, again_rng), again_rng) == found
        for thing in found:
            gap_m = np.hypot(thing.pose.x_m - pose.x_m, thing.pose.y_m - pose.y_m)
            assert gap_m > 1.4, thing


@pytest.mark.parametrize(("shade", "seen"), [(120, False), (124, False), (150, True), (60, True)])
def test_what_does_not_stand_out_is_not_labelled(shade: int, seen: bool) -> None:
    """A boat in the fog's own grey keeps its box in the truth and loses its label."""
    number = np.zeros((40, 60), np.uint8)
    number[15:25, 10:30] = FIRST_THING
    picture = np.stack([number, number * 0, number * 0, number * 0], -1)
    bgr = np.full((40, 60, 3), 120, np.uint8)
    bgr[15:25, 10:30] = shade
    view = read_labels(bgr, picture, np.ones((40, 60), np.float32), [Thing(FIRST_THING, "boat", Kind.VESSEL, "")])
    assert len(view.boxes) == 1
    assert (len(select_visible_boxes(view)) == 1) is seen


def test_specks_of_a_hidden_person_are_not_labelled() -> None:
    number = np.zeros((60, 60), np.uint8)
    number[5:55:5, 5:55:5] = FIRST_THING
    picture = np.stack([number, number * 0, number * 0, number * 0], -1)
    bgr = np.where(number[..., None] == FIRST_THING, 250, 60).astype(np.uint8).repeat(3, axis=2)
    view = read_labels(bgr, picture, np.ones((60, 60), np.float32), [Thing(FIRST_THING, "p", Kind.PERSON, "")])
    assert view.boxes[0].contrast > 100.0
    assert select_visible_boxes(view) == ()
