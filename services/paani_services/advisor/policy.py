"""The policy: from the risks of three corridors to one direction. Pure.

Thresholds, then overrides (occupancy, a vessel ahead, a lane without water), then the choice of a side, with hysteresis
over distinct frames (J5-J10). It is written once, for all evidence of a frame and for selections of it: `evaluate` maps
the evidence that counts to the input of the policy, and `select_direction` maps that to a direction. The counterfactual
asks both about many selections at once.
"""

from typing import NamedTuple

import msgspec

from paani.config import Config, PolicyConfig
from paani.messages import SIDE_OF, Counterfactual, Direction, LaneRisk, Purpose, Reason
from paani_services.advisor.frame_facts import OPPOSITE_SIDE, FrameFacts, PolicyState, is_search_exhausted
from paani_services.advisor.risk import ALL_EVIDENCE, LANES, LaneComponents, Selection, Truth, Value, lane_components

FULL_TURNS = {"left": Direction.LEFT, "right": Direction.RIGHT}
SLIGHT_TURNS = {"left": Direction.SLIGHT_LEFT, "right": Direction.SLIGHT_RIGHT}
RECORDED_NAMES = {  # of the fields of `PolicyInput` in a recorded state
    "left_blocked": "left",
    "center_blocked": "center",
    "right_blocked": "right",
    "incursion_side": "incursion",
    "preferred_side": "better",
    "retained_turn": "kept",
    "may_search": "looks",
    "is_person_ahead": "person",
}


class PolicyInput(msgspec.Struct, frozen=True, rename=RECORDED_NAMES):
    """Everything that the direction is a function of.

    incursion_side: the side from which obstacles reach into the centre but not into its core. preferred_side: the side
    to take where both are free. retained_turn: a turn whose end has not been clear for long enough. may_search: no way
    has been free for so long that the boat may turn on the spot to find one. is_person_ahead: somebody blocks the
    centre, and nobody is passed by a slight turn.
    """

    left_blocked: bool = True
    center_blocked: bool = True
    right_blocked: bool = True
    incursion_side: str | None = None
    preferred_side: str = "right"
    retained_turn: Direction | None = None
    may_search: bool = False
    is_person_ahead: bool = False


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
    is_person_ahead: Truth


class Decision(msgspec.Struct, frozen=True, rename={"policy_input": "standing"}):
    """One direction, its reason, the lanes that decided it, and what would have changed it."""

    direction: Direction
    reason: Reason
    left: LaneRisk = LaneRisk()
    center: LaneRisk = LaneRisk()
    right: LaneRisk = LaneRisk()
    policy_input: PolicyInput = PolicyInput()
    counterfactual: Counterfactual = Counterfactual()
    speed_limit_mps: float | msgspec.UnsetType = msgspec.UNSET
    people_ahead: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET
    person_distance_m: float | msgspec.UnsetType = msgspec.UNSET
    candidates_ahead: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET
    may_keep_station: bool | msgspec.UnsetType = msgspec.UNSET


def frame_components(facts: FrameFacts, evidence: Selection, config: Config) -> dict[str, LaneComponents]:
    """The risk of each corridor with its components, from the evidence that counts."""
    return {lane: lane_components(facts.lanes[lane].terms, lane, evidence, config.advisor.risk) for lane in LANES}


def evaluate(
    facts: FrameFacts, components: dict[str, LaneComponents], evidence: Selection, config: Config
) -> Evaluation:
    """Apply thresholds and overrides to the evidence that counts (J5-J7, J9).

    components: of the same evidence. An incursion from one edge of the centre is one whose obstacles reach neither its
    core nor its other edge, where the water alone does not block the centre. People who block the centre neither make
    an incursion nor end one: its side stays closed when somebody comes in front of it.
    """
    without_water, occupied, blocked = {}, {}, {}
    for lane, found in facts.lanes.items():
        without_water[lane] = found.is_without_water & evidence.has_water(lane)
        occupied[lane] = evidence.has_any(found.occupying)
        blocked[lane] = (components[lane].risk >= found.limit) | without_water[lane] | occupied[lane]
        blocked[lane] = blocked[lane] | evidence.has_any(found.people) | (found.is_closed & evidence.has_water(lane))
    vessel_ahead = evidence.has_any(facts.vessels_ahead)
    blocked["center"] = blocked["center"] | vessel_ahead
    center, weights = components["center"], config.advisor.risk
    water_risk = weights.non_water * center.non_water + weights.uncertainty * center.uncertainty
    people = facts.lanes["center"].people
    core, left, right = (
        evidence.has_any([i for i in facts.reaching[part] if i not in people]) for part in ("core", "left", "right")
    )
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
        may_search=facts.may_search & shows_water & (True ^ evidence.has_any(facts.near)),
        is_person_ahead=evidence.has_any(people),
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
        is_person_ahead=bool(found.is_person_ahead),
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
    preferred one where both are free; away from an incursion from one edge, slightly where that side is free and nobody
    is ahead; and stops where no side is free, unless the boat may search.
    """
    blocked = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    if not policy_input.center_blocked:
        turn = policy_input.retained_turn
        return turn if turn is not None and not blocked[SIDE_OF[turn]] else Direction.STRAIGHT
    if has_no_free_side(policy_input) and not policy_input.may_search:
        return Direction.STOP
    if policy_input.incursion_side is not None:
        away = OPPOSITE_SIDE[policy_input.incursion_side]  # the other side would turn towards the obstacle
        return FULL_TURNS[away] if blocked[away] or policy_input.is_person_ahead else SLIGHT_TURNS[away]
    free = [side for side in ("left", "right") if not blocked[side]]
    return FULL_TURNS[free[0] if len(free) == 1 else policy_input.preferred_side]


def has_no_free_side(policy_input: PolicyInput) -> bool:
    """Whether the centre is blocked and so is every side that could be taken instead."""
    away = OPPOSITE_SIDE.get(policy_input.incursion_side or "")
    sides = {"left": policy_input.left_blocked, "right": policy_input.right_blocked}
    return policy_input.center_blocked and (sides[away] if away is not None else all(sides.values()))


def advised_purpose(decision: Decision) -> Purpose:
    """What the direction is for: a turn where no side is free is a search, and leads to a side that is blocked."""
    is_search = decision.direction in SIDE_OF and has_no_free_side(decision.policy_input)
    return Purpose.LOOK if is_search else Purpose.PASS


def preferred_side(held: str, needed: float, risks: dict[str, float]) -> str:
    """The side to take where both are free: the one held, unless the other's risk is lower by a clear gain."""
    other = OPPOSITE_SIDE[held]
    return other if _is_clear_gain(risks[held] - risks[other], needed) else held


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
