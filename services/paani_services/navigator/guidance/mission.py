"""Which leg of the mission is due, and what it asks for. Pure: values in, values out.

A mission is its legs in order. Legs that wait for the operator go on when the boat is stopped and armed again.
"""

import math
from typing import NamedTuple

import msgspec

from paani.config import NavigatorConfig
from paani.messages import Arming, Inhibit, LegKind, Mission, MissionLeg, Odometry, Route, Waypoint
from paani_services.navigator.guidance.ilos import Crab, offset_m
from paani_services.navigator.guidance.path_progress import (
    MIN_LEG_M,
    Point,
    Track,
    bearing_rad,
    course_rad,
    cross_track_m,
    first_target,
    is_reached,
)


class Progress(msgspec.Struct, frozen=True):
    """How far the mission has come. `reached` counts waypoints of all legs, `reached_before` those of earlier legs.

    Of the leg that is due: `target` is the waypoint steered for (None before the first), `began` where it began,
    `arrived_us` when the boat first was on station [us of simulated time], `adrift` that it left the station again,
    `armed_epoch` in which run of the operator's process it was last armed, `stopped` that it was stopped since.
    """

    leg: int = 0
    target: int | None = None
    reached: int = 0
    reached_before: int = 0
    home: Waypoint | None = None
    began: Waypoint | None = None
    arrived_us: int | None = None
    adrift: bool = False
    armed_epoch: int | None = None
    stopped: bool = False


class Scene(NamedTuple):
    """What a step of the mission looks at. `free`: every gate is open; `straight`: and the advice is STRAIGHT."""

    odometry: Odometry
    arming: Arming | None
    sim_us: int
    free: bool
    straight: bool

    @property
    def position_m(self) -> Point:
        return self.odometry.x_m, self.odometry.y_m


class Aim(NamedTuple):
    """What the leg asks for: a course at no more than a speed, unless `inhibit` says why to hold.

    `track` is the line that is followed towards waypoint `target`; None: straight to a point.
    """

    inhibit: Inhibit | None = None
    course_rad: float = 0.0
    speed_mps: float = 0.0
    cross_track_m: float = 0.0
    track: Track | None = None
    target: int = 0


def route_alone(route: Route) -> Mission:
    """The mission of a boat that only has a route: followed once, or without end where it repeats."""
    laps = 0 if route.repeat else 1
    leg = MissionLeg(kind=LegKind.FOLLOW_ROUTE, waypoints=route.waypoints, repeat=route.repeat, laps=laps)
    return Mission(source_us=route.source_us, name=route.name, legs=(leg,))


def is_done(progress: Progress, mission: Mission) -> bool:
    """No leg is left."""
    return progress.leg >= len(mission.legs)


def follow(progress: Progress, mission: Mission, scene: Scene, config: NavigatorConfig) -> Progress:
    """One step: home, waypoints reached, time on station, the operator's word, and the next leg where one is done.

    A leg begins once the boat is free to move; home is where it first was. Waypoints count only while going straight,
    so visual turns keep theirs (M1, M3).
    """
    here = Waypoint(x_m=scene.odometry.x_m, y_m=scene.odometry.y_m)
    if progress.home is None and scene.free:
        progress = msgspec.structs.replace(progress, home=here)
    for _ in mission.legs:
        if is_done(progress, mission) or (progress.began is None and not scene.free):
            break
        if progress.began is None:
            progress = msgspec.structs.replace(progress, began=here)
        leg = mission.legs[progress.leg]
        progress, ended = _leg_step(_heard_operator(progress, scene.arming), leg, scene, config)
        if not ended:
            break
        progress = Progress(
            leg=progress.leg + 1, reached=progress.reached, reached_before=progress.reached, home=progress.home
        )
    return progress


def aim(progress: Progress, mission: Mission, crab: Crab, position_m: Point, config: NavigatorConfig) -> Aim:
    """What the leg that is due asks for at this position."""
    if is_done(progress, mission):
        alone = len(mission.legs) == 1 and mission.legs[0].kind is LegKind.FOLLOW_ROUTE
        return Aim(Inhibit.ROUTE_FINISHED if alone else Inhibit.MISSION_DONE)
    leg = mission.legs[progress.leg]
    speed_mps = min(leg.speed_mps or config.cruise_mps, config.cruise_mps)
    place = _place(leg, progress)
    if leg.kind is LegKind.STOP or (place is None and leg.kind is not LegKind.FOLLOW_ROUTE):
        return Aim(Inhibit.HOLDING)
    if leg.kind is LegKind.HOLD_STATION and place is not None and progress.arrived_us is not None:
        if not progress.adrift:
            return Aim(Inhibit.HOLDING)
        return Aim(None, bearing_rad(position_m, place), speed_mps * config.station_speed_frac)
    track = _track(leg, progress)
    if track is None:
        return Aim(Inhibit.HOLDING) if place is None else Aim(None, bearing_rad(position_m, place), speed_mps)
    target = progress.target or 0
    crab_m = offset_m(crab, track, target)
    return Aim(
        None,
        course_rad(track, target, position_m, config.lookahead_m, crab_m),
        speed_mps,
        cross_track_m(track, target, position_m),
        track,
        target,
    )


def words(progress: Progress, mission: Mission) -> str:
    """The leg that is due, for people."""
    if is_done(progress, mission):
        return "done"
    leg = mission.legs[progress.leg]
    text = leg.kind.replace("_", " ")
    if leg.kind is LegKind.FOLLOW_ROUTE and leg.repeat:
        lap = (progress.reached - progress.reached_before) // len(leg.waypoints) + 1
        text += f", lap {lap}" + (f" of {leg.laps}" if leg.laps else "")
    if _waits_for_operator(leg):
        text += ", until stopped and armed again"
    return text


def _leg_step(progress: Progress, leg: MissionLeg, scene: Scene, config: NavigatorConfig) -> tuple[Progress, bool]:
    """The leg's own step, and whether it has ended."""
    armed_again = progress.stopped and scene.arming is not None and scene.arming.armed
    if leg.kind is LegKind.STOP:
        return progress, armed_again
    if leg.kind is LegKind.HOLD_STATION:
        progress = _on_station(progress, leg, scene, config)
        if progress.arrived_us is None:
            return _joined(progress, leg, scene), False
        if _waits_for_operator(leg):
            return progress, armed_again
        return progress, (scene.sim_us - progress.arrived_us) * 1e-6 >= leg.duration_s
    progress = _joined(progress, leg, scene)
    if not scene.straight:
        return progress, False
    if leg.kind is LegKind.RETURN_HOME:
        return progress, _is_home(progress, leg, scene.position_m, config)
    return _advance(progress, leg, scene.position_m, config)


def _joined(progress: Progress, leg: MissionLeg, scene: Scene) -> Progress:
    """With a waypoint to steer for."""
    track = _track(leg, progress)
    if progress.target is not None or track is None:
        return progress
    return msgspec.structs.replace(progress, target=first_target(track, scene.position_m))


def _advance(progress: Progress, leg: MissionLeg, position_m: Point, config: NavigatorConfig) -> tuple[Progress, bool]:
    """Count the waypoints reached."""
    track = _track(leg, progress)
    assert track is not None
    target, reached = progress.target or 0, progress.reached
    last, ended = len(track.waypoints) - 1, False
    for _ in track.waypoints:
        if ended or not is_reached(track, target, position_m, config):
            break
        reached += 1
        laps = (reached - progress.reached_before) // (last + 1)
        ended = 0 < leg.laps <= laps if track.repeat else target == last
        target = (target + 1) % (last + 1)
    return msgspec.structs.replace(progress, target=target, reached=reached), ended


def _is_home(progress: Progress, leg: MissionLeg, position_m: Point, config: NavigatorConfig) -> bool:
    track, home = _track(leg, progress), _place(leg, progress)
    if track is not None:
        return is_reached(track, len(track.waypoints) - 1, position_m, config)
    return home is not None and math.dist(position_m, (home.x_m, home.y_m)) <= config.acceptance_m


def _on_station(progress: Progress, leg: MissionLeg, scene: Scene, config: NavigatorConfig) -> Progress:
    """Arrived within the radius; adrift from beyond it until well inside again."""
    place = _place(leg, progress)
    if place is None or not scene.free:
        return progress
    away_m = math.dist(scene.position_m, (place.x_m, place.y_m))
    if progress.arrived_us is None:
        return msgspec.structs.replace(progress, arrived_us=scene.sim_us) if away_m <= leg.radius_m else progress
    limit_m = leg.radius_m * (config.station_inner_frac if progress.adrift else 1.0)
    return msgspec.structs.replace(progress, adrift=away_m > limit_m)


def _heard_operator(progress: Progress, arming: Arming | None) -> Progress:
    """A STOP counts when the same run of the operator's process had armed the boat: its restart is no word."""
    if arming is None:
        return progress
    if arming.armed and not arming.stopped:
        return msgspec.structs.replace(progress, armed_epoch=arming.epoch)
    if arming.epoch == progress.armed_epoch:
        return msgspec.structs.replace(progress, stopped=True)
    return progress


def _waits_for_operator(leg: MissionLeg) -> bool:
    return leg.kind is LegKind.STOP or (leg.kind is LegKind.HOLD_STATION and leg.duration_s == 0.0)


def _place(leg: MissionLeg, progress: Progress) -> Waypoint | None:
    """The station or home; None while it is unknown."""
    if leg.waypoints:
        return leg.waypoints[0]
    return progress.home if leg.kind is LegKind.RETURN_HOME else progress.began


def _track(leg: MissionLeg, progress: Progress) -> Track | None:
    """The line of the leg: its own, or the straight one from where it began to its place."""
    if leg.kind is LegKind.FOLLOW_ROUTE:
        return Track(leg.waypoints, leg.repeat)
    place, began = _place(leg, progress), progress.began
    if place is None or began is None:
        return None
    if math.dist((began.x_m, began.y_m), (place.x_m, place.y_m)) < MIN_LEG_M:
        return None
    return Track((began, place))
