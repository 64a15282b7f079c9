"""Flat patches around things: wakes on the water, shadows on water and ground. Pure numpy.

A row is x, y, z; two coordinates in the patch; four numbers, the last of which says what it is, a shadow (0) or a wake
(1); and the way the patch runs. A shadow's coordinates are -1..1, its second number is how dark it is. A wake's are
metres behind the bow and to the left of the track; its numbers are wave number [rad/m], steepness, half the beam [m].
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from paani.arrays import F32, F64
from paani_sim.eye.wave_motion import is_floating
from paani_sim.water.waves import GRAVITY_MPS2
from paani_sim.worlds.sizes import hull_beam_m
from paani_sim.worlds.world import Actor, Kind, Obstacle, Pose2

PATCH_WIDTHS = (3, 2, 4, 2)
COLUMNS = sum(PATCH_WIDTHS)
KELVIN = 0.354  # tangent of the wake's half angle, 19.47 degrees (Kelvin, 1887)
TRAIL_M, TRAIL_STEPS = 22.0, 16
MIN_SPEED_MPS = 0.2
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
QUAD = np.array([0, 1, 2, 0, 2, 3], np.uint32)
SHADOW, WAKE = 0.0, 1.0
SHADOWLESS = frozenset({"bridge", "bridge_pier", "island", "weir"})  # an oval on the water would not be theirs


def shadow_cast_per_m(sun_direction: F32) -> F64:
    """How far the shadow of a metre's height reaches over level ground `(2,)`."""
    return np.asarray(-sun_direction[:2] / max(float(sun_direction[2]), 0.35), float)


def shadow(pose: Pose2, z_m: float, size_m: tuple[float, float, float], dark: float, cast: F64) -> F64:
    """Four rows of a soft oval round a footprint (length, width), drawn out as the height casts it."""
    length_m, width_m, height_m = size_m
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    reach = CORNERS * [0.62 * length_m + 0.12, 0.62 * width_m + 0.12]
    return _ovals(
        np.array([[pose.x_m, pose.y_m, z_m]]), reach @ np.array([[cos, sin], [-sin, cos]]), height_m, dark, cast
    )


def _ovals(foot_m: F64, reach: F64, height_m: float | F64, dark: float, cast: F64) -> F64:
    """Patches `(4 n, COLUMNS)` round `(n, 3)` feet; corners away from the sun reach `height_m * cast` farther."""
    rows = np.zeros((len(foot_m), 4, COLUMNS))
    rows[:, :, :3] = foot_m[:, None]
    rows[:, :, :2] += reach
    lee = np.broadcast_to(reach, (len(foot_m), 4, 2)) @ cast > 0.0
    rows[:, :, :2] += lee[..., None] * np.reshape(height_m, (-1, 1, 1)) * cast
    rows[:, :, 3:5] = CORNERS
    rows[:, :, 6] = dark
    return rows.reshape(-1, COLUMNS)


def standing_shadows(obstacles: Iterable[Obstacle], cast: F64) -> F64:
    """Shadows `(4 n, COLUMNS)` of people and buildings on the ground or deck under them."""
    rows = [np.zeros((0, COLUMNS))]
    for o in obstacles:
        if is_floating(o) or o.look in SHADOWLESS:
            continue
        if o.kind is Kind.PERSON:
            rows.append(shadow(o.pose, o.base_z_m + 0.03, (0.5, 0.42, 0.8 * o.height_m), 0.75, cast))
        elif o.kind is Kind.OTHER:
            size = (1.1 * o.length_m, 1.1 * o.width_m, 0.4 * o.height_m)
            rows.append(shadow(o.pose, o.base_z_m + 0.03, size, 0.5, cast))
    return np.concatenate(rows)


def tree_shadows(plants: F32, cast: F64) -> F64:
    """Shadows of what is tall among the plants `(n, 7)`, a soft oval at the foot of each."""
    tall = plants[plants[:, 4] > 4.0].astype(float)
    reach = CORNERS * (0.40 * tall[:, 3])[:, None, None]
    foot = tall[:, :3] + np.column_stack([np.zeros((len(tall), 2)), 0.03 * tall[:, 4] + 0.12])
    return _ovals(foot, reach, 0.3 * tall[:, 4], 0.55, cast)


def patch_order(rows: int) -> npt.NDArray[np.uint32]:
    """Triangle indices of `rows / 4` patches."""
    return (4 * np.arange(rows // 4, dtype=np.uint32)[:, None] + QUAD).reshape(-1).astype(np.uint32)


def floating_shadow(thing: Obstacle | Actor, pose: Pose2, cast: F64) -> F64:
    """On the water, round the waterline."""
    tall = 0.7 * min(thing.height_m, 0.4 * thing.length_m + 0.4)
    return shadow(pose, 0.0, (thing.length_m, hull_beam_m(thing), tall), 0.8, cast)


def wake(actor: Actor, along_m: float) -> F64:
    """Patches `(4 n, COLUMNS)` of the wake that a moving actor trails down its path; none while it is slow."""
    if actor.speed_mps < MIN_SPEED_MPS or (not actor.closed and along_m >= _length_m(actor)):
        return np.zeros((0, COLUMNS))
    behind = np.linspace(0.0, TRAIL_M, TRAIL_STEPS + 1)
    bow_m = along_m + 0.45 * actor.length_m
    line = _points_at(actor, bow_m - behind)
    way = np.gradient(line, axis=0)
    way /= np.maximum(np.hypot(way[:, :1], way[:, 1:]), 1e-9)
    way = -way  # the line runs backwards
    left = np.column_stack([-way[:, 1], way[:, 0]])
    beam_m = hull_beam_m(actor)
    reach = 0.5 * beam_m + 0.8 + KELVIN * 1.35 * behind
    wave_radpm = min(GRAVITY_MPS2 / actor.speed_mps**2, 14.0)
    steep = 0.14 * min(1.5, actor.speed_mps) * min(1.0, beam_m / 1.5)
    edge = {side: line + side * reach[:, None] * left for side in (1.0, -1.0)}
    rows = np.zeros((TRAIL_STEPS, 4, COLUMNS))
    for corner, (step, side) in enumerate(((0, -1.0), (0, 1.0), (1, 1.0), (1, -1.0))):
        pick = slice(step, TRAIL_STEPS + step)
        rows[:, corner, :2] = edge[side][pick]
        rows[:, corner, 3] = behind[pick]
        rows[:, corner, 4] = side * reach[pick]
        rows[:, corner, 9:] = way[pick]
    rows[..., 5:9] = (wave_radpm, steep, 0.5 * beam_m, WAKE)
    straight = np.minimum.accumulate(np.clip(2.0 * way @ way[0] - 1.0, 0.0, 1.0))  # round a bend the strip would fold
    rows[..., 6] *= np.column_stack([straight[:-1], straight[:-1], straight[1:], straight[1:]])
    return rows[straight[:-1] > 0.0].reshape(-1, COLUMNS)


def _length_m(actor: Actor) -> float:
    return float(np.hypot(*np.diff(actor.path_m, axis=0).T).sum())


def _points_at(actor: Actor, along_m: F64) -> F64:
    path = np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = along_m % arc[-1] if actor.closed else np.clip(along_m, 0.0, arc[-1])
    return np.column_stack([np.interp(at, arc, path[:, k]) for k in (0, 1)])
