"""From three corridors to one direction: thresholds, overrides, sides, hysteresis (J5-J10). Pure."""

import math

import msgspec

from paani.config import Config, PolicyConfig
from paani.messages import SIDE_OF, BoxXyxy, Counterfactual, Direction, LaneRisk, Reason
from paani_services.advisor.association import area
from paani_services.advisor.risk import LANES, LaneComponents, Obstacle, lane_span, overlap, shared_width

MIN_OCCUPYING_PRESENCE = 0.5  # an obstacle fainter than this has been out of sight too long to occupy a lane
FULL_TURNS = {"left": Direction.LEFT, "right": Direction.RIGHT}
SLIGHT_TURNS = {"left": Direction.SLIGHT_LEFT, "right": Direction.SLIGHT_RIGHT}
OPPOSITE_SIDE = {"left": "right", "right": "left"}
RECORDED_NAMES = {  # of the fields of `PolicyInput` in a recorded state
    "left_blocked": "left",
    "center_blocked": "center",
    "right_blocked": "right",
    "incursion_side": "incursion",
    "preferred_side": "better",
    "retained_turn": "kept",
    "may_search": "looks",
}


class PolicyState(msgspec.Struct, frozen=True, rename={"no_way_frames": "shut_frames"}):
    """What one distinct frame leaves for the next.

    occupied_frames: frames in a row each lane was occupied. turn: the turn in progress. clear_frames: frames in a row
    the centre was clear. blocked: which lanes were. shut_frames: frames in a row that showed water but no way that is
    free; a look to one side that was in vain counts no more when it begins to look to the other.
    """

    occupied_frames: tuple[int, int, int] = (0, 0, 0)
    turn: Direction | None = None
    clear_frames: int = 0
    blocked: tuple[bool, bool, bool] = (False, False, False)
    no_way_frames: int = 0


class PolicyInput(msgspec.Struct, frozen=True, rename=RECORDED_NAMES):
    """All that a direction depends on.

    left, center, right: is the lane blocked. incursion: the side from which obstacles reach into the centre but not its
    core. better: the side to take if both are free. kept: a turn that has not yet been clear for long enough.
    looks: no way has been free for so long that the boat is to look for one, turning where it is.
    """

    left_blocked: bool = True
    center_blocked: bool = True
    right_blocked: bool = True
    incursion_side: str | None = None
    preferred_side: str = "right"
    retained_turn: Direction | None = None
    may_search: bool = False


class Decision(msgspec.Struct, frozen=True, rename={"policy_input": "standing"}):
    """One direction, why, the lanes that decided it, and what would have changed it."""

    direction: Direction
    reason: Reason
    left: LaneRisk = LaneRisk()
    center: LaneRisk = LaneRisk()
    right: LaneRisk = LaneRisk()
    policy_input: PolicyInput = PolicyInput()
    counterfactual: Counterfactual = Counterfactual()


def decide(
    state: PolicyState,
    lanes: dict[str, LaneComponents],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> tuple[PolicyState, Decision]:
    """Judge one distinct, usable frame.

    lanes: components by corridor name. A republish must not come here: each call counts as one frame.
    """
    policy = config.advisor.policy
    frames, occupied = _lane_occupancy(state, obstacles, config)
    vessel = any(is_vessel_ahead(o, config) for o in obstacles)
    limits = {lane: lane_risk_limit(lane, state, config) for lane in LANES}
    dry = {lane: is_without_water(lanes[lane].non_water, policy) for lane in LANES}
    blocked = {
        lane: occupied[lane] or dry[lane] or lanes[lane].risk >= limits[lane] or (lane == "center" and vessel)
        for lane in LANES
    }
    shows_water = not all(dry.values())
    judged = {lane: _lane_risk(lanes[lane], limits[lane], occupied[lane], blocked[lane]) for lane in LANES}
    clear_frames = 0 if blocked["center"] else state.clear_frames + 1
    risks = {lane: lanes[lane].risk for lane in LANES}
    policy_input = PolicyInput(
        left_blocked=blocked["left"],
        center_blocked=blocked["center"],
        right_blocked=blocked["right"],
        incursion_side=_edge_incursion(judged["center"], obstacles, config),
        preferred_side=preferred_side(state, risks, config),
        may_search=shows_water and may_search(state, config),
        retained_turn=state.turn if clear_frames < policy.clear_frames else None,
    )
    direction = select_direction(policy_input)
    if not policy_input.center_blocked:
        reason = Reason.CENTER_CLEAR if direction is Direction.STRAIGHT else Reason.TURN_RETAINED
    elif direction is Direction.STOP:
        reason = _no_side_reason(judged["left"], judged["right"])
    elif has_no_free_side(policy_input):
        reason = Reason.NO_SIDE_FOR_LONG
    elif policy_input.incursion_side is not None:
        reason = Reason.CENTER_EDGE_INCURSION
    elif not policy_input.left_blocked and not policy_input.right_blocked and _is_tie(state, risks, config):
        reason = Reason.TIE_STARBOARD if state.turn is None else Reason.TIE_KEPT_SIDE
    else:
        reason = _blocked_center_reason(judged["center"], vessel)
    turn = direction if direction in SIDE_OF else None
    if direction is Direction.STOP:
        turn = state.turn  # the side is remembered through a stop, so that a tie resumes it
    no_way_frames = 0
    if shows_water and has_no_free_side(policy_input):
        no_way_frames = 1 + (policy.look_frames if is_search_exhausted(state, config) else state.no_way_frames)
    after = PolicyState(
        frames,
        turn,
        clear_frames,
        (policy_input.left_blocked, policy_input.center_blocked, policy_input.right_blocked),
        no_way_frames,
    )
    return after, Decision(direction, reason, judged["left"], judged["center"], judged["right"], policy_input)


def select_direction(policy_input: PolicyInput) -> Direction:
    """The direction for what stands where (J5, J8-J10, resolutions 12-14)."""
    blocked = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    if not policy_input.center_blocked:
        retained_turn = policy_input.retained_turn
        return (
            retained_turn if retained_turn is not None and not blocked[SIDE_OF[retained_turn]] else Direction.STRAIGHT
        )
    if has_no_free_side(policy_input) and not policy_input.may_search:
        return Direction.STOP
    if policy_input.incursion_side is not None:
        away = OPPOSITE_SIDE[policy_input.incursion_side]  # the other way would turn towards it
        return FULL_TURNS[away] if blocked[away] else SLIGHT_TURNS[away]
    free = [side for side in ("left", "right") if not blocked[side]]
    return FULL_TURNS[free[0] if len(free) == 1 else policy_input.preferred_side]


def has_no_free_side(policy_input: PolicyInput) -> bool:
    """The centre is blocked, and so is each side that could be taken instead."""
    away = OPPOSITE_SIDE.get(policy_input.incursion_side or "")
    sides = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    return policy_input.center_blocked and (sides[away] if away is not None else all(sides.values()))


def may_search(state: PolicyState, config: Config) -> bool:
    """No way was free for `look_frames`, and the boat can turn where it is, by a map of what stands around it."""
    needed = config.advisor.policy.look_frames
    can_turn = _is_planner_active(config) and config.navigator.planner.turn_radius_m == 0.0
    return can_turn and 0 < needed <= state.no_way_frames


def is_search_exhausted(state: PolicyState, config: Config) -> bool:
    """It has looked to one side for twice as long as it waited: at 0.35 rad/s and 5 Hz that is most of a turn about."""
    return state.no_way_frames >= 3 * config.advisor.policy.look_frames


def held_side(state: PolicyState, config: Config) -> tuple[str, float]:
    """The side to take unless the other is better, and by how much it must be (resolution 13).

    A boat that looks for a way looks on to the side it began with, and then, where that was in vain, to the other.
    """
    policy = config.advisor.policy
    if state.turn is None:
        return "right", policy.tie
    if may_search(state, config) and state.no_way_frames > policy.look_frames:
        side = SIDE_OF[state.turn]
        return OPPOSITE_SIDE[side] if is_search_exhausted(state, config) else side, math.inf
    return SIDE_OF[state.turn], max(policy.tie, policy.side_change_margin)


def preferred_side(state: PolicyState, risks: dict[str, float], config: Config) -> str:
    """The side to take when both are free: the lower risk, but not for a small gain."""
    held, needed = held_side(state, config)
    other = OPPOSITE_SIDE[held]
    gain = risks[held] - risks[other]
    return other if gain > 0.0 and gain >= needed else held


def fills_lane(obstacle: Obstacle, lane: str, config: Config) -> bool:
    """Low in the picture, before the lane's water, and wide enough to occupy it (J6)."""
    policy = config.advisor.policy
    if (
        lane in obstacle.exempt_lanes
        or obstacle.presence < MIN_OCCUPYING_PRESENCE
        or obstacle.box[3] < policy.occupancy_bottom
    ):
        return False
    span = lane_span(lane, config.perception.corridors)
    coverage = policy.planned_coverage if _is_planner_active(config) else policy.occupancy_coverage
    return 0.0 < shared_width(obstacle.box, span) >= coverage * (span[1] - span[0])


def is_without_water(non_water: float, policy: PolicyConfig) -> bool:
    """A lane that shows no water, whatever its risk: land, a wall, or a hull from side to side."""
    return non_water > policy.dry


def is_vessel_ahead(obstacle: Obstacle, config: Config) -> bool:
    """A vessel whose part inside the centre corridor is large (J7).

    Inside its core where the metric planner acts: what reaches into the corridor's edges alone leaves a way beside it.
    """
    if not obstacle.is_vessel or obstacle.presence < MIN_OCCUPYING_PRESENCE:
        return False
    policy, span = config.advisor.policy, lane_span("center", config.perception.corridors)
    if _is_planner_active(config):
        span = (policy.core_left, policy.core_right)
    return 0.0 < area(obstacle.box) * overlap(obstacle.box, span) >= policy.center_vessel_area


def reach_into_center(box: BoxXyxy, policy: PolicyConfig) -> str:
    """Where a box that overlaps the centre reaches: its core, or only its left or right edge (J9, resolution 12)."""
    if shared_width(box, (policy.core_left, policy.core_right)) > 0.0:
        return "core"
    return "left" if box[2] <= policy.core_left else "right"


def side_block_risk(config: Config) -> float:
    """The risk at which a side is blocked (J5); another where the metric planner looks for the way in."""
    policy = config.advisor.policy
    return policy.planned_side_block_risk if _is_planner_active(config) else policy.side_block_risk


def lane_risk_limit(lane: str, state: PolicyState, config: Config) -> float:
    """The risk at which a lane is blocked (J5); once blocked, it must be clearly below that to be free again."""
    policy = config.advisor.policy
    limit = policy.center_block_risk if lane == "center" else side_block_risk(config)
    return max(0.0, limit - policy.release_margin) if state.blocked[LANES.index(lane)] else limit


def _is_planner_active(config: Config) -> bool:
    """The metric planner acts, and finds out in metres whether there is room."""
    return config.navigator.planner.acts_on(config.calibration)


def _is_tie(state: PolicyState, risks: dict[str, float], config: Config) -> bool:
    """The side held is not the better one by a tie's width, and the other is no clear gain."""
    held, needed = held_side(state, config)
    gain = risks[held] - risks[OPPOSITE_SIDE[held]]
    return -config.advisor.policy.tie < gain < needed


def _blocked_center_reason(center: LaneRisk, vessel: bool) -> Reason:
    if center.risk >= center.limit:
        return Reason.CENTER_RISK
    return Reason.CENTER_VESSEL if vessel and not center.occupied else Reason.CENTER_OCCUPIED


def _no_side_reason(left: LaneRisk, right: LaneRisk) -> Reason:
    only_occupied = any(side.occupied and side.risk < side.limit for side in (left, right))
    return Reason.NO_SIDE_UNOCCUPIED if only_occupied else Reason.NO_SAFE_SIDE


def _edge_incursion(center: LaneRisk, obstacles: tuple[Obstacle, ...], config: Config) -> str | None:
    """The side from which obstacles reach into the corridor but not its core (J9, resolution 12); else None.

    Water that blocks by itself, or obstacles on both edges, are no mere incursion.
    """
    policy, weights = config.advisor.policy, config.advisor.risk
    water = weights.non_water * center.non_water + weights.uncertainty * center.uncertainty
    if water >= policy.center_block_risk:
        return None
    places = {reach_into_center(o.box, policy) for o in obstacles if o.id in center.track_ids}
    return places.pop() if len(places) == 1 and "core" not in places else None


def _lane_occupancy(
    state: PolicyState, obstacles: tuple[Obstacle, ...], config: Config
) -> tuple[tuple[int, int, int], dict[str, bool]]:
    """Lanes filled low in the picture: at once by an immediate danger, else over distinct frames (J6)."""
    policy = config.advisor.policy
    counts: list[int] = []
    occupied: dict[str, bool] = {}
    for lane, before in zip(LANES, state.occupied_frames, strict=True):
        filling = [o for o in obstacles if fills_lane(o, lane, config)]
        count = min(before + 1, policy.occupancy_frames) if filling else 0
        counts.append(count)
        occupied[lane] = count >= policy.occupancy_frames or any(o.is_danger for o in filling)
    return (counts[0], counts[1], counts[2]), occupied


def _lane_risk(lane: LaneComponents, limit: float, occupied: bool, blocked: bool) -> LaneRisk:
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
        limit=limit,
    )
