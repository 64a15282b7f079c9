"""Sheet of the Imazu cases: each drive's tracks from above, as SVG text. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from paani.statistics.charts import Axes, circle, drawing, element, polygon, polyline
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import TrialResult
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.worlds import Actor, actor_pose_at
from paani_sim.worlds.imazu import FAIR_PREFIX, IMAZU_SCENARIOS, PREFIX, RUN_M, build_imazu_scenario, case_codes

CELL_PX, CAPTION_PX, COLUMNS = 196.0, 20.0, 6
X_RANGE_M, Y_HALF_M = (-8.0, 54.0), 31.0
TICK_S, TRACK_END_S = 10.0, 90.0  # between dots on a track, and how long vessels are drawn
WEDGE_M = 14.0  # how far the lens is drawn; the navigator tracks vessels up to there


def draw_imazu_sheet(results: Mapping[TrialCase, TrialResult], policy: Policy) -> str:
    """Every case that the policy has driven, the first seed of each, plain ones first; empty where there is none."""
    driven: dict[str, TrialResult] = {}
    for case, result in sorted(results.items()):
        if case.policy is policy and case.world in IMAZU_SCENARIOS and not case.fault:
            driven.setdefault(case.world, result)
    names = [name for name in IMAZU_SCENARIOS if name in driven]
    if not names:
        return ""
    rows = math.ceil(len(names) / COLUMNS)
    parts = []
    for number, name in enumerate(names):
        left_px, top_px = (number % COLUMNS) * CELL_PX, (number // COLUMNS) * (CELL_PX + CAPTION_PX)
        parts += _draw_case(name, driven[name], left_px, top_px)
    title = f"Imazu cases driven by {policy.value}, from above"
    return drawing(round(COLUMNS * CELL_PX), round(rows * (CELL_PX + CAPTION_PX)), title, parts, class_="imazu")


def _draw_case(name: str, result: TrialResult, left_px: float, top_px: float) -> list[str]:
    size_px = CELL_PX - 6.0
    axes = Axes(X_RANGE_M, (-Y_HALF_M, Y_HALF_M), left_px, top_px + CAPTION_PX, size_px, size_px)
    end_s = min(result.track[-1][0] if result.track else 0.0, TRACK_END_S)
    half_rad = math.radians(0.5 * result.hfov_deg)
    angles_rad = np.linspace(-half_rad, half_rad, 13).tolist()
    arc = [(WEDGE_M * math.cos(angle_rad), WEDGE_M * math.sin(angle_rad)) for angle_rad in angles_rad]
    parts = [
        element("rect", class_="sea", x=round(left_px), y=round(top_px + CAPTION_PX), width=size_px, height=size_px),
        polygon(axes.place_all([(0.0, 0.0), *arc]), class_="lens"),
        polyline(axes.place_all([(0.0, 0.0), (2.0 * RUN_M, 0.0)]), class_="route"),
    ]
    for actor in build_imazu_scenario(name).world.actors:
        parts += _draw_target(actor, end_s, axes)
    track = [(x_m, y_m) for _, x_m, y_m in result.track]
    parts.append(polyline(axes.place_all(track), class_="track"))
    ticks = [(x_m, y_m) for t_s, x_m, y_m in result.track if t_s % TICK_S < 2.0 and t_s >= TICK_S]
    parts += [circle(point, 1.8, class_="start") for point in axes.place_all(ticks)]
    parts += [circle(point, 5.0, class_="hit") for point in axes.place_all([(c.x_m, c.y_m) for c in result.contacts])]
    form = "camera-fair" if name.startswith(FAIR_PREFIX) else "plain"
    case = name.removeprefix(FAIR_PREFIX).removeprefix(PREFIX).lstrip("0")
    least_m = min((each.clearance_m for each in result.rule_encounters), default=0.0)
    caption = f"{case} {form}: {' '.join(case_codes(name))}, {least_m:.1f} m"
    kind = "bad" if result.collisions else "good"
    return [*parts, element("text", caption, class_=kind, x=round(left_px + 2), y=round(top_px + 14))]


def _draw_target(actor: Actor, end_s: float, axes: Axes) -> list[str]:
    times_s = np.arange(0.0, end_s + 1.0, 2.0).tolist()
    line = [actor_pose_at(actor, t_s)[:2] for t_s in times_s]
    inside = [point for point in line if _is_inside(point)]
    ticks = [actor_pose_at(actor, t_s)[:2] for t_s in np.arange(TICK_S, end_s + 0.1, TICK_S).tolist()]
    parts = [polyline(axes.place_all(inside), class_="target")] if len(inside) > 1 else []
    parts += [circle(point, 1.8, class_="vessel") for point in axes.place_all([p for p in ticks if _is_inside(p)])]
    return parts + [circle(point, 3.0, class_="vessel") for point in axes.place_all(inside[:1])]


def _is_inside(point: tuple[float, float]) -> bool:
    return X_RANGE_M[0] <= point[0] <= X_RANGE_M[1] and abs(point[1]) <= Y_HALF_M
