"""Mission execution: which leg is due, when it ends, and the course and speed it asks for. Pure: values in, values out.

Legs follow each other in the order of the mission. A leg that waits for the operator ends when the boat is stopped
and armed again.
"""

import math
from typing import NamedTuple

import msgspec

from paani.config import NavigatorConfig
from paani.fence_geometry import Point
from paani.messages import Arming, Inhibit, LegKind, Mission, MissionLeg, Odometry, Waypoint
from paani.missions import MIN_LEG_M
from paani_services.navigator.guidance.ilos import IlosState, integral_offset_m
from paani_services.navigator.guidance.path_progress import (
    WaypointPath,
    bearing_rad,
    cross_track_error_m,
    is_waypoint_reached,
    line_of_sight_course_rad,
    nearest_leg,
)


class MissionProgress(
    msgspec.Struct,
    frozen=True,
    rename={
        "leg_index": "leg",
        "waypoints_reached": "reached",
        "waypoints_reached_before": "reached_before",
        "leg_start": "began",
        "is_off_station": "adrift",
        "was_stopped": "stopped",
    },
):
    """How far the mission has come. It is recorded and kept on disk under the field names given by `rename`.

    `leg_index`: the leg that is due; the number of legs when all are done. `waypoints_reached`: of all legs;
    `waypoints_reached_before`: of the legs before this one. `home`: that of the mission, else where the
    boat was first free to move. Of the leg that is due:
    `target`: index of the waypoint steered for, None before the first. `leg_start`: where the leg began.
    `arrived_us`: when the boat first was on station [us of simulated time]. `is_off_station`: it has left the station
    since and is on its way back. `armed_epoch`: the run of the operator's process that last armed the boat.
    `was_stopped`: that run of the process has stopped it since.
    """

    leg_index: int = 0
    target: int | None = None
    waypoints_reached: int = 0
    waypoints_reached_before: int = 0
    home: Waypoint | None = None
    leg_start: Waypoint | None = None
    arrived_us: int | None = None
    is_off_station: bool = False
    armed_epoch: int | None = None
    was_stopped: bool = False


class MissionInputs(NamedTuple):
    """What one step of the mission depends on.

    `is_free`: no inhibit forbids motion. `is_straight`: and the boat steers for its path, not a visual turn.
    """

    odometry: Odometry
    arming: Arming | None
    sim_us: int
    is_free: bool
    is_straight: bool

    @property
    def position_m(self) -> Point:
        return self.odometry.x_m, self.odometry.y_m


class LegSetpoint(NamedTuple):
    """Course and greatest speed that the leg asks for, unless `inhibit` says why the boat shall not move.

    `path` is followed towards its waypoint `target`; None: straight to a point.
    """

    inhibit: Inhibit | None = None
    course_rad: float = 0.0
    speed_mps: float = 0.0
    cross_track_m: float = 0.0
    path: WaypointPath | None = None
    target: int = 0


def is_mission_done(progress: MissionProgress, mission: Mission) -> bool:
    """Whether no leg is left."""
    return progress.leg_index >= len(mission.legs)


def advance_mission(
    progress: MissionProgress, mission: Mission, inputs: MissionInputs, config: NavigatorConfig
) -> MissionProgress:
    """One step: note home, waypoints reached, time on station and the operator's stop; begin the next leg if due.

    A leg begins once the boat is free to move. Waypoints count only while the boat steers for its path, so a visual
    turn keeps its waypoint (M1, M3).
    """
    here = Waypoint(x_m=inputs.odometry.x_m, y_m=inputs.odometry.y_m)
    if mission.home:
        progress = msgspec.structs.replace(progress, home=mission.home[0])
    elif progress.home is None and inputs.is_free:
        progress = msgspec.structs.replace(progress, home=here)
    for _ in mission.legs:
        if is_mission_done(progress, mission) or (progress.leg_start is None and not inputs.is_free):
            break
        if progress.leg_start is None:
            progress = msgspec.structs.replace(progress, leg_start=here)
        leg = mission.legs[progress.leg_index]
        progress, has_ended = _advance_leg(_note_operator_stop(progress, inputs.arming), leg, inputs, config)
        if not has_ended:
            break
        progress = MissionProgress(
            leg_index=progress.leg_index + 1,
            waypoints_reached=progress.waypoints_reached,
            waypoints_reached_before=progress.waypoints_reached,
            home=progress.home,
        )
    return progress


def compute_leg_setpoint(
    progress: MissionProgress, mission: Mission, ilos: IlosState, position_m: Point, config: NavigatorConfig
) -> LegSetpoint:
    """Course and speed of the leg that is due, from this position."""
    if is_mission_done(progress, mission):
        is_route_alone = len(mission.legs) == 1 and mission.legs[0].kind is LegKind.FOLLOW_ROUTE
        return LegSetpoint(Inhibit.ROUTE_FINISHED if is_route_alone else Inhibit.MISSION_DONE)
    leg = mission.legs[progress.leg_index]
    speed_mps = min(leg.speed_mps or config.cruise_mps, config.cruise_mps)
    destination = _destination(leg, progress)
    if leg.kind is LegKind.STOP or (destination is None and leg.kind is not LegKind.FOLLOW_ROUTE):
        return LegSetpoint(Inhibit.HOLDING)
    if leg.kind is LegKind.HOLD_STATION and destination is not None and progress.arrived_us is not None:
        if not progress.is_off_station:
            return LegSetpoint(Inhibit.HOLDING)
        return LegSetpoint(None, bearing_rad(position_m, destination), speed_mps * config.station_speed_frac)
    path = _leg_path(leg, progress)
    if path is None:
        if destination is None:
            return LegSetpoint(Inhibit.HOLDING)
        return LegSetpoint(None, bearing_rad(position_m, destination), speed_mps)
    target = progress.target or 0
    offset_m = integral_offset_m(ilos, path, target)
    return LegSetpoint(
        None,
        line_of_sight_course_rad(path, target, position_m, config.lookahead_m, offset_m),
        speed_mps,
        cross_track_error_m(path, target, position_m),
        path,
        target,
    )


def describe_leg(progress: MissionProgress, mission: Mission) -> str:
    """The leg that is due, in words for people."""
    if is_mission_done(progress, mission):
        return "done"
    leg = mission.legs[progress.leg_index]
    text = leg.kind.replace("_", " ")
    if leg.kind is LegKind.FOLLOW_ROUTE and leg.repeat:
        lap = (progress.waypoints_reached - progress.waypoints_reached_before) // len(leg.waypoints) + 1
        text += f", lap {lap}" + (f" of {leg.laps}" if leg.laps else "")
    if _is_ended_by_operator(leg):
        text += ", until stopped and armed again"
    return text


def _advance_leg(
    progress: MissionProgress, leg: MissionLeg, inputs: MissionInputs, config: NavigatorConfig
) -> tuple[MissionProgress, bool]:
    """One step of the leg that is due, and whether it has ended."""
    arming = inputs.arming
    is_armed_again = progress.was_stopped and arming is not None and arming.armed and not arming.stopped
    if leg.kind is LegKind.STOP:
        return progress, is_armed_again
    if leg.kind is LegKind.HOLD_STATION:
        progress = _update_station(progress, leg, inputs, config)
        if progress.arrived_us is None:
            return _select_target(progress, leg, inputs), False
        if _is_ended_by_operator(leg):
            return progress, is_armed_again
        return progress, (inputs.sim_us - progress.arrived_us) * 1e-6 >= leg.duration_s
    progress = _select_target(progress, leg, inputs)
    if not inputs.is_straight:
        return progress, False
    if leg.kind is LegKind.RETURN_HOME:
        return progress, _is_at_home(progress, leg, inputs.position_m, config)
    return _count_waypoints(progress, leg, inputs.position_m, config)


def _select_target(progress: MissionProgress, leg: MissionLeg, inputs: MissionInputs) -> MissionProgress:
    """Choose the first waypoint to steer for, if none is chosen yet."""
    path = _leg_path(leg, progress)
    if progress.target is not None or path is None:
        return progress
    return msgspec.structs.replace(progress, target=nearest_leg(path, inputs.position_m))


def _count_waypoints(
    progress: MissionProgress, leg: MissionLeg, position_m: Point, config: NavigatorConfig
) -> tuple[MissionProgress, bool]:
    """Count the waypoints that the boat has reached, and say whether the route or its last lap is complete."""
    path = _leg_path(leg, progress)
    assert path is not None
    target, reached = progress.target or 0, progress.waypoints_reached
    last, has_ended = len(path.waypoints) - 1, False
    for _ in path.waypoints:
        if has_ended or not is_waypoint_reached(path, target, position_m, config):
            break
        reached += 1
        laps = (reached - progress.waypoints_reached_before) // (last + 1)
        has_ended = 0 < leg.laps <= laps if path.repeat else target == last
        target = (target + 1) % (last + 1)
    return msgspec.structs.replace(progress, target=target, waypoints_reached=reached), has_ended


def _is_at_home(progress: MissionProgress, leg: MissionLeg, position_m: Point, config: NavigatorConfig) -> bool:
    path, home = _leg_path(leg, progress), _destination(leg, progress)
    if path is not None:
        return is_waypoint_reached(path, len(path.waypoints) - 1, position_m, config)
    return home is not None and math.dist(position_m, (home.x_m, home.y_m)) <= config.acceptance_m


def _update_station(
    progress: MissionProgress, leg: MissionLeg, inputs: MissionInputs, config: NavigatorConfig
) -> MissionProgress:
    """Note the arrival within the radius, and whether the boat is beyond it (until well inside: a hysteresis)."""
    station = _destination(leg, progress)
    if station is None or not inputs.is_free:
        return progress
    distance_m = math.dist(inputs.position_m, (station.x_m, station.y_m))
    if progress.arrived_us is None:
        return msgspec.structs.replace(progress, arrived_us=inputs.sim_us) if distance_m <= leg.radius_m else progress
    limit_m = leg.radius_m * (config.station_inner_frac if progress.is_off_station else 1.0)
    return msgspec.structs.replace(progress, is_off_station=distance_m > limit_m)


def _note_operator_stop(progress: MissionProgress, arming: Arming | None) -> MissionProgress:
    """Note a stop by the run of the operator's process that armed the boat; that process restarting is no stop."""
    if arming is None:
        return progress
    if arming.armed and not arming.stopped:
        return msgspec.structs.replace(progress, armed_epoch=arming.epoch)
    if arming.epoch == progress.armed_epoch:
        return msgspec.structs.replace(progress, was_stopped=True)
    return progress


def _is_ended_by_operator(leg: MissionLeg) -> bool:
    return leg.kind is LegKind.STOP or (leg.kind is LegKind.HOLD_STATION and leg.duration_s == 0.0)


def _destination(leg: MissionLeg, progress: MissionProgress) -> Waypoint | None:
    """The station, or home; None while home is unknown. Of a leg that follows a route, its first waypoint."""
    if leg.waypoints:
        return leg.waypoints[0]
    return progress.home if leg.kind is LegKind.RETURN_HOME else progress.leg_start


def _leg_path(leg: MissionLeg, progress: MissionProgress) -> WaypointPath | None:
    """The route of the leg, or the straight line from where the leg began to its destination; None if too short."""
    if leg.kind is LegKind.FOLLOW_ROUTE:
        return WaypointPath(leg.waypoints, leg.repeat)
    destination, start = _destination(leg, progress), progress.leg_start
    if destination is None or start is None:
        return None
    if math.dist((start.x_m, start.y_m), (destination.x_m, destination.y_m)) < MIN_LEG_M:
        return None
    return WaypointPath((start, destination))
