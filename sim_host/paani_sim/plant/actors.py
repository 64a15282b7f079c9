"""Actors: their motion along their paths, and how vessels and swimmers give way to the boat."""

import bisect
import math
from collections.abc import Sequence

import numpy as np

from paani_sim.worlds.world import Actor, Behaviour, Kind, Pose2, actor_distance_along_m

VESSEL_KEEPS_CLEAR_M = 3.0  # between the hulls, when an actor has stopped
SWIMMER_KEEPS_CLEAR_M = 1.0
ABREAST_MARGIN_M = 1.0  # beyond the actor's half width: a boat farther to the side does not count as ahead
DECELERATION_MPS2 = 0.15  # of a small craft that throttles back
# An actor that has stopped for the boat this long moves away for a while: astern, or ahead if the boat is abaft.
PATIENCE_S, YIELDING_MPS, YIELDING_S = 8.0, 0.4, 30.0
STANDING_MPS = 0.05
FLIGHT_M, FLIGHT_MPS = 4.0, 1.2  # how near a boat may come to what flees, hull to middle, and how it hurries away


class ActorPath:
    """An actor's path, measured once: `at` is `actor_pose_along` to the last bits, much sooner."""

    def __init__(self, actor: Actor) -> None:
        path_m = np.vstack([actor.path_m, actor.path_m[:1]]) if actor.closed else actor.path_m
        steps = np.diff(path_m, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        self._closed = actor.closed
        self._half_length_m = 0.5 * actor.length_m
        self._arc_m: list[float] = np.concatenate([[0.0], np.cumsum(lengths)]).tolist()
        self._legs: list[list[float]] = np.column_stack([path_m[:-1], steps / lengths[:, None]]).tolist()

    def pose_at(self, along_m: float) -> Pose2:
        """Pose of the actor at `along_m` along its path."""
        x_m, y_m, east, north = self._point(along_m)
        ahead, behind = self._point(along_m + self._half_length_m), self._point(along_m - self._half_length_m)
        east_m, north_m = ahead[0] - behind[0], ahead[1] - behind[1]
        if not (east_m or north_m):
            east_m, north_m = east, north
        return Pose2(x_m, y_m, math.atan2(north_m, east_m))

    def keep_on(self, along_m: float) -> float:
        """The same distance, no further than the path leads: at the end of an open one the actor stays."""
        return along_m if self._closed else min(max(along_m, 0.0), self._arc_m[-1])

    def goes_on(self, along_m: float, speed_mps: float) -> bool:
        """Whether the path leads on from there, ahead or, with a negative speed, back."""
        return self._closed or (along_m < self._arc_m[-1] if speed_mps > 0.0 else along_m > 0.0)

    def _point(self, along_m: float) -> tuple[float, float, float, float]:
        arc_m = self._arc_m
        at_m = along_m % arc_m[-1] if self._closed else min(max(along_m, 0.0), arc_m[-1])
        leg = min(bisect.bisect_right(arc_m, at_m) - 1, len(self._legs) - 1)
        x_m, y_m, east, north = self._legs[leg]
        beyond_m = at_m - arc_m[leg]
        return x_m + beyond_m * east, y_m + beyond_m * north, east, north


def yielding_speed_mps(actor: Actor, pose: Pose2, boat_xy_m: tuple[float, float], boat_reach_m: float) -> float:
    """Speed of the actor with the boat at this place; `boat_reach_m` is the boat's half length.

    One that gives way slows so that it could stop short of a boat ahead, `VESSEL_KEEPS_CLEAR_M` or, who swims,
    `SWIMMER_KEEPS_CLEAR_M`, and goes on when that is clear; with the boat close alongside it stands still and lets it
    draw ahead. One that flees hurries away from a boat within `FLIGHT_M`, forward where that is abaft.
    """
    if actor.behaviour is Behaviour.HOLDS_ON:
        return actor.speed_mps
    ahead_m, aside_m = locate_boat_m(pose, boat_xy_m)
    if actor.behaviour is Behaviour.FLEES:
        if math.hypot(ahead_m, aside_m) - boat_reach_m > FLIGHT_M:
            return actor.speed_mps
        return -FLIGHT_MPS if ahead_m > 0.0 else FLIGHT_MPS
    if (
        ahead_m <= -0.5 * actor.length_m - boat_reach_m
        or aside_m > 0.5 * actor.width_m + boat_reach_m + ABREAST_MARGIN_M
    ):
        return actor.speed_mps
    keep_clear_m = SWIMMER_KEEPS_CLEAR_M if actor.kind is Kind.PERSON else VESSEL_KEEPS_CLEAR_M
    distance_to_stop_m = ahead_m - 0.5 * actor.length_m - boat_reach_m - keep_clear_m
    return min(actor.speed_mps, math.sqrt(2.0 * DECELERATION_MPS2 * max(distance_to_stop_m, 0.0)))


def locate_boat_m(pose: Pose2, boat_xy_m: tuple[float, float]) -> tuple[float, float]:
    """How far the boat's middle is ahead of the actor's, along its heading, and how far aside, on either side."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    east_m, north_m = boat_xy_m[0] - pose.x_m, boat_xy_m[1] - pose.y_m
    return cos * east_m + sin * north_m, abs(cos * north_m - sin * east_m)


class Actors:
    """All actors of a world, advanced together every `every_s`."""

    def __init__(self, actors: Sequence[Actor], every_s: float, boat_reach_m: float) -> None:
        """Put every actor at its start."""
        self._actors = tuple(actors)
        self._paths = [ActorPath(actor) for actor in actors]
        self._every_s = every_s
        self._boat_reach_m = boat_reach_m
        self.along_m = tuple(actor_distance_along_m(actor, 0.0) for actor in actors)
        self._waited_s = [0.0] * len(self._actors)
        self.speeds_mps = tuple(0.0 for _ in actors)
        self.poses = [path.pose_at(along_m) for path, along_m in zip(self._paths, self.along_m, strict=True)]

    def advance(self, t_s: float, boat_xy_m: tuple[float, float]) -> None:
        """To simulated time `t_s`, `every_s` after the last one; an actor that holds on is where time alone puts it."""
        along, speeds = [], []
        for number, (actor, pose, along_m) in enumerate(zip(self._actors, self.poses, self.along_m, strict=True)):
            speed = 0.0
            if t_s > actor.start_s:
                speed = yielding_speed_mps(actor, pose, boat_xy_m, self._boat_reach_m)
                if actor.behaviour is Behaviour.GIVES_WAY:
                    speed = self._apply_patience(number, speed, pose, boat_xy_m)
            if actor.behaviour is Behaviour.HOLDS_ON:
                reached_m = actor_distance_along_m(actor, t_s)
            else:
                reached_m = self._paths[number].keep_on(along_m + speed * self._every_s)
            along.append(reached_m)
            speeds.append(speed if self._paths[number].goes_on(reached_m, speed) else 0.0)
        self.along_m, self.speeds_mps = tuple(along), tuple(speeds)
        self.poses = [path.pose_at(along_m) for path, along_m in zip(self._paths, along, strict=True)]

    def _apply_patience(self, number: int, speed: float, pose: Pose2, boat_xy_m: tuple[float, float]) -> float:
        """The speed; after `PATIENCE_S` of standing still for the boat, away from it for `YIELDING_S`."""
        waited_s = self._waited_s[number]
        if waited_s >= PATIENCE_S:
            self._waited_s[number] = waited_s + self._every_s if waited_s < PATIENCE_S + YIELDING_S else 0.0
            return -YIELDING_MPS if locate_boat_m(pose, boat_xy_m)[0] > 0.0 else YIELDING_MPS
        stands = speed < STANDING_MPS < self._actors[number].speed_mps
        self._waited_s[number] = waited_s + self._every_s if stands else 0.0
        return speed
