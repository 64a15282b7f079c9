"""A drive seen from above, as SVG text. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from paani.arrays import F64
from paani_sim.trials.outlines import AFLOAT_Z_M
from paani_sim.trials.result import Closeness, TrialResult
from paani_sim.worlds import World, actor_at, along_at
from paani_sim.worlds.footprint import placed, shape_of

WIDTH_PX = 520.0
MARGIN_M = 9.0
SCALE_BAR_M = 10.0


def plan_view(world: World, result: TrialResult) -> str:
    """Shore, route, things, actors where they were at the drive's worst moment, track, contacts and near misses."""
    track = np.array([(x, y) for _, x, y in result.track] or [world.start[:2]])
    low, high = track.min(axis=0) - MARGIN_M, track.max(axis=0) + MARGIN_M
    wide = max(high[0] - low[0], (high[1] - low[1]) / 1.4)
    middle = 0.5 * (low + high)
    low[0], high[0] = middle[0] - 0.5 * wide, middle[0] + 0.5 * wide
    scale = WIDTH_PX / wide
    height_px = scale * (high[1] - low[1])

    def points(line: F64) -> str:
        return " ".join(f"{(x - low[0]) * scale:.1f},{(high[1] - y) * scale:.1f}" for x, y in line.tolist())

    def polygon(kind: str, line: F64) -> str:
        return f'<polygon class="{kind}" points="{points(line)}"/>'

    route = np.vstack([world.route_m, world.route_m[:1]]) if world.route_closed else world.route_m
    parts = [
        f'<svg class="plan" viewBox="0 0 {WIDTH_PX:.0f} {height_px:.0f}" role="img">'
        f"<title>{escape(result.scenario)} from above</title>",
        f'<rect class="land" width="{WIDTH_PX:.0f}" height="{height_px:.0f}"/>',
        polygon("water", world.shore_m),
        f'<polyline class="route" points="{points(route)}"/>',
    ]
    parts += [
        polygon(each.kind.value, placed(shape_of(each), each.pose))
        for each in world.obstacles
        if each.base_z_m < AFLOAT_Z_M
    ]
    at_s = worst_moment_s(result)
    for actor in world.actors:
        line = np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m
        parts.append(f'<polyline class="way" points="{points(line)}"/>')
        parts.append(polygon(actor.kind.value, placed(shape_of(actor), actor_at(actor, along_at(actor, at_s)))))
    parts.append(f'<polyline class="track" points="{points(track)}"/>')
    parts += _dots("start", track[:1], low, high, scale)
    near = [(e.x_m, e.y_m) for e in result.encounters if e.closeness in {Closeness.GRAZING, Closeness.TIGHT}]
    parts += _dots("near", np.array(near).reshape(-1, 2), low, high, scale)
    parts += _dots("hit", np.array([(c.x_m, c.y_m) for c in result.contacts]).reshape(-1, 2), low, high, scale)
    bar_px = SCALE_BAR_M * scale
    parts.append(
        f'<path class="scale" d="M10 {height_px - 10:.0f}h{bar_px:.1f}"/>'
        f'<text x="{14 + bar_px:.0f}" y="{height_px - 6:.0f}">{SCALE_BAR_M:.0f} m</text></svg>'
    )
    return "".join(parts)


def worst_moment_s(result: TrialResult) -> float:
    """The first touch, else the closest point, else where it ended."""
    if result.contacts:
        return result.contacts[0].at_s
    if result.completed and result.encounters:
        return min(result.encounters, key=lambda encounter: encounter.clearance_m).at_s
    return result.track[-1][0] if result.track else 0.0


def _dots(kind: str, places: F64, low: F64, high: F64, scale: float) -> Iterable[str]:
    return [
        f'<circle class="{kind}" cx="{(x - low[0]) * scale:.1f}" cy="{(high[1] - y) * scale:.1f}" r="5"/>'
        for x, y in places.tolist()
    ]
