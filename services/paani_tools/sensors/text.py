"""The devices of a hull as lines of text. Pure."""

from __future__ import annotations

import math

from paani.geometry import heading_true_deg
from paani.messages import GpsFix, ImuSample, SensorDevice, SensorRole, SensorStatus

NEVER_S = 1e5  # an age above this means that nothing came


def device_line(device: SensorDevice, fix: GpsFix | None, sample: ImuSample | None) -> str:
    """One device in one line: status, what it says, how often and how old, and what is missing."""
    words = [f"{device.role:<8}{device.status.replace('_', ' '):<12}"]
    if device.status is SensorStatus.OFF:
        return f"{words[0]}sensors.{device.role}.line is not set"
    if device.status in {SensorStatus.OK, SensorStatus.NO_FIX}:
        words.append(_value(device.role, fix, sample))
    words += [f"{device.rate_hz:.1f} Hz", _age(device.age_s)]
    counts = (
        ("checksum", device.checksum_failures),
        ("damaged", device.damaged),
        ("withheld", device.withheld),
        ("reconnected", device.reconnections),
    )
    words += [f"{name} {count}" for name, count in counts if count]
    if device.note:
        words.append(device.note)
    words.append(f"[{device.line}{': ' + device.heard if device.heard else ''}]")
    return "  ".join(word for word in words if word)


def missing(devices: tuple[SensorDevice, ...], sample: ImuSample | None) -> str:
    """What the boat lacks to know where it is, in one line; "" for nothing."""
    status = {device.role: device.status for device in devices}
    lacks = [f"{role} ({status[role]})" for role in (SensorRole.GPS, SensorRole.IMU) if status[role] != SensorStatus.OK]
    if status[SensorRole.IMU] is SensorStatus.OK and (sample is None or not sample.orientation_available):
        lacks.append("a heading: the boat stays stopped without one")
    return f"missing: {', '.join(lacks)}" if lacks else ""


def _value(role: SensorRole, fix: GpsFix | None, sample: ImuSample | None) -> str:
    match role:
        case SensorRole.GPS if fix is not None:
            return (
                f"{fix.latitude_deg:.6f} {fix.longitude_deg:.6f} +-{fix.position_std_m:.1f} m, {fix.sog_mps:.2f} m/s"
                f" to {heading_true_deg(fix.cog_rad):.0f} deg"
            )
        case SensorRole.IMU if sample is not None:
            force_mps2 = math.hypot(sample.accel_x_mps2, sample.accel_y_mps2, sample.accel_z_mps2)
            return f"{force_mps2:.2f} m/s^2, turning {math.degrees(sample.gyro_z_radps):.1f} deg/s to port"
        case SensorRole.HEADING if sample is not None and sample.orientation_available:
            return f"heading {heading_true_deg(sample.yaw_rad):.1f} deg true"
    return ""


def _age(age_s: float) -> str:
    return "never" if age_s > NEVER_S else f"{age_s:.1f} s ago"
