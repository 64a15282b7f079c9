"""What a filter says of the boat, as the message that is published. Pure."""

import math

import msgspec

from paani.config import LocalizationConfig
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.levelling import level_sample
from paani_services.localization.planar_filter import PSI, PX, PY, B, PlanarFilter

MIN_YAW_STD_RAD = 0.02  # published at least: no compass is mounted better


def odometry_of(source: PlanarFilter, last: ImuSample | None, now_us: int, *, healthy: bool, stopped: bool) -> Odometry:
    """Odometry of a filter at its newest IMU sample; unhealthy where a number of it is not finite."""
    x, std = source.x.tolist(), source.std.tolist()
    vx_mps, vy_mps = source.velocity
    sin, cos = math.sin(x[PSI]), math.cos(x[PSI])
    major_std_m, major_rad = error_ellipse(
        source.covariance[PX, PX], source.covariance[PX, PY], source.covariance[PY, PY]
    )
    tilted = last is not None and last.orientation_available
    return Odometry(
        source_us=last.source_us if last else now_us,
        x_m=x[PX],
        y_m=x[PY],
        yaw_rad=x[PSI],
        surge_mps=vx_mps * cos + vy_mps * sin,
        sway_mps=vy_mps * cos - vx_mps * sin,
        yaw_rate_radps=level_sample(last).yaw_rate_radps - x[B] if last else 0.0,
        position_std_m=math.hypot(std[PX], std[PY]) / math.sqrt(2.0),
        yaw_std_rad=max(std[PSI], MIN_YAW_STD_RAD),
        healthy=healthy and all(map(math.isfinite, x + std)),
        stopped=stopped,
        roll_rad=last.roll_rad if last and tilted else 0.0,
        pitch_rad=last.pitch_rad if last and tilted else 0.0,
        position_major_std_m=major_std_m,
        position_major_rad=major_rad,
    )


def error_ellipse(xx_m2: float, xy_m2: float, yy_m2: float) -> tuple[float, float]:
    """Longer half axis [m] and its direction [rad] of the ellipse of one standard deviation of a covariance."""
    spread_m2 = math.hypot(0.5 * (xx_m2 - yy_m2), xy_m2)
    return math.sqrt(max(0.5 * (xx_m2 + yy_m2) + spread_m2, 0.0)), 0.5 * math.atan2(2.0 * xy_m2, xx_m2 - yy_m2)


def with_position_std(odometry: Odometry, position_std_m: float) -> Odometry:
    """The odometry with a larger error, which grows alike in all directions."""
    added_m2 = position_std_m**2 - odometry.position_std_m**2
    major_std_m = math.sqrt(max(odometry.position_major_std_m**2 + added_m2, 0.0))
    return msgspec.structs.replace(odometry, position_std_m=position_std_m, position_major_std_m=major_std_m)


def unknown_odometry(now_us: int) -> Odometry:
    """Odometry of a boat that nothing is known of: unhealthy."""
    return Odometry(source_us=now_us, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0)


def is_fresh(message: ImuSample | GpsFix | None, limit_s: float, now_us: int) -> bool:
    """Whether there is a message, and it is no older than the limit."""
    return message is not None and (now_us - message.source_us) * 1e-6 <= limit_s


class StoppedFlag:
    """Whether the boat has been slower than `stopped_speed_mps` for `stopped_after_s` (L5)."""

    def __init__(self, config: LocalizationConfig) -> None:
        self._config = config
        self._slow_since_us: int | None = None

    def note_speed(self, source: PlanarFilter | None, now_us: int) -> None:
        """Note the estimated speed now; None where there is no estimate."""
        if source is None or math.hypot(*source.velocity) > self._config.stopped_speed_mps:
            self._slow_since_us = None
        elif self._slow_since_us is None:
            self._slow_since_us = now_us

    def is_set(self, now_us: int) -> bool:
        since_us = self._slow_since_us
        return since_us is not None and (now_us - since_us) * 1e-6 >= self._config.stopped_after_s
