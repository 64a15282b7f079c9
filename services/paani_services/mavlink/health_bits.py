"""SYS_STATUS: which parts of the boat are there, and which are in order. Pure.

A bit of `health` is set by fresh and healthy messages alone.
"""

from __future__ import annotations

from typing import Any

from paani import messages as m
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import U16_MAX, i16, to_int
from paani_services.mavlink.snapshot import Snapshot

INERTIAL = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
HEADING = dialect.MAV_SYS_STATUS_SENSOR_3D_MAG  # ground stations ask this bit whether the heading is known
GPS = dialect.MAV_SYS_STATUS_SENSOR_GPS
CAMERA = dialect.MAV_SYS_STATUS_SENSOR_VISION_POSITION
STEERING = dialect.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
THRUSTERS = dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
FENCE = dialect.MAV_SYS_STATUS_GEOFENCE
ESTIMATE = dialect.MAV_SYS_STATUS_AHRS
RECORDER = dialect.MAV_SYS_STATUS_LOGGING
BATTERY = dialect.MAV_SYS_STATUS_SENSOR_BATTERY
PREARM = dialect.MAV_SYS_STATUS_PREARM_CHECK
AVOIDANCE = dialect.MAV_SYS_STATUS_OBSTACLE_AVOIDANCE
ALWAYS = INERTIAL | HEADING | GPS | CAMERA | STEERING | THRUSTERS | FENCE | ESTIMATE | PREARM | AVOIDANCE

# Faults of what the boat moves by: it is not armed with any of these. Other inhibits come and go on a boat in order.
FAULTS = frozenset(
    {
        m.Inhibit.NO_CLOCK,
        m.Inhibit.CLOCK_STOPPED,
        m.Inhibit.NO_ODOMETRY,
        m.Inhibit.STALE_ODOMETRY,
        m.Inhibit.UNHEALTHY_ODOMETRY,
        m.Inhibit.MAP_MOVED,
        m.Inhibit.NO_ADVISORY,
        m.Inhibit.STALE_ADVISORY,
        m.Inhibit.ADVISED_NO_DATA,
        m.Inhibit.NO_ROUTE,
        m.Inhibit.OUTSIDE_FENCE,
        m.Inhibit.WRONG_DOMAIN,
        m.Inhibit.COMMAND_INVALID,
        m.Inhibit.NO_ORDER,
        m.Inhibit.STALE_ORDER,
    }
)
# Why the thrust adapter applies zero while all of it is in order.
WAITING = frozenset({m.ZeroCause.NONE, m.ZeroCause.NOT_ENABLED, m.ZeroCause.NOT_ARMED, m.ZeroCause.REARM})


def prearm_faults(snapshot: Snapshot) -> tuple[str, ...]:
    """What is not in order for arming, by short names, the most telling first; a latched STOP is not among it."""
    found = []
    if snapshot.operator is None:
        found.append("operator silent")
    if snapshot.command is None:
        found.append("navigator silent")
    else:
        found += [inhibit.value for inhibit in snapshot.command.inhibits if inhibit in FAULTS]
    if snapshot.applied is None:
        found.append("thrust adapter silent")
    elif snapshot.applied.zero_cause not in WAITING:
        found.append(snapshot.applied.zero_cause.value)
    return tuple(found)


def is_armable(snapshot: Snapshot) -> bool:
    """Whether arming would be taken: nothing is at fault, and no STOP is latched."""
    return not prearm_faults(snapshot) and snapshot.operator is not None and not snapshot.operator.stopped


def healthy_bits(snapshot: Snapshot) -> int:
    """The bits of what is in order now."""
    command, advisory, applied = snapshot.command, snapshot.advisory, snapshot.applied
    inhibits = command.inhibits if command is not None else ()
    is_seeing = advisory is not None and advisory.direction is not m.Direction.NO_DATA
    conditions = {
        INERTIAL: snapshot.inertial is not None and snapshot.inertial.healthy,
        HEADING | ESTIMATE: snapshot.pose is not None,
        GPS: snapshot.fix is not None and snapshot.fix.fix,
        CAMERA: is_seeing and advisory is not None and advisory.reason is not m.Reason.UNUSABLE_IMAGE,
        AVOIDANCE: is_seeing,
        STEERING: command is not None,
        THRUSTERS: applied is not None and applied.zero_cause in WAITING,
        FENCE: command is not None and m.Inhibit.OUTSIDE_FENCE not in inhibits,
        RECORDER: snapshot.recorder is not None and snapshot.recorder.recording,
        BATTERY: has_battery(snapshot) and not _is_battery_low(snapshot),
        PREARM: is_armable(snapshot) or (snapshot.is_armed and not prearm_faults(snapshot)),
    }
    return sum(bits for bits, is_true in conditions.items() if is_true)


def has_battery(snapshot: Snapshot) -> bool:
    """Whether the microcontroller measures one."""
    return snapshot.thrusters is not None and snapshot.thrusters.battery_v > 0.0


def sys_status(snapshot: Snapshot) -> Any:
    """Load and errors of the link are not measured: they are 0."""
    present = ALWAYS | (RECORDER if snapshot.recorder is not None else 0) | (BATTERY if has_battery(snapshot) else 0)
    enabled = present if snapshot.fence else present & ~FENCE
    volts_mv, current_ca = U16_MAX, -1
    if snapshot.thrusters is not None and has_battery(snapshot):
        volts_mv = to_int(snapshot.thrusters.battery_v * 1e3, 0, U16_MAX - 1)
        current_ca = i16(snapshot.thrusters.current_a * 100.0)
    return dialect.MAVLink_sys_status_message(
        present, enabled, healthy_bits(snapshot) & present, 0, volts_mv, current_ca, -1, 0, 0, 0, 0, 0, 0
    )


def _is_battery_low(snapshot: Snapshot) -> bool:
    return snapshot.thrusters is not None and m.ThrustHold.BATTERY_LOW in snapshot.thrusters.holds
