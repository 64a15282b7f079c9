"""What the policy needs to know of one frame: its risks' terms, limits, occupancy, vessels ahead and sides. Pure.

It is collected once, and evaluated for all evidence of the frame as well as for parts of it; see `policy`.
"""

import math
from typing import NamedTuple

import msgspec

from paani.boxes import area
from paani.config import Config, PolicyConfig
from paani.messages import SIDE_OF, BoxXyxy, Direction, LaneEvidence
from paani_services.advisor.people import people_in_lane, people_near
from paani_services.advisor.risk import LANES, LaneTerms, Obstacle, lane_span, lane_terms, overlap, shared_width

MIN_OCCUPYING_PRESENCE = 0.5  # presence below which an unseen obstacle occupies no lane
OPPOSITE_SIDE = {"left": "right", "right": "left"}


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


class LaneFacts(NamedTuple):
    """One corridor in one frame. Obstacles are given by index.

    limit: the risk at which it is blocked. is_without_water: its water alone blocks it. filling: obstacles low and wide
    enough to occupy it. occupying: those of them that occupy it in this frame. people: who block it. is_closed: it
    shows no way of connected water.
    """

    terms: LaneTerms
    limit: float
    is_without_water: bool
    filling: tuple[int, ...]
    occupying: tuple[int, ...]
    people: tuple[int, ...] = ()
    is_closed: bool = False


class FrameFacts(NamedTuple):
    """One frame as the policy sees it, before it is asked which evidence counts. Obstacles are given by index.

    vessels_ahead: vessels large enough to block the centre (J7). reaching: obstacles in the centre by the part of it
    that they reach, `core`, `left` or `right` edge (J9). held_side: the side to take unless the other one is better by
    `needed_gain`. near: people beside whom the boat does not search.
    """

    lanes: dict[str, LaneFacts]
    obstacles: tuple[Obstacle, ...]
    vessels_ahead: tuple[int, ...]
    reaching: dict[str, tuple[int, ...]]
    held_side: str
    needed_gain: float
    may_search: bool
    near: tuple[int, ...] = ()


def frame_facts(
    state: PolicyState,
    water: dict[str, LaneEvidence],
    obstacles: tuple[Obstacle, ...],
    config: Config,
    aside: tuple[Obstacle, ...] = (),
) -> FrameFacts:
    """Collect what the policy needs of one frame.

    water: of each corridor. state: what the frame before left. aside: people whom the boat has turned away from.
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
            people=people_in_lane(lane, obstacles, config),
            is_closed=is_closed(water[lane], policy),
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
        may_search=may_search(state, config) and not people_near(aside, config),
        near=people_near(obstacles, config),
    )


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


def is_closed(water: LaneEvidence, policy: PolicyConfig) -> bool:
    """Whether the lane shows no way of connected water from the bow; False where the mask was not asked.

    The share of the mask that is probably mistaken counts as no water: what is not sure to be water opens no lane.
    """
    if isinstance(water.open_width, msgspec.UnsetType) or policy.open_width == 0.0:
        return False
    return water.open_width < policy.open_width or water.non_water + water.uncertainty > policy.not_water


def is_vessel_ahead(obstacle: Obstacle, config: Config) -> bool:
    """Whether the obstacle is a vessel whose part inside the centre corridor is large (J7).

    Inside its core where the metric planner acts, because a vessel in an edge of the corridor leaves a way beside it.
    Without a calibration nothing says how far off it is: one that stands in the middle is ahead if it is tall enough.
    """
    if not obstacle.is_vessel or obstacle.presence < MIN_OCCUPYING_PRESENCE:
        return False
    policy, span = config.advisor.policy, lane_span("center", config.perception.corridors)
    if config.is_planner_active:
        span = (policy.core_left, policy.core_right)
    tall, box = policy.center_vessel_height, obstacle.box
    if tall and not config.calibration.valid and span[0] < (box[0] + box[2]) / 2.0 < span[1]:
        return box[3] - box[1] >= tall or area(box) * overlap(box, span) >= policy.center_vessel_area
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
