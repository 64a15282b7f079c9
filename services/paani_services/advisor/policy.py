"""From three corridors to one direction: thresholds, overrides, sides, hysteresis (checklist J5-J10). Pure."""

import msgspec

from paani.config import Config, PolicyConfig
from paani.messages import Direction, LaneRisk, Reason
from paani_services.advisor.risk import LANES, Components, Obstacle, lane_span, shared_width
from paani_services.advisor.association import area

SEEN_ENOUGH = 0.5  # an obstacle fainter than this has been out of sight too long to occupy a lane
TURNS = {"left": Direction.LEFT, "right": Direction.RIGHT}
SLIGHT_TURNS = {"left": Direction.SLIGHT_LEFT, "right": Direction.SLIGHT_RIGHT}
SIDE_OF = {turn: side for turns in (TURNS, SLIGHT_TURNS) for side, turn in turns.items()}
OTHER = {"left": "right", "right": "left"}


class PolicyState(msgspec.Struct, frozen=True):
    """What one distinct frame leaves for the next: frames in a row each lane was occupied, the turn in progress."""

    occupied_frames: tuple[int, int, int] = (0, 0, 0)
    turn: Direction | None = None
    clear_frames: int = 0


class Decision(msgspec.Struct, frozen=True):
    """One direction, why, and the lanes that decided it."""

    direction: Direction
    reason: Reason
    left: LaneRisk
    center: LaneRisk
    right: LaneRisk


def decide(
    state: PolicyState,
    lanes: dict[str, Components],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> tuple[PolicyState, Decision]:
    """Judge one distinct, usable frame.

    lanes: components by corridor name. A republish must not come here: each call counts as one frame.
    """
    policy = config.advisor.policy
    frames, occupied = _occupancy(state, obstacles, config)
    vessel = _vessel_ahead(obstacles, config)
    blocked = {
        lane: occupied[lane] or lanes[lane].risk >= _limit(lane, policy) or (lane == "center" and vessel)
        for lane in LANES
    }
    judged = {lane: _lane_risk(lanes[lane], occupied[lane], blocked[lane]) for lane in LANES}
    clear_frames = 0 if blocked["center"] else state.clear_frames + 1
    if not blocked["center"]:
        direction, reason = _when_clear(state, blocked, clear_frames, policy)
    else:
        direction, reason = _around(state, judged, obstacles, vessel, config)
    turn = direction if direction in SIDE_OF else None
    if direction is Direction.STOP:
        turn = state.turn  # the side is remembered through a stop, so that a tie resumes it
    return PolicyState(frames, turn, clear_frames), Decision(
        direction, reason, judged["left"], judged["center"], judged["right"]
    )


def _when_clear(
    state: PolicyState, blocked: dict[str, bool], clear_frames: int, policy: PolicyConfig
) -> tuple[Direction, Reason]:
    """Straight on, but a turn is kept until enough distinct frames were clear (J10)."""
    if state.turn is not None and clear_frames < policy.clear_frames and not blocked[SIDE_OF[state.turn]]:
        return state.turn, Reason.TURN_RETAINED
    return Direction.STRAIGHT, Reason.CENTER_CLEAR


def _around(
    state: PolicyState, lanes: dict[str, LaneRisk], obstacles: tuple[Obstacle, ...], vessel: bool, config: Config
) -> tuple[Direction, Reason]:
    policy = config.advisor.policy
    permitted = [side for side in ("left", "right") if not lanes[side].blocked]
    incursion = _edge_incursion(lanes["center"], obstacles, config)
    if incursion is not None:
        away = OTHER[incursion]
        if away in permitted:
            return SLIGHT_TURNS[away], Reason.CENTER_EDGE_INCURSION
        permitted = []  # the other way would turn towards it
    if not permitted:
        only_occupied = any(
            lanes[side].occupied and lanes[side].risk < policy.side_block_risk for side in ("left", "right")
        )
        return Direction.STOP, Reason.NO_SIDE_UNOCCUPIED if only_occupied else Reason.NO_SAFE_SIDE
    if len(permitted) == 2:
        side, tie = _better_side(state, lanes, policy)
        if tie is not None:
            return TURNS[side], tie
    else:
        side = permitted[0]
    return TURNS[side], _why_blocked(lanes["center"], vessel, policy)


def _better_side(state: PolicyState, lanes: dict[str, LaneRisk], policy: PolicyConfig) -> tuple[str, Reason | None]:
    """The lower risk; a tie keeps the side already taken, else goes to starboard (resolution 13)."""
    better = "left" if lanes["left"].risk < lanes["right"].risk else "right"
    gain = abs(lanes["left"].risk - lanes["right"].risk)
    side = SIDE_OF[state.turn] if state.turn is not None else None
    if side is not None and (gain < policy.tie or (side != better and gain < policy.side_change_margin)):
        return side, Reason.TIE_KEPT_SIDE
    if gain < policy.tie:
        return "right", Reason.TIE_STARBOARD
    return better, None


def _why_blocked(center: LaneRisk, vessel: bool, policy: PolicyConfig) -> Reason:
    if center.risk >= policy.center_block_risk:
        return Reason.CENTER_RISK
    return Reason.CENTER_VESSEL if vessel and not center.occupied else Reason.CENTER_OCCUPIED


def _edge_incursion(center: LaneRisk, obstacles: tuple[Obstacle, ...], config: Config) -> str | None:
    """The side from which obstacles reach into the corridor but not its core (J9, resolution 12); else None.

    Water that blocks by itself, or obstacles on both edges, are no mere incursion.
    """
    policy, weights = config.advisor.policy, config.advisor.risk
    core = (policy.core_left, policy.core_right)
    inside = [o for o in obstacles if o.id in center.track_ids]
    water = weights.non_water * center.non_water + weights.uncertainty * center.uncertainty
    if not inside or water >= policy.center_block_risk or any(shared_width(o.box, core) > 0.0 for o in inside):
        return None
    sides = {"left" if o.box[2] <= policy.core_left else "right" for o in inside}
    return sides.pop() if len(sides) == 1 else None


def _occupancy(
    state: PolicyState, obstacles: tuple[Obstacle, ...], config: Config
) -> tuple[tuple[int, int, int], dict[str, bool]]:
    """Lanes filled low in the picture: at once by an immediate danger, else over distinct frames (J6)."""
    policy = config.advisor.policy
    counts: list[int] = []
    occupied: dict[str, bool] = {}
    for lane, before in zip(LANES, state.occupied_frames, strict=True):
        span = lane_span(lane, config.perception.corridors)
        filling = [
            o
            for o in obstacles
            if o.presence >= SEEN_ENOUGH
            and o.box[3] >= policy.occupancy_bottom
            and shared_width(o.box, span) >= policy.occupancy_coverage * (span[1] - span[0])
        ]
        count = min(before + 1, policy.occupancy_frames) if filling else 0
        counts.append(count)
        occupied[lane] = count >= policy.occupancy_frames or any(o.danger for o in filling)
    return (counts[0], counts[1], counts[2]), occupied


def _vessel_ahead(obstacles: tuple[Obstacle, ...], config: Config) -> bool:
    """A vessel whose part inside the centre corridor is large (J7)."""
    center = lane_span("center", config.perception.corridors)
    return any(
        o.craft
        and o.presence >= SEEN_ENOUGH
        and area(o.box) * shared_width(o.box, center) / (o.box[2] - o.box[0])
        >= config.advisor.policy.center_vessel_area
        for o in obstacles
    )


def _limit(lane: str, policy: PolicyConfig) -> float:
    return policy.center_block_risk if lane == "center" else policy.side_block_risk


def _lane_risk(lane: Components, occupied: bool, blocked: bool) -> LaneRisk:
    return LaneRisk(
        risk=lane.risk,
        non_water=lane.non_water,
        obstacle=lane.obstacle,
        urgency=lane.urgency,
        uncertainty=lane.uncertainty,
        clear_width=lane.clear_width,
        occupied=occupied,
        blocked=blocked,
        track_ids=lane.track_ids,
    )
