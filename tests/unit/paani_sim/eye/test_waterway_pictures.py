"""What moves on a waterway, in pictures: its labels, and light that changes the picture alone."""

import numpy as np
import pytest

from paani.errors import UserError
from paani_sim.eye import BoatPose, Camera, Eye, Labelled
from paani_sim.worlds import Kind, Obstacle, Pose2
from paani_sim.worlds.lighting import draw_light
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.waterway import build_waterway

pytestmark = [pytest.mark.gl, pytest.mark.timeout(120)]

ROW = (("eight", 15.0, 0.0), ("paddleboard", 6.0, 3.0), ("dog", 3.5, -0.8), ("duck", 3.5, 0.9), ("log", 6.0, -2.5))


@pytest.fixture(scope="module")
def eye() -> Eye:
    try:
        return Eye(build_waterway(4, "fair"), Camera(width_px=240, height_px=180))
    except UserError as error:
        pytest.skip(str(error))


def _view(eye: Eye) -> Labelled:
    pose = BoatPose(*eye.world.start)
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    things = []
    for look, ahead_m, left_m in ROW:
        size, turn_rad = SIZES[look], 0.5 * np.pi
        there = Pose2(
            pose.x_m + ahead_m * cos - left_m * sin, pose.y_m + ahead_m * sin + left_m * cos, pose.yaw_rad + turn_rad
        )
        things.append(Obstacle(look, size.kind, look, there, *size[1:], 0.0, 1))
    eye.place_obstacles(things)
    return eye.render_labelled(pose, 5.0)


def test_rowers_and_a_paddler_are_people_aboard_and_animals_are_obstacles_without_a_box(eye: Eye) -> None:
    view = _view(eye)
    boxes = {box.id: box for box in view.boxes}
    assert boxes["eight"].kind is boxes["paddleboard"].kind is Kind.VESSEL
    crew = [box for name, box in boxes.items() if name.startswith("eight_crew")]
    assert len(crew) >= 5
    assert all(box.kind is Kind.PERSON for box in crew)
    assert boxes["paddleboard_crew_1"].kind is Kind.PERSON
    assert boxes["eight"].x0_px <= min(box.x0_px for box in crew)
    assert not {"dog", "duck", "log"} & set(boxes)
    numbers = {thing.id for thing in eye.things}
    assert {"dog", "duck", "log"} <= numbers
    eye.place_obstacles(())
    without = eye.render_labelled(BoatPose(*eye.world.start), 5.0)
    near = np.s_[100:, 60:200]
    assert (view.mask[near] == 0).sum() > (without.mask[near] == 0).sum() + 150


def test_light_changes_the_picture_and_not_what_is_there(eye: Eye) -> None:
    views = []
    for name in ("fair", "fog", "low_sun", "rain", "dusk"):
        eye.set_weather(draw_light(name, eye.world.start.yaw_rad, np.random.default_rng(2)), eye.world.wind)
        views.append(_view(eye))
    for view in views[1:]:
        assert np.abs(view.bgr.astype(int) - views[0].bgr.astype(int)).mean() > 6.0
        assert np.array_equal(view.mask, views[0].mask)
        assert [box[:7] for box in view.boxes] == [box[:7] for box in views[0].boxes]
