"""From three corridors to one direction: thresholds, overrides, sides, hysteresis (J5-J10). Pure."""

import math

import msgspec

from paani.config import Config, PolicyConfig
from paani.messages import SIDE_OF, BoxXyxy, Counterfactual, Direction, LaneRisk, Reason
from paani_services.advisor.association import area
from paani_services.advisor.risk import LANES, Components, Obstacle, lane_span, overlap, shared_width

SEEN_ENOUGH = 0.5  # an obstacle fainter than this has been out of sight too long to occupy a lane
TURNS = {"left": Direction.LEFT, "right": Direction.RIGHT}
SLIGHT_TURNS = {"left": Direction.SLIGHT_LEFT, "right": Direction.SLIGHT_RIGHT}
OTHER = {"left": "right", "right": "left"}


class PolicyState(msgspec.Struct, frozen=True):
    """What one distinct frame leaves for the next.

    occupied_frames: frames in a row each lane was occupied. turn: the turn in progress. clear_frames: frames in a row
    the centre was clear. blocked: which lanes were. shut_frames: frames in a row that showed water but no way that is
    free; a look to one side that was in vain counts no more when it begins to look to the other.
    """

    occupied_frames: tuple[int, int, int] = (0, 0, 0)
    turn: Direction | None = None
    clear_frames: int = 0
    blocked: tuple[bool, bool, bool] = (False, False, False)
    shut_frames: int = 0


class Standing(msgspec.Struct, frozen=True):
    """All that a direction depends on.

    left, center, right: is the lane blocked. incursion: the side from which obstacles reach into the centre but not its
    core. better: the side to take if both are free. kept: a turn that has not yet been clear for long enough.
    looks: no way has been free for so long that the boat is to look for one, turning where it is.
    """

    left: bool = True
    center: bool = True
    right: bool = True
    incursion: str | None = None
    better: str = "right"
    kept: Direction | None = None
    looks: bool = False


class Decision(msgspec.Struct, frozen=True):
    """One direction, why, the lanes that decided it, and what would have changed it."""

    direction: Direction
    reason: Reason
    left: LaneRisk = LaneRisk()
    center: LaneRisk = LaneRisk()
    right: LaneRisk = LaneRisk()
    standing: Standing = Standing()
    counterfactual: Counterfactual = Counterfactual()


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
    vessel = any(is_vessel_ahead(o, config) for o in obstacles)
    limits = {lane: limit_of(lane, state, config) for lane in LANES}
    dry = {lane: is_dry(lanes[lane].non_water, policy) for lane in LANES}
    blocked = {
        lane: occupied[lane] or dry[lane] or lanes[lane].risk >= limits[lane] or (lane == "center" and vessel)
        for lane in LANES
    }
    shows_water = not all(dry.values())
    judged = {lane: _lane_risk(lanes[lane], limits[lane], occupied[lane], blocked[lane]) for lane in LANES}
    clear_frames = 0 if blocked["center"] else state.clear_frames + 1
    risks = {lane: lanes[lane].risk for lane in LANES}
    standing = Standing(
        left=blocked["left"],
        center=blocked["center"],
        right=blocked["right"],
        incursion=_edge_incursion(judged["center"], obstacles, config),
        better=better_side(state, risks, config),
        looks=shows_water and looks(state, config),
        kept=state.turn if clear_frames < policy.clear_frames else None,
    )
    direction = direct(standing)
    if not standing.center:
        reason = Reason.CENTER_CLEAR if direction is Direction.STRAIGHT else Reason.TURN_RETAINED
    elif direction is Direction.STOP:
        reason = _why_no_side(judged["left"], judged["right"])
    elif is_shut(standing):
        reason = Reason.NO_SIDE_FOR_LONG
    elif standing.incursion is not None:
        reason = Reason.CENTER_EDGE_INCURSION
    elif not standing.left and not standing.right and _is_tie(state, risks, config):
        reason = Reason.TIE_STARBOARD if state.turn is None else Reason.TIE_KEPT_SIDE
    else:
        reason = _why_blocked(judged["center"], vessel)
    turn = direction if direction in SIDE_OF else None
    if direction is Direction.STOP:
        turn = state.turn  # the side is remembered through a stop, so that a tie resumes it
    shut_frames = 0
    if shows_water and is_shut(standing):
        shut_frames = 1 + (policy.look_frames if looks_in_vain(state, config) else state.shut_frames)
    after = PolicyState(frames, turn, clear_frames, (standing.left, standing.center, standing.right), shut_frames)
    return after, Decision(direction, reason, judged["left"], judged["center"], judged["right"], standing)


def direct(standing: Standing) -> Direction:
    """The direction for what stands where (J5, J8-J10, resolutions 12-14)."""
    blocked = {"left": standing.left, "right": standing.right}
    if not standing.center:
        kept = standing.kept
        return kept if kept is not None and not blocked[SIDE_OF[kept]] else Direction.STRAIGHT
    if is_shut(standing) and not standing.looks:
        return Direction.STOP
    if standing.incursion is not None:
        away = OTHER[standing.incursion]  # the other way would turn towards it
        return TURNS[away] if blocked[away] else SLIGHT_TURNS[away]
    free = [side for side in ("left", "right") if not blocked[side]]
    return TURNS[free[0] if len(free) == 1 else standing.better]


def is_shut(standing: Standing) -> bool:
    """The centre is blocked, and so is each side that could be taken instead."""
    away = OTHER.get(standing.incursion or "")
    sides = {"left": standing.left, "right": standing.right}
    return standing.center and (sides[away] if away is not None else all(sides.values()))


def looks(state: PolicyState, config: Config) -> bool:
    """No way was free for `look_frames`, and the boat can turn where it is, by a map of what stands around it."""
    needed = config.advisor.policy.look_frames
    can_turn = _is_planned(config) and config.navigator.planner.turn_radius_m == 0.0
    return can_turn and 0 < needed <= state.shut_frames


def looks_in_vain(state: PolicyState, config: Config) -> bool:
    """It has looked to one side for twice as long as it waited: at 0.35 rad/s and 5 Hz that is most of a turn about."""
    return state.shut_frames >= 3 * config.advisor.policy.look_frames


def side_held(state: PolicyState, config: Config) -> tuple[str, float]:
    """The side to take unless the other is better, and by how much it must be (resolution 13).

    A boat that looks for a way looks on to the side it began with, and then, where that was in vain, to the other.
    """
    policy = config.advisor.policy
    if state.turn is None:
        return "right", policy.tie
    if looks(state, config) and state.shut_frames > policy.look_frames:
        side = SIDE_OF[state.turn]
        return OTHER[side] if looks_in_vain(state, config) else side, math.inf
    return SIDE_OF[state.turn], max(policy.tie, policy.side_change_margin)


def better_side(state: PolicyState, risks: dict[str, float], config: Config) -> str:
    """The side to take when both are free: the lower risk, but not for a small gain."""
    held, needed = side_held(state, config)
    other = OTHER[held]
    gain = risks[held] - risks[other]
    return other if gain > 0.0 and gain >= needed else held


def fills(obstacle: Obstacle, lane: str, config: Config) -> bool:
    """Low in the picture, before the lane's water, and wide enough to occupy it (J6)."""
    policy = config.advisor.policy
    if lane in obstacle.behind or obstacle.presence < SEEN_ENOUGH or obstacle.box[3] < policy.occupancy_bottom:
        return False
    span = lane_span(lane, config.perception.corridors)
    coverage = policy.planned_coverage if _is_planned(config) else policy.occupancy_coverage
    return 0.0 < shared_width(obstacle.box, span) >= coverage * (span[1] - span[0])


def is_dry(non_water: float, policy: PolicyConfig) -> bool:
    """A lane that shows no water, whatever its risk: land, a wall, or a hull from side to side."""
    return non_water > policy.dry


def is_vessel_ahead(obstacle: Obstacle, config: Config) -> bool:
    """A vessel whose part inside the centre corridor is large (J7).

    Inside its core where the metric planner acts: what reaches into the corridor's edges alone leaves a way beside it.
    """
    if not obstacle.craft or obstacle.presence < SEEN_ENOUGH:
        return False
    policy, span = config.advisor.policy, lane_span("center", config.perception.corridors)
    if _is_planned(config):
        span = (policy.core_left, policy.core_right)
    return 0.0 < area(obstacle.box) * overlap(obstacle.box, span) >= policy.center_vessel_area


def place_in_center(box: BoxXyxy, policy: PolicyConfig) -> str:
    """Where a box that overlaps the centre reaches: its core, or only its left or right edge (J9, resolution 12)."""
    if shared_width(box, (policy.core_left, policy.core_right)) > 0.0:
        return "core"
    return "left" if box[2] <= policy.core_left else "right"


def side_block_risk(config: Config) -> float:
    """The risk at which a side is blocked (J5); another where the metric planner looks for the way in."""
    policy = config.advisor.policy
    return policy.planned_side_block_risk if _is_planned(config) else policy.side_block_risk


def limit_of(lane: str, state: PolicyState, config: Config) -> float:
    """The risk at which a lane is blocked (J5); once blocked, it must be clearly below that to be free again."""
    policy = config.advisor.policy
    limit = policy.center_block_risk if lane == "center" else side_block_risk(config)
    return max(0.0, limit - policy.release_margin) if state.blocked[LANES.index(lane)] else limit


def _is_planned(config: Config) -> bool:
    """The metric planner acts, and finds out in metres whether there is room."""
    return config.navigator.planner.acts_on(config.calibration)


def _is_tie(state: PolicyState, risks: dict[str, float], config: Config) -> bool:
    """The side held is not the better one by a tie's width, and the other is no clear gain."""
    held, needed = side_held(state, config)
    gain = risks[held] - risks[OTHER[held]]
    return -config.advisor.policy.tie < gain < needed


def _why_blocked(center: LaneRisk, vessel: bool) -> Reason:
    if center.risk >= center.limit:
        return Reason.CENTER_RISK
    return Reason.CENTER_VESSEL if vessel and not center.occupied else Reason.CENTER_OCCUPIED


def _why_no_side(left: LaneRisk, right: LaneRisk) -> Reason:
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
    places = {place_in_center(o.box, policy) for o in obstacles if o.id in center.track_ids}
    return places.pop() if len(places) == 1 and "core" not in places else None


def _occupancy(
    state: PolicyState, obstacles: tuple[Obstacle, ...], config: Config
) -> tuple[tuple[int, int, int], dict[str, bool]]:
    """Lanes filled low in the picture: at once by an immediate danger, else over distinct frames (J6)."""
    policy = config.advisor.policy
    counts: list[int] = []
    occupied: dict[str, bool] = {}
    for lane, before in zip(LANES, state.occupied_frames, strict=True):
        filling = [o for o in obstacles if fills(o, lane, config)]
        count = min(before + 1, policy.occupancy_frames) if filling else 0
        counts.append(count)
        occupied[lane] = count >= policy.occupancy_frames or any(o.danger for o in filling)
    return (counts[0], counts[1], counts[2]), occupied


def _lane_risk(lane: Components, limit: float, occupied: bool, blocked: bool) -> LaneRisk:
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
