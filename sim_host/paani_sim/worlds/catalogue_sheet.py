"""Sheet of what a waterway can hold: every kind of actor, every feature of the layout, every condition of light."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from paani.arrays import U8
from paani_sim.eye.camera import BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.worlds.lighting import LIGHT_CONDITIONS, draw_light
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.scenario_sheet import add_caption
from paani_sim.worlds.scenario_things import world_route_frame
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.traffic import ACTOR_KINDS
from paani_sim.worlds.waterway import FEATURES, build_waterway
from paani_sim.worlds.world import Obstacle, Pose2, World

COLUMNS = 6
FEATURE_AHEAD_M = 17.0
ASLANT_RAD = 2.2  # heading of what is shown, to the left of the view
SCENE = (("kayak", 13.0, 2.5), ("swimming", 7.0, -1.2), ("can", 10.0, -3.5), ("cruiser", 24.0, -5.0))


class _View(NamedTuple):
    caption: str
    pose: BoatPose
    things: tuple[Obstacle, ...]
    condition: str = "fair"


def count_views() -> int:
    """How many pictures the sheet has."""
    return len(ACTOR_KINDS) + len(FEATURES) + len(LIGHT_CONDITIONS)


def render_catalogue(width_px: int, height_px: int, seed: int) -> Iterator[U8 | None]:
    """Yields None as each picture of this size is drawn, then the sheet. Raises UserError without OpenGL."""
    world = build_waterway(seed, "fair")
    frame = world_route_frame(world)
    pictures = []
    with Eye(world, Camera(width_px=width_px, height_px=height_px)) as eye:
        for number, view in enumerate(_list_views(world, frame)):
            eye.set_weather(draw_light(view.condition, view.pose.yaw_rad, np.random.default_rng(seed)), world.wind)
            eye.place_obstacles(view.things)
            pictures.append(add_caption(eye.render(view.pose, 20.0 + number).bgr, view.caption))
            yield None
    blank = np.full_like(pictures[0], 250)
    pictures += [blank] * (-len(pictures) % COLUMNS)
    yield np.vstack([np.hstack(pictures[first : first + COLUMNS]) for first in range(0, len(pictures), COLUMNS)])


def _list_views(world: World, frame: RouteFrame) -> Iterator[_View]:
    open_m = _along_beside(world, frame, "jetty") - 28.0
    pose = BoatPose(*frame.pose_at(open_m))
    for number, (name, kind) in enumerate(ACTOR_KINDS.items()):
        look = kind.looks[number % len(kind.looks)]
        range_m = min(2.6 + 1.1 * SIZES[look].length_m, 14.0)
        things = [
            _thing(pose, look, range_m + kind.apart_m * member, 0.8 * (-1.0) ** member * (member > 0), number + member)
            for member in range(kind.group[1])
        ]
        yield _View(f"{name}: {', '.join(kind.looks)}", pose, tuple(things))
    for feature, thing in zip(FEATURES, ("island", "bridge", "row_1", "weir", "jetty"), strict=True):
        along_m = _along_beside(world, frame, thing) - FEATURE_AHEAD_M
        here, there = frame.pose_at(along_m), next(o.pose for o in world.obstacles if o.id == thing)
        bearing_rad = float(np.arctan2(there.y_m - here.y_m, there.x_m - here.x_m))
        yield _View(feature, BoatPose(here.x_m, here.y_m, bearing_rad), ())
    scene = tuple(_thing(pose, look, ahead_m, left_m, 2) for look, ahead_m, left_m in SCENE)
    for condition in LIGHT_CONDITIONS:
        yield _View(condition, pose, scene, condition)


def _along_beside(world: World, frame: RouteFrame, thing: str) -> float:
    """Where along the route the thing of this id is nearest."""
    there = np.array(next(o.pose[:2] for o in world.obstacles if o.id == thing))
    along_m = np.arange(0.0, world.route_length_m, 1.0)
    points_m = np.array([frame.pose_at(float(at_m))[:2] for at_m in along_m])
    return float(along_m[int(np.argmin(np.hypot(*(points_m - there).T)))])


def _thing(pose: BoatPose, look: str, ahead_m: float, left_m: float, variant: int) -> Obstacle:
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    x_m, y_m = pose.x_m + ahead_m * cos - left_m * sin, pose.y_m + ahead_m * sin + left_m * cos
    size = SIZES[look]
    there = Pose2(float(x_m), float(y_m), pose.yaw_rad + ASLANT_RAD)
    return Obstacle(f"shown_{look}_{ahead_m:.1f}", size.kind, look, there, *size[1:], 0.0, variant)
