"""A scenario seen from above: shore, route, what stands and what moves, with a legend and a scale."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import F64, U8
from paani.statistics.charts import Axes
from paani_sim.worlds.curves import circle
from paani_sim.worlds.footprint import build_outline, is_shaped, place_outline
from paani_sim.worlds.scenario import Scenario
from paani_sim.worlds.world import Actor, Bank, Kind, Obstacle, Pose2, actor_pose_at

Bgr = tuple[int, int, int]

WATER: Bgr = (222, 196, 160)
SHOAL: Bgr = (196, 214, 206)
LAND: dict[Bank, Bgr] = {Bank.GRASS: (150, 196, 160), Bank.QUAY: (188, 192, 196)}
INK: Bgr = (40, 40, 40)
ROUTE: Bgr = (40, 40, 220)
PATH: Bgr = (190, 60, 160)
FENCE: Bgr = (0, 110, 255)
KINDS: dict[Kind, Bgr] = {
    Kind.VESSEL: (120, 60, 30),
    Kind.PERSON: (30, 30, 200),
    Kind.PIER: (60, 100, 130),
    Kind.BUOY: (0, 150, 255),
    Kind.OTHER: (110, 110, 110),
}
SUB_BITS = 4  # of a pixel, in drawing
MARGIN_M = 8.0
MIN_DOT_PX = 3.0
SCALES_M = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw_plan_view(scenario: Scenario, width_px: int, height_px: int, views: Sequence[Pose2] = ()) -> U8:
    """The part of the world around the route (all of the water, where the route is closed), `(height, width, 3)`.

    `views` are drawn as numbered camera positions.
    """
    world = scenario.world
    canvas = _MapCanvas(world.shore_m if world.route_closed else _route_surroundings(scenario), width_px, height_px)
    canvas.picture[:] = LAND[world.bank]
    canvas.fill_polygon(world.shore_m, WATER)
    canvas.draw_line(world.shore_m, INK, closed=True)
    for shoal in world.shoals:
        canvas.fill_polygon(circle((shoal.x_m, shoal.y_m), shoal.radius_m, 32), SHOAL)
    for area in scenario.fence:
        canvas.draw_line(np.array([(p.x_m, p.y_m) for p in area.corners]), FENCE, closed=True, width_px=2)
    for obstacle in world.obstacles:
        canvas.fill_polygon(_outline(obstacle, obstacle.pose), KINDS[obstacle.kind])
    for actor in world.actors:
        canvas.draw_line(actor.path_m, PATH, closed=actor.closed)
        canvas.fill_polygon(_outline(actor, actor_pose_at(actor, 0.0)), PATH)
    canvas.draw_line(world.route_m, ROUTE, closed=world.route_closed, width_px=2)
    canvas.draw_dot(world.start[:2], ROUTE, 6)
    for number, view in enumerate(views, start=1):
        canvas.draw_view(view, str(number))
    canvas.draw_scale()
    canvas.draw_legend(has_shoals=bool(world.shoals))
    return canvas.picture


def _route_surroundings(scenario: Scenario) -> F64:
    route_m = scenario.world.route_m
    return np.vstack([route_m - 2.0 * MARGIN_M, route_m + 2.0 * MARGIN_M])


def _outline(thing: Obstacle | Actor, pose: Pose2) -> F64:
    """The footprint's corners, of what is long with a bow."""
    if thing.kind is Kind.OTHER and is_shaped(thing):
        return place_outline(build_outline(thing), pose)
    half = np.array([0.5 * thing.length_m, 0.5 * thing.width_m])
    corners = np.array([[-1.0, -1.0], [0.55, -1.0], [1.0, 0.0], [0.55, 1.0], [-1.0, 1.0]])
    if thing.kind is not Kind.VESSEL:
        corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.asarray(corners * half @ np.array([[cos, sin], [-sin, cos]]) + np.array(pose[:2]))


class _MapCanvas:
    """A picture with map coordinates."""

    def __init__(self, around_m: F64, width_px: int, height_px: int) -> None:
        low, high = around_m.min(axis=0) - MARGIN_M, around_m.max(axis=0) + MARGIN_M
        self._px_per_m = float(min(width_px / (high - low)[0], height_px / (high - low)[1]))
        middle_x_m, middle_y_m = (0.5 * (low + high)).tolist()
        half_x_m, half_y_m = 0.5 * width_px / self._px_per_m, 0.5 * height_px / self._px_per_m
        self._axes = Axes(
            (middle_x_m - half_x_m, middle_x_m + half_x_m),
            (middle_y_m - half_y_m, middle_y_m + half_y_m),
            0.0, 0.0, width_px, height_px,
        )  # fmt: skip
        self.picture: U8 = np.zeros((height_px, width_px, 3), np.uint8)

    def _to_pixels(self, points_m: F64) -> npt.NDArray[np.int32]:
        """In fractions of a pixel, as OpenCV takes them."""
        px = np.array(self._axes.place_all(np.reshape(points_m, (-1, 2)).tolist())).reshape(np.shape(points_m))
        return np.asarray(np.round(np.clip(px, -3e4, 3e4) * (1 << SUB_BITS)), np.int32)

    def fill_polygon(self, polygon_m: F64, bgr: Bgr) -> None:
        """What would be smaller than a dot becomes one."""
        if np.ptp(polygon_m, axis=0).max() * self._px_per_m < 2.0 * MIN_DOT_PX:
            self.draw_dot(polygon_m.mean(axis=0), bgr, MIN_DOT_PX)
        else:
            cv2.fillPoly(self.picture, [self._to_pixels(polygon_m)], bgr, cv2.LINE_AA, SUB_BITS)

    def draw_line(self, line_m: F64, bgr: Bgr, *, closed: bool, width_px: int = 1) -> None:
        cv2.polylines(self.picture, [self._to_pixels(line_m)], closed, bgr, width_px, cv2.LINE_AA, SUB_BITS)

    def draw_dot(self, at_m: F64 | tuple[float, float], bgr: Bgr, radius_px: float) -> None:
        x, y = (int(v) for v in self._to_pixels(np.asarray(at_m)))
        cv2.circle(self.picture, (x, y), round(radius_px * (1 << SUB_BITS)), bgr, -1, cv2.LINE_AA, SUB_BITS)

    def draw_view(self, pose: Pose2, label: str) -> None:
        """A wedge where the camera looks, and its number."""
        reach_m = 26.0 / self._px_per_m
        rays = [pose.yaw_rad + turn for turn in (-0.6, 0.6)]
        ends = [(pose.x_m + reach_m * math.cos(ray), pose.y_m + reach_m * math.sin(ray)) for ray in rays]
        self.draw_line(np.array([ends[0], pose[:2], ends[1]]), INK, closed=False, width_px=2)
        x, y = (int(v) >> SUB_BITS for v in self._to_pixels(np.asarray(pose[:2])))
        _draw_text(self.picture, label, (x - 22, y + 6), 0.6, 2)

    def draw_scale(self) -> None:
        """A bar of a round length, about a sixth of the width, above north."""
        max_bar_px = self.picture.shape[1] / 6.0
        length_m = max((m for m in SCALES_M if m * self._px_per_m <= max_bar_px), default=SCALES_M[0])
        length_px, base = round(length_m * self._px_per_m), self.picture.shape[0] - 18
        cv2.line(self.picture, (18, base), (18 + length_px, base), INK, 3)
        _draw_text(self.picture, f"{length_m:.0f} m", (18, base - 8), 0.5, 1)
        cv2.arrowedLine(self.picture, (32, base - 34), (32, base - 74), INK, 2, cv2.LINE_AA, 0, 0.3)
        _draw_text(self.picture, "N", (40, base - 58), 0.5, 1)

    def draw_legend(self, *, has_shoals: bool) -> None:
        """What the colours mean, in the upper left corner."""
        rows = [*((str(kind), bgr) for kind, bgr in KINDS.items()), ("path", PATH), ("route", ROUTE)]
        rows += [("shoal", SHOAL)] if has_shoals else []
        cv2.rectangle(self.picture, (8, 8), (108, 16 + 18 * len(rows)), (245, 245, 245), -1)
        for number, (name, bgr) in enumerate(rows):
            y = 20 + 18 * number
            cv2.rectangle(self.picture, (14, y - 4), (30, y + 6), bgr, -1)
            _draw_text(self.picture, name, (38, y + 6), 0.45, 1)


def _draw_text(picture: U8, text: str, at_px: tuple[int, int], size: float, width_px: int) -> None:
    cv2.putText(picture, text, at_px, FONT, size, INK, width_px, cv2.LINE_AA)
