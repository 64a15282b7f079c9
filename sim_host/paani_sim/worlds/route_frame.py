"""Coordinates along a route and to its left, also before its start and beyond its end."""

import dataclasses

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.curves import point_along_closed, point_along_open
from paani_sim.worlds.world import Pose2, World

LEG_M = 7.5


class RouteFrame:
    """Route coordinates; `along_m` 0 is the boat's start. Beyond its ends an open route is extended straight."""

    def __init__(self, route_m: F64, *, closed: bool, first_m: float = 0.0) -> None:
        self._route_m = route_m
        self._closed = closed
        self._first_m = first_m
        self._length_m = float(np.linalg.norm(np.diff(route_m, axis=0), axis=1).sum())

    def pose_at(self, along_m: float, left_m: float = 0.0, turn_rad: float = 0.0) -> Pose2:
        """Pose in the map, heading along the route plus `turn_rad`."""
        distance_m = self._first_m + along_m
        if self._closed:
            x_m, y_m, yaw_rad = point_along_closed(self._route_m, distance_m)
            beyond_m = 0.0
        else:
            x_m, y_m, yaw_rad = point_along_open(self._route_m, distance_m)
            beyond_m = min(distance_m, 0.0) + max(distance_m - self._length_m, 0.0)
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        return Pose2(
            float(x_m + beyond_m * cos - left_m * sin),
            float(y_m + beyond_m * sin + left_m * cos),
            yaw_rad + turn_rad,
        )

    def line_m(self, first_m: float, last_m: float, left_m: float = 0.0) -> F64:
        """Points about every metre from `first_m` to `last_m`, either way, `left_m` to the left of the route."""
        count = max(2, round(abs(last_m - first_m)) + 1)
        return np.array([self.pose_at(float(along_m), left_m)[:2] for along_m in np.linspace(first_m, last_m, count)])


def cut_route(world: World, from_m: float, length_m: float) -> World:
    """The world with an open route: `length_m` of its own from `from_m` on, the boat at its beginning."""
    way = RouteFrame(world.route_m, closed=world.route_closed, first_m=from_m)
    legs = max(1, int(np.ceil(length_m / LEG_M)))
    route_m = np.array([way.pose_at(float(along_m))[:2] for along_m in np.linspace(0.0, length_m, legs + 1)])
    return dataclasses.replace(world, route_m=route_m, route_closed=False, start=start_pose(route_m))


def start_pose(route_m: F64) -> Pose2:
    """The pose on the first waypoint, heading for the second."""
    (x_m, y_m), (east_m, north_m) = route_m[0], route_m[1] - route_m[0]
    return Pose2(float(x_m), float(y_m), float(np.arctan2(north_m, east_m)))
