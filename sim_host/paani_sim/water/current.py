"""Current: along the channel or one way, and slower towards the banks by the one-seventh power law.

The law is L. Prandtl's for turbulent flow over a wall, with the distance to the bank for the distance to the
bed. Current as a velocity that the hull moves through: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and
Motion Control, 2nd ed. 2021, section 10.3.
"""

import math

import numpy as np

from paani_sim.worlds.curves import Points, clearance_m
from paani_sim.worlds.world import World

CELL_M = 2.0
EXPONENT = 1.0 / 7.0


class CurrentField:
    """Velocity of the water over ground, on a grid made once and interpolated linearly."""

    def __init__(self, world: World) -> None:
        """Only a world with a current pays for the grid."""
        self._still = world.current.speed_mps == 0.0
        if self._still:
            return
        low, high = world.shore_m.min(axis=0), world.shore_m.max(axis=0)
        columns, rows = (int(n) + 2 for n in np.ceil((high - low) / CELL_M))
        x, y = np.meshgrid(low[0] + CELL_M * np.arange(columns), low[1] + CELL_M * np.arange(rows))
        velocity = current_mps(world, np.column_stack([x.ravel(), y.ravel()]))
        self._low_m = float(low[0]), float(low[1])
        self._last = columns - 1.001, rows - 1.001
        self._x = velocity[:, 0].reshape(rows, columns).tolist()
        self._y = velocity[:, 1].reshape(rows, columns).tolist()

    def at(self, x_m: float, y_m: float) -> tuple[float, float]:
        """In the map frame [m/s]; beyond the grid as on its rim."""
        if self._still:
            return 0.0, 0.0
        column = min(max((x_m - self._low_m[0]) / CELL_M, 0.0), self._last[0])
        row = min(max((y_m - self._low_m[1]) / CELL_M, 0.0), self._last[1])
        i, j = int(column), int(row)
        right, up = column - i, row - j
        weights = (1.0 - right) * (1.0 - up), right * (1.0 - up), (1.0 - right) * up, right * up
        below, above = self._x[j], self._x[j + 1]
        x = weights[0] * below[i] + weights[1] * below[i + 1] + weights[2] * above[i] + weights[3] * above[i + 1]
        below, above = self._y[j], self._y[j + 1]
        y = weights[0] * below[i] + weights[1] * below[i + 1] + weights[2] * above[i] + weights[3] * above[i + 1]
        return x, y


def current_mps(world: World, points_m: Points) -> Points:
    """Velocity `(n, 2)` at points `(n, 2)`: full in mid-channel (or furthest from land), nothing ashore."""
    bank_m = np.maximum(clearance_m(world.shore_m, points_m), 0.0)
    if world.channel_m is None:
        toward = world.current.toward_rad
        direction = np.array([[math.cos(toward), math.sin(toward)]])
        part = bank_m / max(float(bank_m.max()), 1e-9)
    else:
        middle_m, direction = _along_channel(world.channel_m, points_m)
        part = bank_m / np.maximum(bank_m + middle_m, 1e-9)
    speed_mps = world.current.speed_mps * part**EXPONENT
    return np.asarray(speed_mps[:, None] * direction)


def _along_channel(channel_m: Points, points_m: Points) -> tuple[Points, Points]:
    """Distance `(n,)` to the nearest point of the centre line, and its direction downstream `(n, 2)`."""
    tangent = np.gradient(channel_m, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    distance_m, nearest = np.empty(len(points_m)), np.empty(len(points_m), int)
    for first in range(0, len(points_m), 1024):
        away = np.linalg.norm(points_m[first : first + 1024, None] - channel_m[None], axis=-1)
        nearest[first : first + 1024] = away.argmin(axis=1)
        distance_m[first : first + 1024] = away.min(axis=1)
    return distance_m, tangent[nearest]
