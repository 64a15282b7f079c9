"""The counterfactual of a decision: the smallest sets of evidence without which the direction would be another. Pure.

A piece of evidence is an accepted track that overlaps a corridor, or the water of one corridor; water taken away means
clear, certain water: N = 0 and U = 0. The policy itself is asked again about the same frame with the same memory
(beyond J13): `evaluate` about all sets of one size at once, as arrays, and `select_direction` about what follows. It is
asked as if the pieces had been gone for as long as a turn is retained, because a retained turn has no evidence.
"""

import functools
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, Bools
from paani.config import Config
from paani.messages import ChangedBy, Counterfactual, Direction, Lane, Limit, Reason, Removal
from paani_services.advisor.frame_facts import OPPOSITE_SIDE, FrameFacts
from paani_services.advisor.policy import (
    Decision,
    Evaluation,
    PolicyInput,
    evaluate,
    frame_components,
    preferred_side,
    select_direction,
)
from paani_services.advisor.risk import LANES, Operands, Truth, Value

MAX_TRACKS = 24  # the detector gives no more (C9); beyond that, the least severe are left out
MAX_PIECES = MAX_TRACKS + len(LANES)
MAX_SHOWN = 3  # sets that the advisory carries
LIMITS = {"left": Limit.LEFT_RISK, "center": Limit.CENTER_RISK, "right": Limit.RIGHT_RISK}


class Pieces(NamedTuple):
    """The evidence that may be taken away: obstacles by index, in the order of their tracks' ids, then lanes.

    left_out: tracks beyond `MAX_TRACKS`, which always stay.
    """

    obstacles: tuple[int, ...]
    water: tuple[str, ...]
    left_out: int

    @property
    def total(self) -> int:
        return len(self.obstacles) + len(self.water)


class Subsets(NamedTuple):
    """All sets of one size out of some pieces, in order.

    members: the pieces of each set [sets, size]. kept: False where the set takes the piece away [pieces, sets].
    taking: of each piece, the sets that take it away [pieces, sets of it].
    """

    members: NDArray[np.uint8]
    kept: Bools
    taking: NDArray[np.intp]


class WithoutSubsets:
    """The selections of evidence that remain after each of the sets is taken away; see `risk.Selection`."""

    def __init__(self, pieces: Pieces, subsets: Subsets) -> None:
        self._subsets = subsets
        self._piece_of_obstacle = {i: piece for piece, i in enumerate(pieces.obstacles)}
        self._piece_of_water = {lane: len(pieces.obstacles) + i for i, lane in enumerate(pieces.water)}

    def has_water(self, lane: str) -> Truth:
        """Whether the water of the lane remains; it does where it is no piece."""
        piece = self._piece_of_water.get(lane)
        return True if piece is None else self._subsets.kept[piece]

    def water_value(self, lane: str, value: float) -> Value:
        """The value of a term of the lane's water, or 0 where that is taken away."""
        piece = self._piece_of_water.get(lane)
        return value if piece is None else np.where(self._subsets.kept[piece], value, 0.0)

    def has_any(self, obstacles: Sequence[int]) -> Truth:
        """Whether any of these obstacles remains; one that is no piece always does."""
        if not obstacles:
            return False
        pieces = [self._piece_of_obstacle.get(i) for i in obstacles]
        found: Bools = np.full(len(self._subsets.members), None in pieces)
        for piece in pieces:
            if piece is not None:
                found |= self._subsets.kept[piece]
        return found

    def noisy_or(self, operands: Operands) -> Value:
        """Noisy-OR of the operands that remain, in the order of the scalar one, so that no bit differs."""
        none: F64 = np.ones(len(self._subsets.members))
        for i, value in operands:
            piece = self._piece_of_obstacle.get(i)
            if piece is None:
                none *= 1.0 - value
            else:
                taking = self._subsets.taking[piece]
                without = none[taking]
                none *= 1.0 - value
                none[taking] = without
        return np.minimum(np.maximum(1.0 - none, 0.0), 1.0)


def prepare_subsets(config: Config) -> None:
    """Make the tables of every set that may be asked for, so that neither memory nor a step grows when one first is."""
    for pieces in range(1, MAX_PIECES + 1):
        for size in range(1, min(config.advisor.counterfactual_size, pieces) + 1):
            _subsets(pieces, size)


def find_counterfactual(facts: FrameFacts, decision: Decision, config: Config) -> Counterfactual:
    """Find what would have changed the decision on one frame.

    facts: what `decision` was made from. The work is bounded: no more than 24 tracks and three lanes, in sets of at
    most `advisor.counterfactual_size`.
    """
    if decision.direction is Direction.STRAIGHT:
        return Counterfactual()
    if decision.reason is Reason.TURN_RETAINED:
        return Counterfactual(changed_by=ChangedBy.CLEAR_PICTURES)
    limit, margin = nearest_limit(facts, decision)
    if config.advisor.counterfactual_size == 0:
        return Counterfactual(changed_by=ChangedBy.MORE_EVIDENCE, limit=limit, margin=margin)
    pieces = removable_pieces(facts)
    judged = 0
    for size in range(1, min(config.advisor.counterfactual_size, pieces.total) + 1):
        subsets = _subsets(pieces.total, size)
        judged += len(subsets.members)
        remaining = WithoutSubsets(pieces, subsets)
        indices = _input_indices(evaluate(facts, frame_components(facts, remaining, config), remaining, config))
        changing = np.flatnonzero(IS_NOT[decision.direction][indices])
        if not changing.size:
            continue
        straight_first = changing[np.argsort(IS_NOT[Direction.STRAIGHT][indices[changing]], kind="stable")]
        return Counterfactual(
            changed_by=ChangedBy.EVIDENCE,
            removals=tuple(
                _removal(facts, pieces, subsets.members[i].tolist(), DIRECTIONS[indices[i]])
                for i in straight_first[:MAX_SHOWN].tolist()
            ),
            found=changing.size,
            judged=judged,
            left_out=pieces.left_out,
            limit=limit,
            margin=margin,
        )
    return Counterfactual(
        changed_by=ChangedBy.MORE_EVIDENCE, judged=judged, left_out=pieces.left_out, limit=limit, margin=margin
    )


def removable_pieces(facts: FrameFacts) -> Pieces:
    """All evidence that has a weight: a track outside every corridor, or water without risk, changes nothing."""
    obstacles = facts.obstacles
    inside = list({i: None for lane in facts.lanes.values() for i, _ in lane.terms.obstacles})
    inside.sort(key=lambda i: (-obstacles[i].severity * obstacles[i].presence, obstacles[i].id))
    water = {name: lane.terms.water for name, lane in facts.lanes.items()}
    return Pieces(
        obstacles=tuple(sorted(inside[:MAX_TRACKS], key=lambda i: obstacles[i].id)),
        water=tuple(lane for lane in LANES if water[lane].non_water > 0.0 or water[lane].uncertainty > 0.0),
        left_out=max(0, len(inside) - MAX_TRACKS),
    )


def nearest_limit(facts: FrameFacts, decision: Decision) -> tuple[Limit, float]:
    """The limit that changes the direction when it alone is crossed, and how far the number lies above it.

    The risk of a lane that something else blocks as well has no such limit.
    """
    lanes = {"left": decision.left, "center": decision.center, "right": decision.right}
    risks = {lane: lanes[lane].risk for lane in LANES}
    held, needed = facts.held_side, facts.needed_gain
    policy_input = msgspec.structs.replace(decision.policy_input, retained_turn=None)
    found: list[tuple[float, Limit]] = []
    for lane in LANES:
        limit = lanes[lane].limit
        margin = risks[lane] - limit
        found_in = facts.lanes[lane]
        is_barred = found_in.is_without_water or found_in.is_closed or bool(found_in.people)
        if lanes[lane].occupied or is_barred or (lane == "center" and facts.vessels_ahead):
            continue
        across = risks | {lane: limit if margin < 0.0 else math.nextafter(limit, 0.0)}
        moved = msgspec.structs.replace(
            policy_input, preferred_side=preferred_side(held, needed, across), **{f"{lane}_blocked": margin < 0.0}
        )
        if select_direction(moved) is not decision.direction:
            found.append((margin, LIMITS[lane]))
    other_side = msgspec.structs.replace(policy_input, preferred_side=OPPOSITE_SIDE[policy_input.preferred_side])
    if needed < math.inf and select_direction(other_side) is not decision.direction:
        found.append((risks[held] - risks[OPPOSITE_SIDE[held]] - needed, Limit.SIDE_GAIN))
    if not found:
        return Limit.NONE, 0.0
    margin, nearest = min(found, key=lambda each: abs(each[0]))
    return nearest, margin


def _input_indices(found: Evaluation) -> NDArray[np.int64]:
    """The index in `POLICY_INPUTS` of what follows from each set."""
    indices: NDArray[np.int64] = (
        found.blocked["left"] * np.int64(1)
        + found.blocked["center"] * np.int64(2)
        + found.blocked["right"] * np.int64(4)
        + found.prefers_right * np.int64(8)
        + found.left_incursion * np.int64(16)
        + found.right_incursion * np.int64(32)
        + found.may_search * np.int64(64)
        + found.is_person_ahead * np.int64(128)
    )
    return indices


POLICY_INPUTS = tuple(
    PolicyInput(
        left_blocked=bool(index & 1),
        center_blocked=bool(index & 2),
        right_blocked=bool(index & 4),
        preferred_side="right" if index & 8 else "left",
        incursion_side="left" if index & 16 else "right" if index & 32 else None,
        may_search=bool(index & 64),
        is_person_ahead=bool(index & 128),
    )
    for index in range(256)
)
DIRECTIONS = tuple(map(select_direction, POLICY_INPUTS))
IS_NOT = {direction: np.array([found is not direction for found in DIRECTIONS]) for direction in Direction}


@functools.lru_cache(maxsize=3 * (MAX_PIECES + 1))
def _subsets(pieces: int, size: int) -> Subsets:
    members = np.array(list(itertools.combinations(range(pieces), size)), np.uint8)
    kept = np.ones((pieces, len(members)), bool)
    kept[members.T, np.arange(len(members))] = False
    kept.flags.writeable = False
    return Subsets(members, kept, np.flatnonzero(~kept).reshape(pieces, -1) % len(members))


def _removal(facts: FrameFacts, pieces: Pieces, taken: Sequence[int], direction: Direction) -> Removal:
    tracks = len(pieces.obstacles)
    obstacles = [facts.obstacles[pieces.obstacles[i]] for i in taken if i < tracks]
    return Removal(
        direction=direction,
        track_ids=tuple(o.id for o in obstacles if o.candidate is None),
        candidates=tuple(o.candidate for o in obstacles if o.candidate is not None) or msgspec.UNSET,
        water=tuple(Lane(pieces.water[i - tracks]) for i in taken if i >= tracks),
    )
