"""Speed and heading controller: from an order to the thrust of two fans. Pure: no clock, no bus, no logging.

Speed: P and I with a feed-forward. Heading: P and D. Both are added and subtracted for two fans (differential thrust)
and limited in size and in rate of change (N1-N8).

Ours are the feed-forward, which inverts the hull's drag, the integral, which does not wind up while the thrust is
saturated, and thrust astern, which brakes and turns the boat on the spot; the paper's fans only push.
"""

import math

import msgspec

from paani.config import ControllerConfig
from paani.geometry import clip, wrap_rad
from paani.messages import STATION_ASTERN_MPS, Inhibit, NavCommand, Odometry, Thrust

MAP_FRAME = "map"
STANDSTILL_ORDER_MPS = 0.01  # a slower order asks the boat to stand still
TURNING_RADPS = 0.05  # a boat that turns faster turns for certain: five times the noise of a cheap gyro
MAX_STEP_S = 0.3  # a longer gap since the last step is integrated and slewed as this long, three periods at 10 Hz


class ControllerState(msgspec.Struct, frozen=True):
    """What one step leaves for the next: integral of the speed error [normalised thrust], last thrust and its time."""

    integral: float = 0.0
    left: float = 0.0
    right: float = 0.0
    last_us: int = 0


class ControllerInputs(msgspec.Struct, frozen=True):
    """The newest messages, and when they were received [us]."""

    command: NavCommand | None = None
    command_us: int = 0
    odometry: Odometry | None = None
    odometry_us: int = 0


def compute_thrust(
    state: ControllerState, inputs: ControllerInputs, now_us: int, domain: int, config: ControllerConfig
) -> tuple[ControllerState, Thrust]:
    """One step: forward thrust, steering, mixing, saturation (no more astern than `astern`), slew limit (N7).

    Where an input is missing, stale, invalid or disabled, the thrust is zero at once, without slew limit, and the
    state is cleared. The order's `source_us` and `echo_us` pass through.
    """
    inhibits = find_inhibits(inputs, now_us, domain, config)
    command, odometry = inputs.command, inputs.odometry
    if command is None or odometry is None or inhibits:
        return ControllerState(), Thrust(
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

    if command.keeps_station:
        state = _without_way(state, odometry.surge_mps + command.astern_mps)
    speed_error_mps, forward, integral = _forward_thrust(state.integral, command, odometry, step_s, config)
    max_steer = config.max_steer
    if command.keeps_station:
        forward = forward if forward * speed_error_mps > 0.0 else 0.0  # the feed-forward alone would push it on
        max_steer = min(max_steer, config.astern + forward)  # a couple, of which neither fan's part is cut
    heading_error_rad = _turn_rad(command.heading_rad, odometry, config)
    steering = clip(
        config.heading_kp * heading_error_rad - config.heading_kd * odometry.yaw_rate_radps,
        -max_steer,
        max_steer,
    )
    left, right = (
        _limit_slew(last, clip(wanted, 0.0 - config.astern, 1.0), config.slew_per_s * step_s)
        for last, wanted in ((state.left, forward - steering), (state.right, forward + steering))
    )
    return ControllerState(integral, left, right, now_us), Thrust(
        source_us=command.source_us,
        left=left,
        right=right,
        enabled=True,
        echo_us=command.echo_us,
        speed_error_mps=speed_error_mps,
        heading_error_rad=heading_error_rad,
        command_sent_us=command.sent_us,
    )


def _turn_rad(heading_rad: float, odometry: Odometry, config: ControllerConfig) -> float:
    """The turn to a heading: the shorter one, but for a heading nearly astern, to which a turn under way goes on.

    Which way is shorter to a heading astern changes with the noise of the compass and with each small change of the
    order, and a boat that turned back each time would not turn at all.
    """
    shorter_rad, rate_radps = wrap_rad(heading_rad - odometry.yaw_rad), odometry.yaw_rate_radps
    is_astern = abs(shorter_rad) > math.radians(config.turn_on_deg)
    if is_astern and shorter_rad * rate_radps < 0.0 and abs(rate_radps) > TURNING_RADPS:
        return shorter_rad + math.copysign(2.0 * math.pi, rate_radps)
    return shorter_rad


def _without_way(state: ControllerState, beyond_mps: float) -> ControllerState:
    """The state without the thrust and the integral that push the boat farther beyond the speed that is ordered."""
    if (state.left + state.right) * beyond_mps > 0.0:
        state = msgspec.structs.replace(state, left=0.0, right=0.0)
    return msgspec.structs.replace(state, integral=0.0) if state.integral * beyond_mps > 0.0 else state


def find_inhibits(inputs: ControllerInputs, now_us: int, domain: int, config: ControllerConfig) -> tuple[Inhibit, ...]:
    """Every reason to give no thrust now; those of the order itself come first."""
    command, odometry = inputs.command, inputs.odometry
    inhibits: list[Inhibit] = []
    if command is None:
        inhibits.append(Inhibit.NO_COMMAND)
    else:
        inhibits += command.inhibits
        if command.domain != domain:
            inhibits.append(Inhibit.WRONG_DOMAIN)
        if not 0.0 <= (now_us - inputs.command_us) * 1e-6 <= config.command_max_receipt_s:
            inhibits.append(Inhibit.STALE_COMMAND)
        if not _is_valid(command) or (not command.enable and not command.inhibits):
            inhibits.append(Inhibit.COMMAND_INVALID)
    if odometry is None:
        inhibits.append(Inhibit.NO_ODOMETRY)
    else:
        if not 0.0 <= (now_us - inputs.odometry_us) * 1e-6 <= config.odometry_max_age_s:
            inhibits.append(Inhibit.STALE_ODOMETRY)
        if not odometry.healthy or not _is_finite(odometry):
            inhibits.append(Inhibit.UNHEALTHY_ODOMETRY)
    return tuple(dict.fromkeys(inhibits))


def _forward_thrust(
    integral: float,
    command: NavCommand,
    odometry: Odometry,
    step_s: float,
    config: ControllerConfig,
) -> tuple[float, float, float]:
    """Speed error [m/s], forward thrust in [-astern, max_forward], and the new integral."""
    ordered_mps = clip(command.speed_mps - command.astern_mps, -config.max_speed_mps, config.max_speed_mps)
    if odometry.stopped and abs(ordered_mps) < STANDSTILL_ORDER_MPS:
        return 0.0, 0.0, 0.0  # L5: the noise of the speed at rest shall not turn the fans
    error_mps = ordered_mps - (0.0 if odometry.stopped else odometry.surge_mps)
    base = config.speed_kp * error_mps + _feed_forward_thrust(ordered_mps, config)
    new_integral = clip(integral + config.speed_ki * error_mps * step_s, -config.max_integral, config.max_integral)
    if not -config.astern <= base + new_integral <= config.max_forward and abs(new_integral) > abs(integral):
        new_integral = integral  # saturated: a larger integral would only overshoot later
    return error_mps, clip(base + new_integral, 0.0 - config.astern, config.max_forward), new_integral


def _feed_forward_thrust(speed_mps: float, config: ControllerConfig) -> float:
    """Normalised thrust of each fan that holds this speed: the hull's drag, or the paper's fixed gain (N3)."""
    if not config.drag_feed_forward:
        return config.speed_feed_forward * speed_mps
    drag_n = config.drag_linear * speed_mps + config.drag_quadratic * speed_mps * abs(speed_mps)
    return drag_n / (2.0 * config.force_per_unit_n)


def _limit_slew(last: float, wanted: float, max_change: float) -> float:
    return clip(wanted, last - max_change, last + max_change)


def _is_valid(command: NavCommand) -> bool:
    """B11: heading, speed, frame, enable and inhibits fit together."""
    return (
        math.isfinite(command.heading_rad)
        and math.isfinite(command.speed_mps)
        and command.speed_mps >= 0.0
        and 0.0 <= command.astern_mps < math.inf
        and not (command.speed_mps > 0.0 and command.astern_mps > 0.0)
        and command.frame == MAP_FRAME
        and not (command.enable and command.inhibits)
        and not (command.keeps_station and not _is_of_a_station(command))
    )


def _is_of_a_station(command: NavCommand) -> bool:
    return command.speed_mps == 0.0 and command.astern_mps <= STATION_ASTERN_MPS and bool(command.vetoes)


def _is_finite(odometry: Odometry) -> bool:
    return all(map(math.isfinite, (odometry.yaw_rad, odometry.surge_mps, odometry.yaw_rate_radps)))
