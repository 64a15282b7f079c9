"""Which evidence decided: the smallest sets without which the advice would be another (beyond J13). Pure.

A piece of evidence is an accepted track that overlaps a corridor, or the water of one corridor; water taken away means
clear, certain water: N = 0 and U = 0. The policy is asked again about the same frame with the same memory, as if the
pieces had been gone for as long as a turn is kept, because a turn that merely lasts has no evidence of its own.

All sets of one size are judged at once: what stands where is worked out for every set, to the bit as `decide` does it,
and the policy's own `direct` names the direction. Each set that is reported has then been put to `decide` itself.
"""

import functools
import itertools
import math
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, Bools
from paani.config import Config, RiskConfig
from paani.messages import ChangedBy, Counterfactual, Direction, Lane, LaneEvidence, Limit, Reason, Removal
from paani_services.advisor.policy import (
    OPPOSITE_SIDE,
    Decision,
    PolicyInput,
    PolicyState,
    decide,
    fills_lane,
    held_side,
    is_vessel_ahead,
    is_without_water,
    lane_risk_limit,
    may_search,
    preferred_side,
    reach_into_center,
    select_direction,
)
from paani_services.advisor.risk import LANES, Obstacle, lane_components, lane_span, overlap

Factors = tuple[tuple[int | None, float], ...]  # of a product: the bit of a piece (None: it stays) and its factor
MAX_TRACKS = 24  # the detector gives no more (C9); beyond that, the least severe are left out
MAX_SHOWN = 3
CLEAR_WATER = LaneEvidence(non_water=0.0, uncertainty=0.0, clear_width=1.0)
SIDES = (None, "left", "right", None)
LIMITS = {"left": Limit.LEFT_RISK, "center": Limit.CENTER_RISK, "right": Limit.RIGHT_RISK}


class Pieces(NamedTuple):
    """What may be taken away, in the order of the bits: tracks by id, then lanes from the left."""

    tracks: tuple[Obstacle, ...]
    water: tuple[str, ...]
    left_out: int

    @property
    def all(self) -> int:
        return len(self.tracks) + len(self.water)


def counterfactual(
    state: PolicyState,
    decision: Decision,
    water: dict[str, LaneEvidence],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> Counterfactual:
    """What would have changed the decision on one frame.

    state: the policy's memory before the frame. water, obstacles: what `decision` was made from. The work is bounded:
    no more than 24 tracks and three lanes, in sets of at most `advisor.counterfactual_size`.
    """
    if decision.direction is Direction.STRAIGHT:
        return Counterfactual()
    if decision.reason is Reason.TURN_RETAINED:
        return Counterfactual(changed_by=ChangedBy.CLEAR_PICTURES)
    limit, margin = nearest_limit(state, decision, obstacles, config)
    if config.advisor.counterfactual_size == 0:
        return Counterfactual(changed_by=ChangedBy.MORE_EVIDENCE, limit=limit, margin=margin)
    pieces = pieces_of(water, obstacles, config)
    scene = _scene(state, pieces, water, obstacles, config)
    judged = 0
    for size in range(1, min(config.advisor.counterfactual_size, pieces.all) + 1):
        sets = _sets_of(pieces.all, size)
        judged += len(sets.members)
        codes = _codes(scene, sets)
        changing = np.flatnonzero(IS_NOT[decision.direction][codes])
        if not changing.size:
            continue
        straight_first = changing[np.argsort(IS_NOT[Direction.STRAIGHT][codes[changing]], kind="stable")]
        removals = [
            _removal(pieces, sets.members[i], state, water, obstacles, config)
            for i in straight_first[:MAX_SHOWN].tolist()
        ]
        return Counterfactual(
            changed_by=ChangedBy.EVIDENCE,
            removals=tuple(removal for removal in removals if removal.direction is not decision.direction),
            found=changing.size,
            judged=judged,
            left_out=pieces.left_out,
            limit=limit,
            margin=margin,
        )
    return Counterfactual(
        changed_by=ChangedBy.MORE_EVIDENCE, judged=judged, left_out=pieces.left_out, limit=limit, margin=margin
    )


def direction_without(
    track_ids: tuple[int, ...],
    lanes: tuple[str, ...],
    state: PolicyState,
    water: dict[str, LaneEvidence],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> Direction:
    """What the policy decides on the same frame without these tracks and without the water of these lanes."""
    seen = tuple(o for o in obstacles if o.id not in track_ids)
    parts = {lane: lane_components(CLEAR_WATER if lane in lanes else water[lane], seen, lane, config) for lane in LANES}
    patient = msgspec.structs.replace(state, clear_frames=config.advisor.policy.clear_frames)
    return decide(patient, parts, seen, config)[1].direction


def pieces_of(water: dict[str, LaneEvidence], obstacles: tuple[Obstacle, ...], config: Config) -> Pieces:
    """Everything that weighs: what overlaps no corridor, and water that adds no risk, changes nothing."""
    spans = [lane_span(lane, config.perception.corridors) for lane in LANES]
    inside = [o for o in obstacles if any(overlap(o.box, span) > 0.0 for span in spans)]
    inside.sort(key=lambda o: (-o.severity * o.presence, o.id))
    return Pieces(
        tracks=tuple(sorted(inside[:MAX_TRACKS], key=lambda o: o.id)),
        water=tuple(lane for lane in LANES if water[lane].non_water > 0.0 or water[lane].uncertainty > 0.0),
        left_out=max(0, len(inside) - MAX_TRACKS),
    )


def nearest_limit(
    state: PolicyState, decision: Decision, obstacles: tuple[Obstacle, ...], config: Config
) -> tuple[Limit, float]:
    """The limit that changes the direction when it alone is crossed, and how far the number lies above it.

    A lane that is blocked by more than its risk is not set free by its risk.
    """
    policy = config.advisor.policy
    lanes = {"left": decision.left, "center": decision.center, "right": decision.right}
    risks = {lane: lanes[lane].risk for lane in LANES}
    policy_input = msgspec.structs.replace(decision.policy_input, retained_turn=None)
    vessel = any(is_vessel_ahead(o, config) for o in obstacles)
    found: list[tuple[float, Limit]] = []
    for lane in LANES:
        limit = lanes[lane].limit
        margin = risks[lane] - limit
        if lanes[lane].occupied or is_without_water(lanes[lane].non_water, policy) or (lane == "center" and vessel):
            continue
        across = risks | {lane: limit if margin < 0.0 else math.nextafter(limit, 0.0)}
        moved = msgspec.structs.replace(
            policy_input, preferred_side=preferred_side(state, across, config), **{f"{lane}_blocked": margin < 0.0}
        )
        if select_direction(moved) is not decision.direction:
            found.append((margin, LIMITS[lane]))
    held, needed = held_side(state, config)
    other_side = msgspec.structs.replace(policy_input, preferred_side=OPPOSITE_SIDE[policy_input.preferred_side])
    if needed < math.inf and select_direction(other_side) is not decision.direction:
        found.append((risks[held] - risks[OPPOSITE_SIDE[held]] - needed, Limit.SIDE_GAIN))
    if not found:
        return Limit.NONE, 0.0
    margin, nearest = min(found, key=lambda each: abs(each[0]))
    return nearest, margin


class _Lane(NamedTuple):
    """One corridor. obstacles, urgencies: the factors of E for the tracks inside, in order.

    water: the bit of its water (None: adds nothing). is_dry: it shows none. occupying: bits of the tracks that do.
    """

    non_water: float
    uncertainty: float
    water: int | None
    is_without_water: bool
    obstacles: Factors
    urgencies: Factors
    occupying: tuple[int | None, ...]
    limit: float


class _Sets(NamedTuple):
    """All sets of a size, in order; kept: pieces x sets, False where taken; taking: the sets that take each piece."""

    members: tuple[tuple[int, ...], ...]
    kept: Bools
    taking: tuple[NDArray[np.intp], ...]


class _Scene(NamedTuple):
    """What every set of pieces is taken from. vessels, places: bits of those ahead, and of those at each place."""

    lanes: dict[str, _Lane]
    vessels: tuple[int | None, ...]
    places: dict[str, tuple[int | None, ...]]
    held: str
    needed: float
    may_search: bool
    water_limit: float
    weights: RiskConfig


def _scene(
    state: PolicyState,
    pieces: Pieces,
    water: dict[str, LaneEvidence],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> _Scene:
    policy = config.advisor.policy
    bit = {track.id: i for i, track in enumerate(pieces.tracks)}
    wet = {lane: len(pieces.tracks) + i for i, lane in enumerate(pieces.water)}
    lanes = {}
    for lane, before in zip(LANES, state.occupied_frames, strict=True):
        span = lane_span(lane, config.perception.corridors)
        inside = [(o, share) for o in obstacles if (share := overlap(o.box, span)) > 0.0]
        filling = [o for o in obstacles if fills_lane(o, lane, config)]
        lasting = before + 1 >= policy.occupancy_frames
        dry = is_without_water(water[lane].non_water, policy)
        lanes[lane] = _Lane(
            non_water=water[lane].non_water,
            uncertainty=water[lane].uncertainty,
            water=wet.get(lane),
            is_without_water=dry,
            obstacles=tuple((bit.get(o.id), 1.0 - o.severity * share * o.presence) for o, share in inside),
            urgencies=tuple((bit.get(o.id), 1.0 - o.urgency * share) for o, share in inside if o.urgency > 0.0),
            occupying=tuple(bit.get(o.id) for o in filling if lasting or o.is_danger),
            limit=lane_risk_limit(lane, state, config),
        )
    middle = lane_span("center", config.perception.corridors)
    places = [(reach_into_center(o.box, policy), bit.get(o.id)) for o in obstacles if overlap(o.box, middle) > 0.0]
    held, needed = held_side(state, config)
    return _Scene(
        lanes=lanes,
        vessels=tuple(bit.get(o.id) for o in obstacles if is_vessel_ahead(o, config)),
        places={name: tuple(i for place, i in places if place == name) for name in ("core", "left", "right")},
        held=held,
        needed=needed,
        may_search=may_search(state, config),
        water_limit=policy.center_block_risk,
        weights=config.advisor.risk,
    )


def _codes(scene: _Scene, sets: _Sets) -> NDArray[np.int64]:
    """What stands where, for each set."""
    count, kept = len(sets.members), sets.kept

    def any_left(bits: tuple[int | None, ...]) -> Bools:
        found: Bools = np.full(count, None in bits)
        for i in bits:
            if i is not None:
                found |= kept[i]
        return found

    def product(factors: Factors) -> F64:
        found = np.ones(count)
        for i, factor in factors:
            if i is None:
                found *= factor
            else:
                without = found[sets.taking[i]]
                found *= factor
                found[sets.taking[i]] = without
        return found

    def risk(lane: _Lane) -> F64:
        wet = np.ones(count, bool) if lane.water is None else kept[lane.water]
        weights = scene.weights
        return np.minimum(
            1.0,
            weights.non_water * np.where(wet, lane.non_water, 0.0)
            + weights.obstacle * np.clip(1.0 - product(lane.obstacles), 0.0, 1.0)
            + weights.urgency * np.clip(1.0 - product(lane.urgencies), 0.0, 1.0)
            + weights.uncertainty * np.where(wet, lane.uncertainty, 0.0),
        )

    risks = {name: risk(lane) for name, lane in scene.lanes.items()}
    dry = {name: any_left((lane.water,) if lane.is_without_water else ()) for name, lane in scene.lanes.items()}
    blocked = {
        name: (risks[name] >= lane.limit) | dry[name] | any_left(lane.occupying) for name, lane in scene.lanes.items()
    }
    center = scene.lanes["center"]
    wet = np.ones(count, bool) if center.water is None else kept[center.water]
    alone = scene.weights.non_water * center.non_water + scene.weights.uncertainty * center.uncertainty
    core, left, right = (any_left(scene.places[name]) for name in ("core", "left", "right"))
    edge = (left != right) & ~core & ~(wet & (alone >= scene.water_limit))
    gain = risks[scene.held] - risks[OPPOSITE_SIDE[scene.held]]
    changes = (gain > 0.0) & (gain >= scene.needed)
    codes: NDArray[np.int64] = (
        blocked["left"] * 1
        + (blocked["center"] | any_left(scene.vessels)) * 2
        + blocked["right"] * 4
        + (changes != (scene.held == "right")) * 8
        + np.where(edge, np.where(left, 16, 32), 0)
        + (scene.may_search & ~(dry["left"] & dry["center"] & dry["right"])) * 64
    )
    return codes


CODES = 128


def _direction_of(code: int) -> Direction:
    return select_direction(
        PolicyInput(
            left_blocked=bool(code & 1),
            center_blocked=bool(code & 2),
            right_blocked=bool(code & 4),
            preferred_side="right" if code & 8 else "left",
            incursion_side=SIDES[code >> 4 & 3],
            may_search=bool(code & 64),
        )
    )


IS_NOT = {
    direction: np.array([_direction_of(code) is not direction for code in range(CODES)]) for direction in Direction
}


@functools.lru_cache(maxsize=3 * (MAX_TRACKS + len(LANES) + 1))
def _sets_of(pieces: int, size: int) -> _Sets:
    members = tuple(itertools.combinations(range(pieces), size))
    kept = np.ones((pieces, len(members)), bool)
    kept[np.array(members).T, np.arange(len(members))] = False
    kept.flags.writeable = False
    return _Sets(members, kept, tuple(np.flatnonzero(~row) for row in kept))


def _removal(
    pieces: Pieces,
    bits: tuple[int, ...],
    state: PolicyState,
    water: dict[str, LaneEvidence],
    obstacles: tuple[Obstacle, ...],
    config: Config,
) -> Removal:
    tracks = len(pieces.tracks)
    ids = tuple(pieces.tracks[i].id for i in bits if i < tracks)
    lanes = tuple(pieces.water[i - tracks] for i in bits if i >= tracks)
    direction = direction_without(ids, lanes, state, water, obstacles, config)
    return Removal(direction=direction, track_ids=ids, water=tuple(Lane(lane) for lane in lanes))
