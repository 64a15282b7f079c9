"""The policy: from the risks of three corridors to one direction. Pure.

Thresholds, then overrides (occupancy, a vessel ahead, a lane without water), then the choice of a side, with hysteresis
over distinct frames (J5-J10). It is written once, for all evidence of a frame and for selections of it: `evaluate` maps
the evidence that counts to the input of the policy, and `select_direction` maps that to a direction. The counterfactual
asks both about many selections at once.
"""

import math
from typing import NamedTuple

import msgspec

from paani.config import Config, PolicyConfig
from paani.messages import SIDE_OF, BoxXyxy, Counterfactual, Direction, LaneEvidence, LaneRisk, Reason
from paani_services.advisor.association import area
from paani_services.advisor.risk import (
    ALL_EVIDENCE,
    LANES,
    LaneComponents,
    LaneTerms,
    Obstacle,
    Selection,
    Truth,
    Value,
    lane_components,
    lane_span,
    lane_terms,
    overlap,
    shared_width,
)

MIN_OCCUPYING_PRESENCE = 0.5  # presence below which an unseen obstacle occupies no lane
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

    occupied_frames: consecutive frames in which each lane was filled. turn: the turn in progress. clear_frames:
    consecutive frames in which the centre was clear. blocked: the lanes that were blocked. no_way_frames: consecutive
    frames that showed water but no free way; set back to the beginning of a search where the search changes sides.
    """

    occupied_frames: tuple[int, int, int] = (0, 0, 0)
    turn: Direction | None = None
    clear_frames: int = 0
    blocked: tuple[bool, bool, bool] = (False, False, False)
    no_way_frames: int = 0


class PolicyInput(msgspec.Struct, frozen=True, rename=RECORDED_NAMES):
    """Everything that the direction is a function of.

    incursion_side: the side from which obstacles reach into the centre but not into its core. preferred_side: the side
    to take where both are free. retained_turn: a turn whose end has not been clear for long enough. may_search: no way
    has been free for so long that the boat may turn on the spot to find one.
    """

    left_blocked: bool = True
    center_blocked: bool = True
    right_blocked: bool = True
    incursion_side: str | None = None
    preferred_side: str = "right"
    retained_turn: Direction | None = None
    may_search: bool = False


class LaneFacts(NamedTuple):
    """One corridor in one frame. Obstacles are given by index.

    limit: the risk at which it is blocked. is_without_water: its water alone blocks it. filling: obstacles low and wide
    enough to occupy it. occupying: those of them that occupy it in this frame.
    """

    terms: LaneTerms
    limit: float
    is_without_water: bool
    filling: tuple[int, ...]
    occupying: tuple[int, ...]


class FrameFacts(NamedTuple):
    """One frame as the policy sees it, before it is asked which evidence counts. Obstacles are given by index.

    vessels_ahead: vessels large enough to block the centre (J7). reaching: obstacles in the centre by the part of it
    that they reach, `core`, `left` or `right` edge (J9). held_side: the side to take unless the other one is better by
    `needed_gain`.
    """

    lanes: dict[str, LaneFacts]
    obstacles: tuple[Obstacle, ...]
    vessels_ahead: tuple[int, ...]
    reaching: dict[str, tuple[int, ...]]
    held_side: str
    needed_gain: float
    may_search: bool


class Evaluation(NamedTuple):
    """What the policy makes of the evidence that counts; arrays where it was asked about many selections."""

    blocked: dict[str, Truth]
    occupied: dict[str, Truth]
    vessel_ahead: Truth
    shows_water: Truth
    left_incursion: Truth
    right_incursion: Truth
    prefers_right: Truth
    may_search: Truth


class Decision(msgspec.Struct, frozen=True, rename={"policy_input": "standing"}):
    """One direction, its reason, the lanes that decided it, and what would have changed it."""

    direction: Direction
    reason: Reason
    left: LaneRisk = LaneRisk()
    center: LaneRisk = LaneRisk()
    right: LaneRisk = LaneRisk()
    policy_input: PolicyInput = PolicyInput()
    counterfactual: Counterfactual = Counterfactual()


def frame_facts(
    state: PolicyState, water: dict[str, LaneEvidence], obstacles: tuple[Obstacle, ...], config: Config
) -> FrameFacts:
    """Collect what the policy needs of one frame.

    water: of each corridor. state: what the frame before left.
    """
    policy = config.advisor.policy
    lanes = {}
    for lane, before in zip(LANES, state.occupied_frames, strict=True):
        filling = [i for i, o in enumerate(obstacles) if fills_lane(o, lane, config)]
        is_lasting = before + 1 >= policy.occupancy_frames
        lanes[lane] = LaneFacts(
            terms=lane_terms(water[lane], obstacles, lane, config),
            limit=lane_risk_limit(lane, state, config),
            is_without_water=is_without_water(water[lane].non_water, policy),
            filling=tuple(filling),
            occupying=tuple(i for i in filling if is_lasting or obstacles[i].is_danger),
        )
    reaching: dict[str, list[int]] = {"core": [], "left": [], "right": []}
    for i, _ in lanes["center"].terms.obstacles:
        reaching[reach_into_center(obstacles[i].box, policy)].append(i)
    held, needed = held_side(state, config)
    return FrameFacts(
        lanes=lanes,
        obstacles=obstacles,
        vessels_ahead=tuple(i for i, o in enumerate(obstacles) if is_vessel_ahead(o, config)),
        reaching={part: tuple(found) for part, found in reaching.items()},
        held_side=held,
        needed_gain=needed,
        may_search=may_search(state, config),
    )


def frame_components(facts: FrameFacts, evidence: Selection, config: Config) -> dict[str, LaneComponents]:
    """The risk of each corridor with its components, from the evidence that counts."""
    return {lane: lane_components(facts.lanes[lane].terms, lane, evidence, config.advisor.risk) for lane in LANES}


def evaluate(
    facts: FrameFacts, components: dict[str, LaneComponents], evidence: Selection, config: Config
) -> Evaluation:
    """Apply thresholds and overrides to the evidence that counts (J5-J7, J9).

    components: of the same evidence. An incursion from one edge of the centre is one whose obstacles reach neither its
    core nor its other edge, where the water alone does not block the centre.
    """
    without_water, occupied, blocked = {}, {}, {}
    for lane, found in facts.lanes.items():
        without_water[lane] = found.is_without_water & evidence.has_water(lane)
        occupied[lane] = evidence.has_any(found.occupying)
        blocked[lane] = (components[lane].risk >= found.limit) | without_water[lane] | occupied[lane]
    vessel_ahead = evidence.has_any(facts.vessels_ahead)
    blocked["center"] = blocked["center"] | vessel_ahead
    center, weights = components["center"], config.advisor.risk
    water_risk = weights.non_water * center.non_water + weights.uncertainty * center.uncertainty
    core, left, right = (evidence.has_any(facts.reaching[part]) for part in ("core", "left", "right"))
    is_inner = core | (water_risk >= config.advisor.policy.center_block_risk)
    gain = components[facts.held_side].risk - components[OPPOSITE_SIDE[facts.held_side]].risk
    shows_water = True ^ (without_water["left"] & without_water["center"] & without_water["right"])
    return Evaluation(
        blocked=blocked,
        occupied=occupied,
        vessel_ahead=vessel_ahead,
        shows_water=shows_water,
        left_incursion=left & (True ^ (right | is_inner)),
        right_incursion=right & (True ^ (left | is_inner)),
        prefers_right=_is_clear_gain(gain, facts.needed_gain) ^ (facts.held_side == "right"),
        may_search=facts.may_search & shows_water,
    )


def decide(
    state: PolicyState, facts: FrameFacts, components: dict[str, LaneComponents], config: Config
) -> tuple[PolicyState, Decision]:
    """Judge one distinct, usable frame by all its evidence.

    facts, components: of the frame. A republished frame must not come here: each call counts as one frame.
    """
    policy = config.advisor.policy
    found = evaluate(facts, components, ALL_EVIDENCE, config)
    judged = {lane: _lane_risk(lane, facts, components, found) for lane in LANES}
    risks = {lane: judged[lane].risk for lane in LANES}
    clear_frames = 0 if found.blocked["center"] else state.clear_frames + 1
    policy_input = PolicyInput(
        left_blocked=judged["left"].blocked,
        center_blocked=judged["center"].blocked,
        right_blocked=judged["right"].blocked,
        incursion_side="left" if found.left_incursion else "right" if found.right_incursion else None,
        preferred_side="right" if found.prefers_right else "left",
        may_search=bool(found.may_search),
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
    elif not policy_input.left_blocked and not policy_input.right_blocked and _is_tie(facts, risks, config):
        reason = Reason.TIE_STARBOARD if state.turn is None else Reason.TIE_KEPT_SIDE
    else:
        reason = _blocked_center_reason(judged["center"], is_vessel_ahead=bool(found.vessel_ahead))
    turn = direction if direction in SIDE_OF else None
    if direction is Direction.STOP:
        turn = state.turn  # the side is remembered through a stop, so that a tie resumes it
    no_way_frames = 0
    if found.shows_water and has_no_free_side(policy_input):
        no_way_frames = 1 + (policy.look_frames if is_search_exhausted(state, config) else state.no_way_frames)
    after = PolicyState(
        occupied_frames=_occupied_frames(state, facts, policy),
        turn=turn,
        clear_frames=clear_frames,
        blocked=(policy_input.left_blocked, policy_input.center_blocked, policy_input.right_blocked),
        no_way_frames=no_way_frames,
    )
    return after, Decision(direction, reason, judged["left"], judged["center"], judged["right"], policy_input)


def select_direction(policy_input: PolicyInput) -> Direction:
    """The direction that follows from the input (J5, J8-J10).

    A clear centre goes straight, unless a turn is retained. A blocked centre turns to the free side, or to the
    preferred one where both are free; away from an incursion from one edge, slightly where that side is free; and
    stops where no side is free, unless the boat may search.
    """
    blocked = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    if not policy_input.center_blocked:
        turn = policy_input.retained_turn
        return turn if turn is not None and not blocked[SIDE_OF[turn]] else Direction.STRAIGHT
    if has_no_free_side(policy_input) and not policy_input.may_search:
        return Direction.STOP
    if policy_input.incursion_side is not None:
        away = OPPOSITE_SIDE[policy_input.incursion_side]  # the other side would turn towards the obstacle
        return FULL_TURNS[away] if blocked[away] else SLIGHT_TURNS[away]
    free = [side for side in ("left", "right") if not blocked[side]]
    return FULL_TURNS[free[0] if len(free) == 1 else policy_input.preferred_side]


def has_no_free_side(policy_input: PolicyInput) -> bool:
    """Whether the centre is blocked and so is every side that could be taken instead."""
    away = OPPOSITE_SIDE.get(policy_input.incursion_side or "")
    sides = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    return policy_input.center_blocked and (sides[away] if away is not None else all(sides.values()))


def may_search(state: PolicyState, config: Config) -> bool:
    """Whether no way was free for `look_frames`, and the boat can turn on the spot by a map of what is around it."""
    needed = config.advisor.policy.look_frames
    can_search = config.is_planner_active and config.turns_on_the_spot
    return can_search and 0 < needed <= state.no_way_frames


def is_search_exhausted(state: PolicyState, config: Config) -> bool:
    """Whether it searched on one side for twice `look_frames`: most of a full turn at 0.35 rad/s and 5 Hz."""
    return state.no_way_frames >= 3 * config.advisor.policy.look_frames


def held_side(state: PolicyState, config: Config) -> tuple[str, float]:
    """The side to take unless the other is better, and by how much its risk must then be lower.

    Without a turn in progress it is starboard, and a tie's width is enough. A boat that searches goes on to the side it
    began with whatever the risks are, and to the other one once that search is exhausted.
    """
    policy = config.advisor.policy
    if state.turn is None:
        return "right", policy.tie
    if may_search(state, config) and state.no_way_frames > policy.look_frames:
        side = SIDE_OF[state.turn]
        return OPPOSITE_SIDE[side] if is_search_exhausted(state, config) else side, math.inf
    return SIDE_OF[state.turn], max(policy.tie, policy.side_change_margin)


def preferred_side(held: str, needed: float, risks: dict[str, float]) -> str:
    """The side to take where both are free: the one held, unless the other's risk is lower by a clear gain."""
    other = OPPOSITE_SIDE[held]
    return other if _is_clear_gain(risks[held] - risks[other], needed) else held


def fills_lane(obstacle: Obstacle, lane: str, config: Config) -> bool:
    """Whether the obstacle is low enough in the picture, and wide enough, to occupy the lane (J6)."""
    policy = config.advisor.policy
    if lane in obstacle.exempt_lanes or obstacle.presence < MIN_OCCUPYING_PRESENCE:
        return False
    if obstacle.box[3] < policy.occupancy_bottom:
        return False
    span = lane_span(lane, config.perception.corridors)
    coverage = policy.planned_coverage if config.is_planner_active else policy.occupancy_coverage
    return 0.0 < shared_width(obstacle.box, span) >= coverage * (span[1] - span[0])


def is_without_water(non_water: float, policy: PolicyConfig) -> bool:
    """Whether so little of the lane is water that it is blocked whatever its risk."""
    return non_water > policy.dry


def is_vessel_ahead(obstacle: Obstacle, config: Config) -> bool:
    """Whether the obstacle is a vessel whose part inside the centre corridor is large (J7).

    Inside its core where the metric planner acts, because a vessel in an edge of the corridor leaves a way beside it.
    """
    if not obstacle.is_vessel or obstacle.presence < MIN_OCCUPYING_PRESENCE:
        return False
    policy, span = config.advisor.policy, lane_span("center", config.perception.corridors)
    if config.is_planner_active:
        span = (policy.core_left, policy.core_right)
    return 0.0 < area(obstacle.box) * overlap(obstacle.box, span) >= policy.center_vessel_area


def reach_into_center(box: BoxXyxy, policy: PolicyConfig) -> str:
    """The part of the centre corridor that a box in it reaches: its core, or only its left or right edge (J9)."""
    if shared_width(box, (policy.core_left, policy.core_right)) > 0.0:
        return "core"
    return "left" if box[2] <= policy.core_left else "right"


def side_block_risk(config: Config) -> float:
    """The risk at which a side is blocked (J5); higher where the metric planner looks for a way between obstacles."""
    policy = config.advisor.policy
    return policy.planned_side_block_risk if config.is_planner_active else policy.side_block_risk


def lane_risk_limit(lane: str, state: PolicyState, config: Config) -> float:
    """The risk at which a lane is blocked (J5); lower by `release_margin` where it was blocked before."""
    policy = config.advisor.policy
    limit = policy.center_block_risk if lane == "center" else side_block_risk(config)
    return max(0.0, limit - policy.release_margin) if state.blocked[LANES.index(lane)] else limit


def _is_clear_gain(gain: Value, needed: float) -> Truth:
    """Whether the other side's risk is lower by as much as a change of side needs."""
    return (gain > 0.0) & (gain >= needed)


def _is_tie(facts: FrameFacts, risks: dict[str, float], config: Config) -> bool:
    """Whether the held side is not better by a tie's width, and the other side is no clear gain."""
    gain = risks[facts.held_side] - risks[OPPOSITE_SIDE[facts.held_side]]
    return -config.advisor.policy.tie < gain < facts.needed_gain


def _blocked_center_reason(center: LaneRisk, *, is_vessel_ahead: bool) -> Reason:
    if center.risk >= center.limit:
        return Reason.CENTER_RISK
    return Reason.CENTER_VESSEL if is_vessel_ahead and not center.occupied else Reason.CENTER_OCCUPIED


def _no_side_reason(left: LaneRisk, right: LaneRisk) -> Reason:
    only_occupied = any(side.occupied and side.risk < side.limit for side in (left, right))
    return Reason.NO_SIDE_UNOCCUPIED if only_occupied else Reason.NO_SAFE_SIDE


def _occupied_frames(state: PolicyState, facts: FrameFacts, policy: PolicyConfig) -> tuple[int, int, int]:
    """Consecutive frames in which each lane was filled, counted up to `occupancy_frames` (J6)."""
    left, center, right = (
        min(before + 1, policy.occupancy_frames) if facts.lanes[lane].filling else 0
        for lane, before in zip(LANES, state.occupied_frames, strict=True)
    )
    return left, center, right


def _lane_risk(lane: str, facts: FrameFacts, components: dict[str, LaneComponents], found: Evaluation) -> LaneRisk:
    parts, terms = components[lane], facts.lanes[lane].terms
    return LaneRisk(
        risk=float(parts.risk),
        non_water=float(parts.non_water),
        obstacle=float(parts.obstacle),
        urgency=float(parts.urgency),
        uncertainty=float(parts.uncertainty),
        clear_width=terms.water.clear_width,
        occupied=bool(found.occupied[lane]),
        blocked=bool(found.blocked[lane]),
        track_ids=terms.track_ids,
        limit=facts.lanes[lane].limit,
    )
