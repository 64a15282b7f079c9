"""The boat and what is around it as a three-dimensional scene: one entity for each thing that lives and dies by itself.

Each entity dies with its topic's freshness, so that a viewer shows nothing that has gone stale. Pure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from paani import keys
from paani import messages as m
from paani.config import CalibrationConfig, CorridorConfig
from paani.geometry import quaternion
from paani.logs import protobuf as pb
from paani.logs.viewer import MAP_FRAME
from paani_services.foxglove.overlay import BLOCKED, CLEAR
from paani_services.foxglove.transforms import BASE_FRAME

Entity = dict[str, object]
Rgb = tuple[float, float, float]
PLAN, ROUTE, LEG, HOME = (1.0, 0.71, 0.33), (0.35, 0.66, 0.95), (0.62, 0.53, 0.93), (0.95, 0.95, 0.95)
OBSTACLE, BOAT, UNTRUSTED = (0.95, 0.36, 0.36), (0.93, 0.95, 0.96), (0.55, 0.58, 0.60)
KEEP: dict[m.Keep, Rgb] = {m.Keep.IN: (0.34, 0.84, 0.61), m.Keep.OUT: (0.95, 0.36, 0.36)}
LINE_M, FENCE_M, ABOVE_WATER_M = 0.08, 0.12, 0.05
POINT_M, FONT_M = 0.4, 0.5  # size of a mark, and of letters
OBSTACLE_HEIGHT_M, TEXT_ABOVE_M, ADVICE_ABOVE_M = 1.0, 0.5, 1.8
ARROW_M, SHAFT_M, HEAD_M = 0.3, 0.12, 0.25
BOAT_M = 1.2
CORRIDOR_REACH_M = 8.0  # how far ahead a corridor is drawn: a few boat lengths
CORRIDOR_ALPHA = 0.22


def boat(odometry: m.Odometry) -> Entity:
    """An arrow ahead, grey where the estimate may not be trusted."""
    colour = _colour(BOAT if odometry.healthy else UNTRUSTED)
    texts = [] if odometry.healthy else [_text("position not trusted", (0.0, 0.0, ADVICE_ABOVE_M), UNTRUSTED)]
    arrow = {
        "pose": _pose((-BOAT_M / 2, 0.0, 0.2)), "shaft_length": BOAT_M * 0.6, "shaft_diameter": 0.35,
        "head_length": BOAT_M * 0.4, "head_diameter": 0.6, "color": colour,
    }  # fmt: skip
    return _entity("boat", keys.ODOMETRY, odometry, frame=BASE_FRAME, arrows=[arrow], texts=texts)


def advice(advisory: m.Advisory, corridors: CorridorConfig, calibration: CalibrationConfig) -> Entity:
    """The advised direction above the boat, and the corridors on the water where the camera is calibrated.

    A corridor is the sector between the bearings of its edges; the camera's roll is left out.
    """
    stands = advisory.direction in {m.Direction.STOP, m.Direction.NO_DATA}
    words = _text(advisory.direction.value, (0.0, 0.0, ADVICE_ABOVE_M + FONT_M), BLOCKED if stands else CLEAR)
    lanes = ((corridors.left, advisory.left), (corridors.center, advisory.center), (corridors.right, advisory.right))
    sectors = [
        _sector(bearings_rad(span, calibration), calibration.forward_m, BLOCKED if lane.blocked else CLEAR)
        for span, lane in lanes
        if calibration.valid
    ]
    return _entity("advice", keys.ADVISORY, advisory, frame=BASE_FRAME, triangles=sectors, texts=[words])


def bearings_rad(span_frac: tuple[float, float], calibration: CalibrationConfig) -> tuple[float, float]:
    """Bearings off the bow, to port positive, of two columns of the picture, given as fractions of its width."""
    tangent = 2.0 * math.tan(0.5 * math.radians(calibration.hfov_deg))
    start, end = (math.atan((calibration.centre_frac[0] - x) * tangent) for x in span_frac)
    mount_rad = math.radians(calibration.yaw_deg)
    return start + mount_rad, end + mount_rad


def prediction(ahead: m.Prediction) -> list[Entity]:
    """The way ahead, moving obstacles with their velocity, and home. Each replaces what was drawn of it before."""
    marks, arrows, names = [], [], []
    for each in ahead.obstacles:
        speed_mps, at_m = math.hypot(each.east_mps, each.north_mps), (each.x_m, each.y_m, OBSTACLE_HEIGHT_M / 2)
        marks.append(_cylinder(at_m, 2.0 * each.radius_m, OBSTACLE_HEIGHT_M, OBSTACLE))
        above_m = (each.x_m, each.y_m, OBSTACLE_HEIGHT_M + TEXT_ABOVE_M)
        names.append(_text(f"#{each.track_id} {speed_mps:.1f} m/s", above_m, OBSTACLE))
        if speed_mps > 0.0:
            arrows.append(
                {
                    "pose": _pose((each.x_m, each.y_m, OBSTACLE_HEIGHT_M), math.atan2(each.north_mps, each.east_mps)),
                    "shaft_length": speed_mps, "shaft_diameter": SHAFT_M, "head_length": ARROW_M,
                    "head_diameter": HEAD_M, "color": _colour(OBSTACLE),
                }
            )  # fmt: skip
    path = [_line(ahead.path, PLAN, LINE_M)] if len(ahead.path) > 1 else []
    home = [_cylinder((p.x_m, p.y_m, ABOVE_WATER_M), POINT_M, 2 * ABOVE_WATER_M, HOME) for p in ahead.home]
    home_text = [_text("home", (p.x_m, p.y_m, TEXT_ABOVE_M), HOME) for p in ahead.home]
    return [
        _entity("plan", keys.PREDICTION, ahead, lines=path),
        _entity("obstacles", keys.PREDICTION, ahead, cylinders=marks, arrows=arrows, texts=names),
        _entity("home", keys.PREDICTION, ahead, cylinders=home, texts=home_text),
    ]


def route(followed: m.Route) -> Entity:
    """The route with its waypoints, closed where it repeats."""
    lines = [_line(followed.waypoints, ROUTE, LINE_M, closed=followed.repeat)] if len(followed.waypoints) > 1 else []
    marks = [_cylinder((p.x_m, p.y_m, ABOVE_WATER_M), POINT_M, ABOVE_WATER_M, ROUTE) for p in followed.waypoints]
    return _entity("route", keys.ROUTE, followed, lines=lines, cylinders=marks)


def mission(planned: m.Mission) -> list[Entity]:
    """Fence and land, the stations of the mission with their radius, and rally points."""
    fence = [_line(area.corners, KEEP[area.keep], FENCE_M, closed=True) for area in planned.bounds]
    stations = [
        _cylinder((leg.waypoints[0].x_m, leg.waypoints[0].y_m, ABOVE_WATER_M), 2.0 * leg.radius_m, ABOVE_WATER_M, LEG)
        for leg in planned.legs
        if leg.kind is m.LegKind.HOLD_STATION and leg.waypoints and leg.radius_m > 0.0
    ]
    rally = [_cylinder((p.x_m, p.y_m, ABOVE_WATER_M), POINT_M, 2 * ABOVE_WATER_M, HOME) for p in planned.rally]
    rally_text = [_text("rally", (p.x_m, p.y_m, TEXT_ABOVE_M), HOME) for p in planned.rally]
    return [
        _entity("rally", keys.MISSION, planned, cylinders=rally, texts=rally_text),
        _entity("fence", keys.MISSION, planned, lines=fence),
        _entity("stations", keys.MISSION, planned, cylinders=stations),
    ]


def scene_update(entities: Iterable[Entity]) -> bytes:
    """A foxglove.SceneUpdate; an entity replaces the one of the same id."""
    return pb.encode(pb.SCENE_UPDATE, {"entities": list(entities)})


def _entity(
    name: str, topic: keys.Topic[Any], message: m.Message, *, frame: str = MAP_FRAME, **primitives: object
) -> Entity:
    """Dated by when its message left, since that is what freshness counts from; it moves with its frame."""
    return {
        "timestamp": pb.timestamp(message.sent_us or message.source_us), "frame_id": frame, "id": name,
        "lifetime": pb.duration(topic.fresh_s), "frame_locked": True, **primitives,
    }  # fmt: skip


def _line(points: Sequence[m.Waypoint], rgb: Rgb, thickness_m: float, *, closed: bool = False) -> Entity:
    return {
        "type": pb.SCENE_LINE_LOOP if closed else pb.SCENE_LINE_STRIP, "pose": _pose((0.0, 0.0, 0.0)),
        "thickness": thickness_m, "color": _colour(rgb),
        "points": [{"x": p.x_m, "y": p.y_m, "z": ABOVE_WATER_M} for p in points],
    }  # fmt: skip


def _cylinder(at_m: tuple[float, float, float], across_m: float, height_m: float, rgb: Rgb) -> Entity:
    return {
        "pose": _pose(at_m), "size": {"x": across_m, "y": across_m, "z": height_m}, "bottom_scale": 1.0,
        "top_scale": 1.0, "color": _colour(rgb, 0.6),
    }  # fmt: skip


def _sector(between_rad: tuple[float, float], from_m: float, rgb: Rgb) -> Entity:
    corners = [(from_m, 0.0)]
    corners += [(from_m + CORRIDOR_REACH_M * math.cos(b), CORRIDOR_REACH_M * math.sin(b)) for b in between_rad]
    return {
        "pose": _pose((0.0, 0.0, ABOVE_WATER_M)), "color": _colour(rgb, CORRIDOR_ALPHA),
        "points": [{"x": x, "y": y} for x, y in corners],
    }  # fmt: skip


def _text(words: str, at_m: tuple[float, float, float], rgb: Rgb) -> Entity:
    return {
        "pose": _pose(at_m), "billboard": True, "font_size": FONT_M, "text": words, "color": _colour(rgb),
    }  # fmt: skip


def _pose(at_m: tuple[float, float, float], yaw_rad: float = 0.0) -> Entity:
    x, y, z = at_m
    return {"position": {"x": x, "y": y, "z": z}, "orientation": quaternion(0.0, 0.0, yaw_rad)}


def _colour(rgb: Rgb, alpha: float = 1.0) -> bytes:
    return pb.colour(*rgb, alpha)
