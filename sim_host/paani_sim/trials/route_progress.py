"""Progress along a route and cross-track distance. Pure."""

from __future__ import annotations

import math

import numpy as np

from paani.arrays import F64

SEARCH_BEHIND_M, SEARCH_AHEAD_M = (
    10.0,
    30.0,
)  # the search window keeps to one branch where the route comes near itself


class RouteProgress:
    """Tracks one boat. `progress_m`: along the route since the start, laps added; `best_progress_m`: its maximum."""

    def __init__(self, route_m: F64, *, closed: bool, start_m: tuple[float, float]) -> None:
        """route_m: `(n, 2)`. start_m: where the boat is at first; the nearest point of the route counts as 0."""
        line = np.vstack([route_m, route_m[:1]]) if closed else route_m
        self._first, self._legs = line[:-1], np.diff(line, axis=0)
        self._lengths_m = np.maximum(np.hypot(self._legs[:, 0], self._legs[:, 1]), 1e-9)
        self._begins_m = np.concatenate([[0.0], np.cumsum(self._lengths_m)[:-1]])
        self._closed = closed
        self.length_m = float(self._lengths_m.sum())
        arc_m, self.cross_track_m = self._nearest(start_m, None)
        self._arc_m = self.start_arc_m = arc_m
        self.progress_m = self.best_progress_m = 0.0

    def update(self, position_m: tuple[float, float]) -> None:
        """Update with the boat's position. `cross_track_m` is its distance to the route, positive to the left of it."""
        arc_m, self.cross_track_m = self._nearest(position_m, self._arc_m)
        step_m = arc_m - self._arc_m
        if self._closed:
            step_m -= self.length_m * round(step_m / self.length_m)
        self._arc_m = arc_m
        self.progress_m += step_m
        self.best_progress_m = max(self.best_progress_m, self.progress_m)

    def _nearest(self, position_m: tuple[float, float], around_m: float | None) -> tuple[float, float]:
        rel = np.asarray(position_m) - self._first
        part = np.clip((rel * self._legs).sum(1) / self._lengths_m**2, 0.0, 1.0)
        away = rel - part[:, None] * self._legs
        gap2 = (away * away).sum(1)
        if around_m is not None:
            middle_m = self._begins_m + 0.5 * self._lengths_m - around_m
            if self._closed:
                middle_m = (middle_m + 0.5 * self.length_m) % self.length_m - 0.5 * self.length_m
            reach_m = 0.5 * self._lengths_m
            gap2 = np.where(
                (middle_m < -SEARCH_BEHIND_M - reach_m) | (middle_m > SEARCH_AHEAD_M + reach_m), np.inf, gap2
            )
        leg = int(np.argmin(gap2))
        side = self._legs[leg, 0] * away[leg, 1] - self._legs[leg, 1] * away[leg, 0]
        cross_track_m = math.copysign(math.hypot(*away[leg].tolist()), side)
        return float(self._begins_m[leg] + part[leg] * self._lengths_m[leg]), cross_track_m
