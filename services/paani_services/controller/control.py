"""From an ordered heading and speed to the thrust of two fans. Pure: no clock, no bus, no logging."""

import math

import msgspec

from paani.config import ControllerConfig
from paani.geometry import clip, wrap_rad
from paani.messages import Inhibit, NavCommand, Odometry, Thrust

MAP_FRAME = "map"
STANDSTILL_ORDER_MPS = 0.01  # an order below it asks for no way on
MAX_STEP_S = 0.3  # a longer gap since the last call counts as this long


class ControlState(msgspec.Struct, frozen=True):
    """What one call leaves for the next: integral of the speed error [units of thrust], last thrust."""

    integral: float = 0.0
    left: float = 0.0
    right: float = 0.0
    last_us: int = 0


class Heard(msgspec.Struct, frozen=True):
    """The newest messages, and when they came [us]."""

    command: NavCommand | None = None
    command_us: int = 0
    odometry: Odometry | None = None
    odometry_us: int = 0


def control(
    state: ControlState, heard: Heard, now_us: int, domain: int, config: ControllerConfig
) -> tuple[ControlState, Thrust]:
    """One step: P + feed-forward speed, PD heading, mix, saturation, no more astern than `astern`, slew (N7).

    Anything missing, stale, invalid or disabled gives zero thrust at once, never slewed, and
    clears the state. The command's `source_us` and `echo_us` pass through.
    """
    inhibits = inhibits_of(heard, now_us, domain, config)
    command, odometry = heard.command, heard.odometry
    if command is None or odometry is None or inhibits:
        return ControlState(), Thrust(
            source_us=command.source_us if command else now_us,
            left=0.0,
            right=0.0,
            enabled=False,
            echo_us=command.echo_us if command else 0,
            inhibits=inhibits,
            command_sent_us=command.sent_us if command else 0,
        )

    step_s = 1.0 / config.rate_hz
    if state.last_us:
        step_s = clip((now_us - state.last_us) * 1e-6, 0.0, MAX_STEP_S)

    speed_error_mps, forward, integral = _speed(state.integral, command, odometry, step_s, config)
    heading_error_rad = wrap_rad(command.heading_rad - odometry.yaw_rad)
    steer = clip(
        config.heading_kp * heading_error_rad - config.heading_kd * odometry.yaw_rate_radps,
        -config.max_steer,
        config.max_steer,
    )
    left, right = (
        _slew(last, clip(wanted, 0.0 - config.astern, 1.0), config.slew_per_s * step_s)
        for last, wanted in ((state.left, forward - steer), (state.right, forward + steer))
    )
    return ControlState(integral, left, right, now_us), Thrust(
        source_us=command.source_us,
        left=left,
        right=right,
        enabled=True,
        echo_us=command.echo_us,
        speed_error_mps=speed_error_mps,
        heading_error_rad=heading_error_rad,
        command_sent_us=command.sent_us,
    )


def inhibits_of(heard: Heard, now_us: int, domain: int, config: ControllerConfig) -> tuple[Inhibit, ...]:
    """Every reason to give no thrust now; those of the command itself come first."""
    command, odometry = heard.command, heard.odometry
    found: list[Inhibit] = []
    if command is None:
        found.append(Inhibit.NO_COMMAND)
    else:
        found += command.inhibits
        if command.domain != domain:
            found.append(Inhibit.WRONG_DOMAIN)
        if not 0.0 <= (now_us - heard.command_us) * 1e-6 <= config.command_max_receipt_s:
            found.append(Inhibit.STALE_COMMAND)
        if not _is_valid(command) or (not command.enable and not command.inhibits):
            found.append(Inhibit.COMMAND_INVALID)
    if odometry is None:
        found.append(Inhibit.NO_ODOMETRY)
    else:
        if not 0.0 <= (now_us - heard.odometry_us) * 1e-6 <= config.odometry_max_age_s:
            found.append(Inhibit.STALE_ODOMETRY)
        if not odometry.healthy or not _is_finite(odometry):
            found.append(Inhibit.UNHEALTHY_ODOMETRY)
    return tuple(dict.fromkeys(found))


def _speed(
    integral: float,
    command: NavCommand,
    odometry: Odometry,
    step_s: float,
    config: ControllerConfig,
) -> tuple[float, float, float]:
    """Speed error [m/s], forward thrust in [-astern, max_forward], and the new integral."""
    ordered_mps = min(command.speed_mps, config.max_speed_mps)
    if odometry.stopped and ordered_mps < STANDSTILL_ORDER_MPS:
        return 0.0, 0.0, 0.0  # L5: speed noise at rest must not turn the fans
    error_mps = ordered_mps - (0.0 if odometry.stopped else odometry.surge_mps)
    base = config.speed_kp * error_mps + _feed_forward(ordered_mps, config)
    grown = clip(integral + config.speed_ki * error_mps * step_s, -config.max_integral, config.max_integral)
    if not -config.astern <= base + grown <= config.max_forward and abs(grown) > abs(integral):
        grown = integral  # saturated: winding up further would only overshoot later
    return error_mps, clip(base + grown, 0.0 - config.astern, config.max_forward), grown


def _feed_forward(speed_mps: float, config: ControllerConfig) -> float:
    if not config.drag_feed_forward:
        return config.speed_feed_forward * speed_mps
    drag_n = config.drag_linear * speed_mps + config.drag_quadratic * speed_mps * speed_mps
    return drag_n / (2.0 * config.force_per_unit_n)


def _slew(last: float, wanted: float, reach: float) -> float:
    return clip(wanted, last - reach, last + reach)


def _is_valid(command: NavCommand) -> bool:
    return (
        math.isfinite(command.heading_rad)
        and math.isfinite(command.speed_mps)
        and command.speed_mps >= 0.0
        and command.frame == MAP_FRAME
        and not (command.enable and command.inhibits)
    )


def _is_finite(odometry: Odometry) -> bool:
    return all(map(math.isfinite, (odometry.yaw_rad, odometry.surge_mps, odometry.yaw_rate_radps)))
