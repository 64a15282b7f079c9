"""Visual turns: the heading that a LEFT, RIGHT or slight advisory orders, and the most that it may turn the boat.

The paper turns at a constant rate: each order lies a fixed angle off the present yaw (M5, M6). Ours latches the
heading instead, adds the next turn only after the first was held, and bounds the sum, so that a stuck detection
cannot spin the boat.
"""

import math

import msgspec

from paani.clock import has_passed
from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import Advisory, Direction, Purpose

ON_HEADING_RAD = math.radians(5.0)  # a boat this near to its latched heading holds it

TURN_SIDE = {  # sign of the ordered yaw: positive to port
    Direction.LEFT: 1.0,
    Direction.SLIGHT_LEFT: 1.0,
    Direction.RIGHT: -1.0,
    Direction.SLIGHT_RIGHT: -1.0,
}
_SLIGHT_TURNS = frozenset({Direction.SLIGHT_LEFT, Direction.SLIGHT_RIGHT})
TURN_DIRECTIONS = frozenset(TURN_SIDE)


class VisualTurn(
    msgspec.Struct,
    frozen=True,
    rename={"start_yaw_rad": "start_rad", "ordered_turn_rad": "turned_rad", "on_heading_since_us": "on_heading_us"},
):
    """Turn advisories since the boat last went straight, taken as one turn.

    `ordered_turn_rad` is the latched heading relative to `start_yaw_rad`, the yaw at which the first of them came.
    `on_heading_since_us`: since when the boat has held the latched heading; 0 while it does not.
    """

    direction: Direction
    start_yaw_rad: float
    ordered_turn_rad: float
    on_heading_since_us: int = 0

    @property
    def heading_rad(self) -> float:
        """The latched heading in the map."""
        return wrap_rad(self.start_yaw_rad + self.ordered_turn_rad)


def constant_rate_heading_rad(direction: Direction, yaw_rad: float, config: NavigatorConfig) -> float:
    """Heading of the paper's turn: the present yaw plus or minus 25 deg, or 10 deg when slight (M5, M6)."""
    return wrap_rad(yaw_rad + _turn_step_rad(direction, config))


def latch_heading(
    turn: VisualTurn | None, direction: Direction, yaw_rad: float, now_us: int, config: NavigatorConfig
) -> tuple[VisualTurn, bool]:
    """The turn with its latched heading, and whether `max_total_turn_deg` forbids what is advised.

    A heading is latched when the direction changes, and again when the same direction is still advised after the
    boat has held the heading for `turn_hold_s`. No heading lies more than `max_total_turn_deg` from the yaw at which
    the turn began.
    """
    if turn is None:
        return _latch_next(VisualTurn(direction, yaw_rad, 0.0), direction, yaw_rad, config)
    if direction is not turn.direction:
        return _latch_next(turn, direction, yaw_rad, config)
    if abs(wrap_rad(turn.heading_rad - yaw_rad)) > ON_HEADING_RAD:
        return msgspec.structs.replace(turn, on_heading_since_us=0), False
    if turn.on_heading_since_us == 0:
        return msgspec.structs.replace(turn, on_heading_since_us=now_us), False
    if not has_passed(turn.on_heading_since_us, config.turn_hold_s * 1e6, now_us):
        return turn, False
    return _latch_next(turn, direction, yaw_rad, config)


def _latch_next(
    turn: VisualTurn, direction: Direction, yaw_rad: float, config: NavigatorConfig
) -> tuple[VisualTurn, bool]:
    """Latch one step further from the present yaw, up to the limit; at the limit the turn stays and is forbidden."""
    limit_rad = math.radians(config.max_total_turn_deg)
    side = TURN_SIDE[direction]
    turned_rad = wrap_rad(yaw_rad - turn.start_yaw_rad)
    if side * turned_rad >= limit_rad - ON_HEADING_RAD:
        return turn, True
    wanted_rad = turned_rad + _turn_step_rad(direction, config)
    ordered_turn_rad = side * min(side * wanted_rad, limit_rad)
    return VisualTurn(direction, turn.start_yaw_rad, ordered_turn_rad), False


def _turn_step_rad(direction: Direction, config: NavigatorConfig) -> float:
    step_deg = config.slight_turn_deg if direction in _SLIGHT_TURNS else config.turn_deg
    return TURN_SIDE[direction] * math.radians(step_deg)


def is_turn_to_look(advisory: Advisory | None) -> bool:
    """Whether the advised turn is to look for a way, not to go there."""
    if advisory is None:
        return False
    purpose = _infer_purpose(advisory) if advisory.purpose is Purpose.UNSAID else advisory.purpose
    return purpose is Purpose.LOOK


def _infer_purpose(advisory: Advisory) -> Purpose:
    """The purpose of a recorded advisory that does not say it: a turn towards a side that is blocked is to look."""
    side = TURN_SIDE.get(advisory.direction, 0.0)
    is_blocked = (side > 0.0 and advisory.left.blocked) or (side < 0.0 and advisory.right.blocked)
    return Purpose.LOOK if is_blocked else Purpose.PASS
