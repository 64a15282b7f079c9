"""Sheet of a scenario: description, plan, and the views of the boat's camera along the route."""

from collections.abc import Iterator

import cv2
import numpy as np

from paani.arrays import U8
from paani_sim.eye.camera import BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.passability import obstacle_distance_m
from paani_sim.worlds.plan_view import FONT, INK, draw_plan_view
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.scenario import Scenario
from paani_sim.worlds.scenario_things import world_route_frame
from paani_sim.worlds.world import Pose2

COLUMNS = 4
VIEWS = 8
CLEAR_M = 1.5
TITLE_PX, CAPTION_PX = 56, 22


def render_sheet(scenario: Scenario, width_px: int, height_px: int) -> Iterator[U8 | None]:
    """Yields None as each of the `VIEWS` views of this size is drawn, then the sheet. Raises UserError without OpenGL.

    A view is what a boat sees that moves along the route at 0.6 m/s and gets there in time.
    """
    length_m, way = scenario.world.route_length_m, world_route_frame(scenario.world)
    span_m = length_m if scenario.world.route_closed else 0.94 * length_m
    along_m = np.linspace(0.0, span_m, VIEWS, endpoint=not scenario.world.route_closed)
    along_m = np.array([_advance_to_clear(scenario, way, float(distance_m)) for distance_m in along_m])
    poses = [way.pose_at(float(distance_m)) for distance_m in along_m]
    pictures = []
    with Eye(scenario.world, Camera(width_px=width_px, height_px=height_px)) as eye:
        for number, (distance_m, pose) in enumerate(zip(along_m, poses, strict=True), start=1):
            t_s = float(distance_m) / NOMINAL_BOAT_MPS
            picture = eye.render(BoatPose(*pose), t_s).bgr
            pictures.append(add_caption(picture, f"{number}   {distance_m:.0f} m   {t_s:.0f} s"))
            yield None
    yield _compose_sheet(scenario, poses, pictures)


def _advance_to_clear(scenario: Scenario, way: RouteFrame, along_m: float) -> float:
    """There, or as much further on as it takes for the camera not to be in something that stands in the way."""
    for further_m in np.arange(0.0, 12.0, 1.0):
        here = np.array([way.pose_at(along_m + float(further_m))[:2]])
        if obstacle_distance_m(scenario.world.obstacles, here)[0] > CLEAR_M:
            return along_m + float(further_m)
    return along_m


def _compose_sheet(scenario: Scenario, poses: list[Pose2], pictures: list[U8]) -> U8:
    rows = [np.hstack(pictures[first : first + COLUMNS]) for first in range(0, len(pictures), COLUMNS)]
    width_px = rows[0].shape[1]
    plan = draw_plan_view(scenario, width_px, _plan_height_px(scenario, width_px), poses)
    return np.vstack([_render_title(scenario, width_px), plan, *rows])


def _plan_height_px(scenario: Scenario, width_px: int) -> int:
    """As high as the water is for its width, from a quarter to 0.45 of it."""
    world = scenario.world
    x_m, y_m = np.ptp(world.shore_m if world.route_closed else world.route_m, axis=0) + 32.0
    return round(width_px * min(0.45, max(0.25, float(y_m / x_m))))


def _render_title(scenario: Scenario, width_px: int) -> U8:
    world = scenario.world
    wind, light = world.wind, world.light
    first = (
        f"{scenario.name}   {world.name}, {world.route_length_m:.0f} m, {len(world.obstacles)} things, "
        f"{len(world.actors)} moving"
    )
    sun_deg, toward_deg = np.degrees(light.sun_elevation_rad), np.degrees(wind.toward_rad) % 360.0
    parts = [
        f"{light.sky}, sun {sun_deg:.0f} deg, visibility {light.visibility_m:.0f} m, rain {light.rain_mmph:.1f} mm/h",
        f"wind {wind.speed_mps:.1f} m/s towards {toward_deg:.0f} deg, current {world.current.speed_mps:.2f} m/s",
        *(f"{fault.kind} at {fault.start_s:.0f} s" for fault in scenario.faults),
    ]
    band = np.full((TITLE_PX, width_px, 3), 250, np.uint8)
    cv2.putText(band, first, (12, 24), FONT, 0.7, INK, 1, cv2.LINE_AA)
    cv2.putText(band, ", ".join(parts), (12, 46), FONT, 0.5, INK, 1, cv2.LINE_AA)
    return band


def add_caption(picture: U8, caption: str) -> U8:
    """The picture with a line of text below it."""
    band = np.full((CAPTION_PX, picture.shape[1], 3), 250, np.uint8)
    cv2.putText(band, caption, (8, 16), FONT, 0.5, INK, 1, cv2.LINE_AA)
    return np.vstack([picture, band])
