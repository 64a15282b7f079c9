"""The boat's state as MAVLink messages. Pure.

A builder gives None where what it reports is not known now: a stale value is never sent again. A single field that is
not known has the protocol's own value for that. Positions are WGS 84; frames are north, east, down and forward, right,
down. The surface of the water is altitude 0: the boat does not know its height.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import Any

from paani import messages as m
from paani.geometry import geodetic_from_enu, quaternion
from paani.map_origin import map_origin_deg
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import (
    I16_MAX,
    U8_MAX,
    U16_MAX,
    U32_MAX,
    degrees_e7,
    heading_centidegrees,
    i16,
    to_int,
)
from paani_services.mavlink.health_bits import sys_status
from paani_services.mavlink.obstacles import collision, obstacle_distance
from paani_services.mavlink.rover_modes import mode_of
from paani_services.mavlink.snapshot import Snapshot, attitude_rad, velocity_mps

NAN = math.nan
CUSTOM_MODE = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)
CELLS = 10  # fields of BATTERY_STATUS for voltages; a battery that is measured as a whole has the first
MIN_LINE_V = 1e-3  # a microcontroller that measures no battery says 0


def heartbeat(snapshot: Snapshot) -> Any:
    """A surface boat that looks to ground stations like an ArduPilot rover: they name its modes right."""
    operator = snapshot.operator
    state = dialect.MAV_STATE_ACTIVE if snapshot.is_armed else dialect.MAV_STATE_STANDBY
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_SURFACE_BOAT,
        dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
        CUSTOM_MODE | (ARMED if snapshot.is_armed else 0),
        mode_of(snapshot),
        dialect.MAV_STATE_UNINIT if operator is None else state,
        3,
    )


def system_time(snapshot: Snapshot) -> Any:
    return dialect.MAVLink_system_time_message(snapshot.now_us, snapshot.boot_ms)


def battery_status(snapshot: Snapshot) -> Any | None:
    """The battery that the microcontroller of a hull measures."""
    thrusters = snapshot.thrusters
    if thrusters is None or thrusters.battery_v < MIN_LINE_V:
        return None
    voltages = [to_int(thrusters.battery_v * 1e3, 0, U16_MAX - 1), *[U16_MAX] * (CELLS - 1)]
    is_low = m.ThrustHold.BATTERY_LOW in thrusters.holds
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_UNKNOWN,
        I16_MAX,
        voltages,
        i16(thrusters.current_a * 100.0),
        -1,
        -1,
        -1,
        charge_state=dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL if is_low else dialect.MAV_BATTERY_CHARGE_STATE_OK,
    )


def extended_sys_state(_: Snapshot) -> Any:
    """A boat neither flies nor lands."""
    return dialect.MAVLink_extended_sys_state_message(
        dialect.MAV_VTOL_STATE_UNDEFINED, dialect.MAV_LANDED_STATE_UNDEFINED
    )


def gps_raw_int(snapshot: Snapshot) -> Any:
    """What the receiver says; a fix of two dimensions, as nobody asks it for a height."""
    fix = snapshot.fix
    if fix is None or not fix.fix:
        kind = dialect.GPS_FIX_TYPE_NO_GPS if fix is None else dialect.GPS_FIX_TYPE_NO_FIX
        return dialect.MAVLink_gps_raw_int_message(
            0 if fix is None else fix.source_us, kind, 0, 0, 0, U16_MAX, U16_MAX, U16_MAX, U16_MAX, U8_MAX
        )
    return dialect.MAVLink_gps_raw_int_message(
        fix.source_us,
        dialect.GPS_FIX_TYPE_2D_FIX,
        degrees_e7(fix.latitude_deg),
        degrees_e7(fix.longitude_deg),
        0,
        U16_MAX,
        U16_MAX,
        to_int(fix.sog_mps * 100.0, 0, U16_MAX - 1),
        heading_centidegrees(fix.cog_rad),
        U8_MAX,
        h_acc=to_int(fix.position_std_m * 1e3, 0, U32_MAX),
    )


def global_position_int(snapshot: Snapshot) -> Any | None:
    pose = snapshot.pose
    if pose is None:
        return None
    east_mps, north_mps = velocity_mps(pose)
    return dialect.MAVLink_global_position_int_message(
        snapshot.boot_ms,
        degrees_e7(pose.latitude_deg),
        degrees_e7(pose.longitude_deg),
        0,
        0,
        i16(north_mps * 100.0),
        i16(east_mps * 100.0),
        0,
        heading_centidegrees(pose.yaw_rad),
    )


def local_position_ned(snapshot: Snapshot) -> Any | None:
    pose = snapshot.pose
    if pose is None:
        return None
    east_mps, north_mps = velocity_mps(pose)
    return dialect.MAVLink_local_position_ned_message(
        snapshot.boot_ms, pose.y_m, pose.x_m, 0.0, north_mps, east_mps, 0.0
    )


def attitude(snapshot: Snapshot) -> Any | None:
    """Roll and pitch rates are not estimated."""
    pose = snapshot.pose
    if pose is None:
        return None
    return dialect.MAVLink_attitude_message(snapshot.boot_ms, *attitude_rad(pose), NAN, NAN, -pose.yaw_rate_radps)


def attitude_quaternion(snapshot: Snapshot) -> Any | None:
    pose = snapshot.pose
    if pose is None:
        return None
    turn = quaternion(*attitude_rad(pose))
    return dialect.MAVLink_attitude_quaternion_message(
        snapshot.boot_ms,
        turn["w"],
        turn["x"],
        turn["y"],
        turn["z"],
        NAN,
        NAN,
        -pose.yaw_rate_radps,
    )


def vfr_hud(snapshot: Snapshot) -> Any | None:
    """Speed over ground, heading, and the mean of both thrusters; there is no airspeed."""
    pose, applied = snapshot.pose, snapshot.applied
    if pose is None:
        return None
    thrust = 0.0 if applied is None else 0.5 * abs(applied.left + applied.right)
    heading_deg = heading_centidegrees(pose.yaw_rad) // 100
    return dialect.MAVLink_vfr_hud_message(
        NAN, math.hypot(pose.surge_mps, pose.sway_mps), heading_deg, to_int(thrust * 100.0, 0, 100), 0.0, 0.0
    )


def home_position(snapshot: Snapshot) -> Any | None:
    """Where the boat would return to; attitude and approach are not known."""
    pose, prediction = snapshot.pose, snapshot.prediction
    if pose is None or prediction is None or not prediction.home:
        return None
    home = prediction.home[0]
    latitude_deg, longitude_deg = geodetic_from_enu(home.x_m, home.y_m, *map_origin_deg(pose))
    return dialect.MAVLink_home_position_message(
        degrees_e7(latitude_deg), degrees_e7(longitude_deg), 0, home.y_m, home.x_m, 0.0, [NAN] * 4, NAN, NAN, NAN,
        snapshot.now_us,
    )  # fmt: skip


def gps_global_origin(snapshot: Snapshot) -> Any | None:
    if snapshot.pose is None:
        return None
    latitude_deg, longitude_deg = map_origin_deg(snapshot.pose)
    return dialect.MAVLink_gps_global_origin_message(
        degrees_e7(latitude_deg), degrees_e7(longitude_deg), 0, snapshot.now_us
    )


def nav_controller_output(snapshot: Snapshot) -> Any | None:
    """The heading that is ordered, how far the waypoint is, and the leg's line, positive where that is to starboard."""
    command = snapshot.command
    if command is None or not command.enable:
        return None
    bearing_deg = round(heading_centidegrees(command.heading_rad) / 100.0) % 360
    return dialect.MAVLink_nav_controller_output_message(
        NAN, NAN, bearing_deg, bearing_deg, _waypoint_distance_m(snapshot, command), NAN, NAN, -command.cross_track_m
    )


def _waypoint_distance_m(snapshot: Snapshot, command: m.NavCommand) -> int:
    """How far the waypoint is that is steered for; `U16_MAX` where there is none, or no pose."""
    legs = snapshot.legs or ()
    waypoints = legs[command.leg_index].waypoints if command.leg_index < len(legs) else ()
    if snapshot.pose is None or command.waypoint_index >= len(waypoints):
        return U16_MAX
    point = waypoints[command.waypoint_index]
    return min(round(math.hypot(point.x_m - snapshot.pose.x_m, point.y_m - snapshot.pose.y_m)), U16_MAX - 1)


def autopilot_version(_: Snapshot) -> Any:
    """The release of PAANI as that of the flight software, and what of the protocol is spoken."""
    major, minor, patch = (int(part) for part in version("paani").split(".")[:3])
    release = major << 24 | minor << 16 | patch << 8
    none = [0] * 8
    return dialect.MAVLink_autopilot_version_message(
        CAPABILITIES, release, 0, 0, 0, none, none, none, 0, 0, int.from_bytes(_digest("paani")[:7], "big")
    )


def _digest(text: str) -> bytes:
    return hashlib.sha256(text.encode()).digest()


BUILDERS: Mapping[int, Callable[[Snapshot], Any | None]] = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    dialect.MAVLINK_MSG_ID_ATTITUDE: attitude,
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    dialect.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    dialect.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: nav_controller_output,
    dialect.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: obstacle_distance,
    dialect.MAVLINK_MSG_ID_COLLISION: collision,
    dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}
