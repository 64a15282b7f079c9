"""Visual turns: the heading that a LEFT, RIGHT or slight advisory orders, and when it has gone too far."""

import math

import msgspec

from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import Direction

ON_HEADING_RAD = math.radians(5.0)

SIDE = {
    Direction.LEFT: 1.0,
    Direction.SLIGHT_LEFT: 1.0,
    Direction.RIGHT: -1.0,
    Direction.SLIGHT_RIGHT: -1.0,
}
_SLIGHT = frozenset({Direction.SLIGHT_LEFT, Direction.SLIGHT_RIGHT})
TURNS = frozenset(SIDE)


class Turn(msgspec.Struct, frozen=True):
    """A run of turn advisories since the boat last went straight.

    `turned_rad` is the heading ordered relative to `start_rad`, the yaw at which the run began.
    """

    direction: Direction
    start_rad: float
    turned_rad: float
    on_heading_us: int = 0

    @property
    def heading_rad(self) -> float:
        """The latched heading."""
        return wrap_rad(self.start_rad + self.turned_rad)


def continuous_heading(direction: Direction, yaw_rad: float, config: NavigatorConfig) -> float:
    """Current yaw +/- 25 deg, or 10 deg when slight (M5, M6): a turn at constant rate."""
    return wrap_rad(yaw_rad + _step_rad(direction, config))


def latched(
    turn: Turn | None, direction: Direction, yaw_rad: float, now_us: int, config: NavigatorConfig
) -> tuple[Turn, bool]:
    """The turn with its latched heading, and whether its cap forbids what is advised.

    A heading is latched when the direction changes, and again when the same turn is still advised
    after the boat has held it for `turn_hold_s`. No heading lies more than
    `max_total_turn_deg` from the yaw at which the run began: a stuck detection cannot spin the boat.
    """
    if turn is None:
        return _extended(Turn(direction, yaw_rad, 0.0), direction, yaw_rad, config)
    if direction is not turn.direction:
        return _extended(turn, direction, yaw_rad, config)
    if abs(wrap_rad(turn.heading_rad - yaw_rad)) > ON_HEADING_RAD:
        return msgspec.structs.replace(turn, on_heading_us=0), False
    if turn.on_heading_us == 0:
        return msgspec.structs.replace(turn, on_heading_us=now_us), False
    if (now_us - turn.on_heading_us) * 1e-6 < config.turn_hold_s:
        return turn, False
    return _extended(turn, direction, yaw_rad, config)


def _extended(turn: Turn, direction: Direction, yaw_rad: float, config: NavigatorConfig) -> tuple[Turn, bool]:
    limit_rad = math.radians(config.max_total_turn_deg)
    side = SIDE[direction]
    sofar_rad = wrap_rad(yaw_rad - turn.start_rad)
    if side * sofar_rad >= limit_rad - ON_HEADING_RAD:
        return turn, True
    wanted_rad = sofar_rad + _step_rad(direction, config)
    turned_rad = side * min(side * wanted_rad, limit_rad)
    return Turn(direction, turn.start_rad, turned_rad), False


def _step_rad(direction: Direction, config: NavigatorConfig) -> float:
    step_deg = config.slight_turn_deg if direction in _SLIGHT else config.turn_deg
    return SIDE[direction] * math.radians(step_deg)
