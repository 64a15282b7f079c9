"""Chart of a drive from above, as SVG text. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from paani.arrays import F64
from paani.statistics.charts import Axes, circle, drawing, element, polygon, polyline
from paani_sim.trials.result import Closeness, TrialResult
from paani_sim.trials.silhouettes import MAX_FLOATING_BASE_M
from paani_sim.worlds import World, actor_distance_along_m, actor_pose_along
from paani_sim.worlds.footprint import build_outline, place_outline

WIDTH_PX = 520.0
MAX_HEIGHT_FRAC = 1.4  # of the width
MARGIN_M = 9.0  # around the track
SCALE_BAR_M = 10.0
DOT_PX = 5.0


def draw_track_chart(world: World, result: TrialResult) -> str:
    """Draw shore, route, things, actors at the worst moment, track, contacts and near misses."""
    track = np.array([(x, y) for _, x, y in result.track] or [world.start[:2]])
    low, high = track.min(axis=0) - MARGIN_M, track.max(axis=0) + MARGIN_M
    wide = max(high[0] - low[0], (high[1] - low[1]) / MAX_HEIGHT_FRAC)
    middle = 0.5 * (low + high)
    x_range_m = float(middle[0] - 0.5 * wide), float(middle[0] + 0.5 * wide)
    px_per_m = float(WIDTH_PX / wide)
    height_px = px_per_m * float(high[1] - low[1])
    axes = Axes(x_range_m, (float(low[1]), float(high[1])), 0.0, 0.0, WIDTH_PX, height_px)

    def line(kind: str, line_m: F64) -> str:
        return polyline(axes.place_all(line_m.tolist()), class_=kind)

    def area(kind: str, outline_m: F64) -> str:
        return polygon(axes.place_all(outline_m.tolist()), class_=kind)

    def dots(kind: str, places_m: Iterable[Sequence[float]]) -> list[str]:
        return [circle(point, DOT_PX, class_=kind) for point in axes.place_all(places_m)]

    parts = [
        element("rect", class_="land", width=round(WIDTH_PX), height=round(height_px)),
        area("water", world.shore_m),
        line("route", np.vstack([world.route_m, world.route_m[:1]]) if world.route_closed else world.route_m),
    ]
    parts += [
        area(each.kind.value, place_outline(build_outline(each), each.pose))
        for each in world.obstacles
        if each.base_z_m < MAX_FLOATING_BASE_M
    ]
    at_s = find_worst_moment_s(result)
    for actor in world.actors:
        parts.append(line("way", np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m))
        parts.append(
            area(
                actor.kind.value,
                place_outline(build_outline(actor), actor_pose_along(actor, actor_distance_along_m(actor, at_s))),
            )
        )
    parts.append(line("track", track))
    parts += dots("start", track[:1].tolist())
    parts += dots(
        "near",
        [(e.x_m, e.y_m) for e in result.encounters if e.closeness in {Closeness.GRAZING, Closeness.TIGHT}],
    )
    parts += dots("hit", [(c.x_m, c.y_m) for c in result.contacts])
    bar_px = SCALE_BAR_M * px_per_m
    parts += [
        polyline([(10.0, height_px - 10.0), (10.0 + bar_px, height_px - 10.0)], class_="scale"),
        element("text", f"{SCALE_BAR_M:.0f} m", x=round(14 + bar_px), y=round(height_px - 6)),
    ]
    title = f"{result.scenario} from above"
    return drawing(round(WIDTH_PX), round(height_px), title, parts, class_="plan")


def find_worst_moment_s(result: TrialResult) -> float:
    """Time of the first contact, else of the closest point, else of the end."""
    if result.contacts:
        return result.contacts[0].at_s
    if result.completed and result.encounters:
        return min(result.encounters, key=lambda encounter: encounter.clearance_m).at_s
    return result.track[-1][0] if result.track else 0.0
