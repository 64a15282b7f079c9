"""Each limit of the policy at equality, and the part of a frame that each reason, lane and memory rests on."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani.config import load_config
from paani_services.advisor.frame_facts import PolicyState
from paani_services.advisor.policy import (
    Decision,
    PolicyInput,
    decide,
    frame_components,
    preferred_side,
    select_direction,
)
from paani_services.advisor.risk import ALL_EVIDENCE, Obstacle
from tests.unit.paani_services.advisor.advisor_evidence import CLEAR, PAANI, PAPER, box, lane, play, seeing
from tests.unit.paani_services.advisor.advisor_scenes import Scene

D, R = m.Direction, m.Reason
VESSEL, BUOY, PIER = m.Label.VESSEL, m.Label.BUOY, m.Label.PIER
EDGE = box(PIER, (0.30, 0.35, 0.40, 0.50), 0.9)  # it reaches into the centre from the left, and not into its core


@pytest.mark.parametrize(("center", "turn"), [
    (lane(0.40), D.SLIGHT_RIGHT),
    (lane(0.48), D.RIGHT),  # equality blocks
    (m.LaneEvidence(non_water=0.8, uncertainty=0.2), D.SLIGHT_RIGHT),
    (m.LaneEvidence(non_water=0.8, uncertainty=0.3), D.RIGHT),  # what is uncertain adds to it
])  # fmt: skip
def test_an_incursion_is_one_where_the_water_alone_does_not_block(center: m.LaneEvidence, turn: m.Direction) -> None:
    """J9."""
    _, advice, _ = play([msgspec.structs.replace(seeing(EDGE), center=center)] * 2, PAPER)
    assert advice[1].center.blocked
    assert advice[1].direction is turn


def test_obstacles_at_both_edges_are_no_incursion() -> None:
    """J9: whichever side it turned to, a slight turn would lead towards one of them."""
    other = box(PIER, (0.60, 0.35, 0.70, 0.50), 0.9)
    frame = msgspec.structs.replace(seeing(EDGE, other), center=lane(0.40), left=lane(0.2))
    assert play([frame] * 2, PAPER)[1][1].direction is D.RIGHT
    assert play([msgspec.structs.replace(frame, left=CLEAR.left, right=lane(0.2))] * 2, PAPER)[1][1].direction is D.LEFT


@pytest.mark.parametrize(
    "dry",
    [
        m.LaneEvidence(non_water=1.0, uncertainty=0.0, clear_width=0.0),
        m.LaneEvidence(non_water=0.1, uncertainty=0.0, clear_width=0.9, open_width=0.0),
    ],
    ids=["without-water", "closed"],
)
def test_a_lane_that_its_water_blocks_would_be_free_without_it(dry: m.LaneEvidence) -> None:
    _, advice, _ = play([msgspec.structs.replace(CLEAR, center=dry)])
    assert advice[0].direction is D.RIGHT
    assert advice[0].counterfactual.removals[0] == m.Removal(direction=D.STRAIGHT, water=(m.Lane.CENTER,))


def test_a_search_turns_fully_to_a_side_that_is_blocked() -> None:
    """No slight turn leads into it, also where an obstacle reaches in from the other side."""
    found = PolicyInput(incursion_side="left", may_search=True)
    assert select_direction(found) is D.RIGHT
    assert select_direction(msgspec.structs.replace(found, right_blocked=False)) is D.SLIGHT_RIGHT


@pytest.mark.parametrize(("held", "needed", "left", "right", "side"), [
    ("left", 0.25, 0.5, 0.25, "right"),  # equality is enough
    ("left", 0.25, 0.5, 0.375, "left"),
    ("left", 0.25, 0.25, 0.75, "left"),
    ("right", 0.0, 0.5, 0.5, "right"),  # no gain is none
    ("right", 0.0, 0.25, 0.5, "left"),
])  # fmt: skip
def test_the_held_side_is_kept_up_to_a_clear_gain(
    held: str, needed: float, left: float, right: float, side: str
) -> None:
    assert preferred_side(held, needed, {"left": left, "right": right}) == side


def sides(left: float, right: float, *obstacles: Obstacle, sets: tuple[str, ...]) -> Decision:
    """What is decided about a blocked centre between sides whose water is a risk of exactly this."""
    risks = {"left": left, "center": 0.75, "right": right}
    lanes = {name: m.LaneEvidence(non_water=risk, uncertainty=0.0) for name, risk in risks.items()}
    config = load_config(sets=("advisor.risk.non_water=1", *sets))
    return Scene(PolicyState(), lanes, obstacles).decided(config)


@pytest.mark.parametrize(("left", "right", "direction", "reason"), [
    (0.25, 0.375, D.LEFT, R.CENTER_RISK),  # better by the width of a tie
    (0.25, 0.3125, D.RIGHT, R.TIE_STARBOARD),
    (0.3125, 0.25, D.RIGHT, R.TIE_STARBOARD),
    (0.375, 0.25, D.RIGHT, R.CENTER_RISK),
])  # fmt: skip
def test_sides_that_differ_by_the_width_of_a_tie_are_none(
    left: float, right: float, direction: m.Direction, reason: m.Reason
) -> None:
    found = sides(left, right, sets=("advisor.policy.tie=0.125",))
    assert (found.direction, found.reason) == (direction, reason)


@pytest.mark.parametrize(("bottom", "reason"), [(0.60, R.CENTER_VESSEL), (0.70, R.CENTER_OCCUPIED)])
def test_a_vessel_ahead_is_the_reason_unless_it_fills_the_lane(bottom: float, reason: m.Reason) -> None:
    """J6, J7: below the limit of the risk."""
    hull = box(VESSEL, (0.40, bottom - 0.2, 0.60, bottom), 0.42)
    _, advice, _ = play([msgspec.structs.replace(seeing(hull), left=lane(0.3))] * 3)
    assert advice[2].center.risk < advice[2].center.limit
    assert (advice[2].direction, advice[2].reason) == (D.RIGHT, reason)


@pytest.mark.parametrize(("risk", "reason"), [(0.5, R.NO_SIDE_UNOCCUPIED), (0.625, R.NO_SAFE_SIDE)])
def test_an_occupied_side_at_its_limit_is_blocked_by_its_risk(risk: float, reason: m.Reason) -> None:
    """J5, J6: the limit is 0.625 here, and what fills the side weighs nothing."""
    moored = Obstacle(1, False, (0.70, 0.5, 0.95, 0.7), 0.0, 0.0, 1.0, is_danger=True)
    found = sides(0.75, risk, moored, sets=("advisor.policy.side_block_risk=0.625",))
    assert found.right.risk == risk
    assert (found.direction, found.reason) == (D.STOP, reason)


def test_occupancy_counts_one_frame_at_a_time() -> None:
    """J6: what is filled in the third frame of three occupies."""
    config = load_config(sets=["advisor.policy.occupancy_frames=3"])
    low = box(BUOY, (0.45, 0.62, 0.58, 0.68), 0.42)
    _, advice, _ = play([seeing(low)] * 5, config)
    assert [a.center.occupied for a in advice] == [False, False, False, True, True]


def test_a_lane_remembers_that_it_was_blocked() -> None:
    lanes = {"left": lane(0.1), "center": lane(0.5), "right": lane(0.6)}
    facts = Scene(PolicyState(), lanes, ()).facts(PAANI)
    state, _ = decide(PolicyState(), facts, frame_components(facts, ALL_EVIDENCE, PAANI), PAANI)
    assert state.blocked == (False, True, True)


def test_a_lane_says_how_urgent_it_is_and_how_much_of_it_is_clear() -> None:
    growing = [box(VESSEL, (0.46 - w, 0.45 - w, 0.54 + w, 0.55 + w), 0.8) for w in (0.0, 0.01, 0.02, 0.03, 0.05, 0.07)]
    frames = [msgspec.structs.replace(seeing(hull), left=lane(0.11)) for hull in growing]
    _, advice, _ = play(frames)
    last = advice[-1]
    assert last.center.urgency > 0.1 > last.left.urgency
    assert last.left.clear_width == pytest.approx(0.8)
