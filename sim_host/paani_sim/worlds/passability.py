"""Passability: distances to things, and whether a boat can get from one end of its route to the other."""

from collections.abc import Iterable, Sequence

import numpy as np

from paani.arrays import F64, Bools
from paani_sim.worlds.curves import clearance_m
from paani_sim.worlds.route_frame import RouteFrame
from paani_sim.worlds.world import Actor, Obstacle, Pose2, World, actor_pose_at

HEADROOM_M = 2.0  # a boat passes underneath a thing with a higher foot
HALF_SPAN_M = 14.0
START_HALF_SPAN_M = 5.0
ALONG_STEP_M = 1.0
LEFT_STEP_M = 0.5
STEP_S = 4.0
AT_LAST_S = 1e5


def footprint_distance_m(thing: Obstacle | Actor, pose: Pose2, points_m: F64) -> F64:
    """Distance `(n,)` from the points `(n, 2)` to the thing's footprint at `pose`; zero inside."""
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    east_m, north_m = points_m[:, 0] - pose.x_m, points_m[:, 1] - pose.y_m
    ahead_m = np.maximum(np.abs(east_m * cos + north_m * sin) - 0.5 * thing.length_m, 0.0)
    aside_m = np.maximum(np.abs(north_m * cos - east_m * sin) - 0.5 * thing.width_m, 0.0)
    gap_m: F64 = np.sqrt(ahead_m * ahead_m + aside_m * aside_m)
    return gap_m


def obstacle_distance_m(obstacles: Iterable[Obstacle], points_m: F64) -> F64:
    """Distance `(n,)` from each point to the nearest obstacle that a boat cannot pass underneath."""
    gap_m = np.full(len(points_m), np.inf)
    for obstacle in obstacles:
        if obstacle.base_z_m <= HEADROOM_M:
            gap_m = np.minimum(gap_m, footprint_distance_m(obstacle, obstacle.pose, points_m))
    return gap_m


class PassabilityGrid:
    """Points on and beside the first `length_m` of a route, with their distance to shore and obstacles."""

    def __init__(self, world: World, route: RouteFrame, length_m: float) -> None:
        self._along_m = np.arange(0.0, length_m + 0.5 * ALONG_STEP_M, ALONG_STEP_M)
        left_m = np.arange(-HALF_SPAN_M, HALF_SPAN_M + 0.5 * LEFT_STEP_M, LEFT_STEP_M)
        self._shape = (len(self._along_m), len(left_m))
        self._lane = np.abs(left_m) < 0.25
        self._near = np.abs(left_m) <= START_HALF_SPAN_M
        lane = np.array([route.pose_at(float(along_m)) for along_m in self._along_m])
        left = np.column_stack([-np.sin(lane[:, 2]), np.cos(lane[:, 2])])
        self.points_m = (lane[:, None, :2] + left_m[None, :, None] * left[:, None]).reshape(-1, 2)
        self.shore_gap_m = clearance_m(world.shore_m, self.points_m)

    def is_passable(
        self, obstacles: Sequence[Obstacle], actors: Sequence[Actor], gap_width_m: float, boat_mps: float
    ) -> bool:
        """Whether a gap `room_m` wide leads on at any time, from where a boat at `boat_mps` then is or somewhat before.

        With the actors where they finally are it leads from the start, and the way's last point is free.
        """
        still_m = np.minimum(self.shore_gap_m, obstacle_distance_m(obstacles, self.points_m))
        half_m = 0.5 * gap_width_m
        nominal_s = float(self._along_m[-1]) / boat_mps if actors else 0.0
        for t_s in np.arange(0.0, nominal_s + STEP_S, STEP_S):
            first = int(np.searchsorted(self._along_m, boat_mps * t_s - 5.0))
            if not _is_connected(self._free(still_m, actors, float(t_s), half_m)[first:], self._near):
                return False
        at_last = self._free(still_m, actors, AT_LAST_S, half_m)
        return _is_connected(at_last, self._lane) and bool(at_last[-1, self._lane].all())

    def _free(self, still_m: F64, actors: Sequence[Actor], t_s: float, half_m: float) -> Bools:
        gap_m = still_m
        for actor in actors:
            gap_m = np.minimum(gap_m, footprint_distance_m(actor, actor_pose_at(actor, t_s), self.points_m))
        return (gap_m >= half_m).reshape(self._shape)


def _is_connected(free: Bools, from_columns: Bools) -> bool:
    """Whether free cells connect these columns of the first row with the last row, without stepping back a row."""
    if not len(free):
        return True
    bits = np.left_shift(np.uint64(1), np.arange(free.shape[1], dtype=np.uint64))
    rows: list[int] = (free * bits).sum(axis=1).tolist()
    reached = rows[0] & int((from_columns * bits).sum())
    for row in rows[1:]:
        reached = _flood_row(reached & row, row)
    return reached != 0


def _flood_row(seeds: int, row: int) -> int:
    """The bits of the row that are connected with a seed by bits of the row; 64 bits."""
    up = down = seeds
    up_row = down_row = row
    for shift in (1, 2, 4, 8, 16, 32):
        up |= up_row & (up << shift)
        up_row &= up_row << shift
        down |= down_row & (down >> shift)
        down_row &= down_row >> shift
    return up | down
