"""Thresholds, overrides, permitted sides and hysteresis."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, load_config
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.policy import advised_purpose
from tests.unit.paani_services.advisor.advisor_evidence import (
    CALIBRATED,
    CLEAR,
    PAANI,
    PAPER,
    box,
    lane,
    murky,
    play,
    seeing,
    water,
)
from tests.unit.paani_services.advisor.advisor_scenes import Scene, scenes

D, R = m.Direction, m.Reason
VESSEL, BUOY, PIER = m.Label.VESSEL, m.Label.BUOY, m.Label.PIER


@pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
@pytest.mark.parametrize(
    ("risks", "blocked", "direction", "reason"),
    [
        pytest.param((0.3413, 0.2941, 0.1611), "", D.STRAIGHT, R.CENTER_CLEAR, id="V11-47266"),
        pytest.param((0.4976, 0.5114, 0.4573), "center", D.RIGHT, R.CENTER_RISK, id="V12-01703"),
        pytest.param((0.3367, 0.4716, 0.6280), "right", D.STRAIGHT, R.CENTER_CLEAR, id="V13-27011"),
        pytest.param((0.0288, 0.0004, 0.0029), "", D.STRAIGHT, R.CENTER_CLEAR, id="V15-black-ungated"),
    ],
)
def test_table_of_scenarios(
    config: Config, risks: tuple[float, float, float], blocked: str, direction: m.Direction, reason: m.Reason
) -> None:
    """V11, V12, V13, V15, J5: the lanes' published risks give the published advice, frame after frame (U8: 8)."""
    _, advice, _ = play([water(*risks)] * 8, config, period_s=0.1)
    for advised in advice:
        assert (advised.direction, advised.reason) == (direction, reason)
        assert (advised.left.risk, advised.center.risk, advised.right.risk) == pytest.approx(risks)
        assert [name for name in ("left", "center", "right") if getattr(advised, name).blocked] == blocked.split()


def test_v12_the_vessel_at_the_edge_of_the_frame_has_unknown_motion() -> None:
    """V12: the box weighs in the risk all the same; the water beside it makes up the published sums."""
    confidence, xyxy = 0.85723, (0.0, 0.36, 0.28, 0.50)
    seen = confidence * (0.6 * (0.50 - 0.30) / 0.70 + 0.4 * 0.14 / 0.50) * (0.28 - 0.03) / 0.28  # J1, J2
    risks = {"left": 0.4976, "center": 0.5114, "right": 0.4573}
    lanes = {name: lane(risk - 0.65 * seen * (name == "left")) for name, risk in risks.items()}
    evidence = msgspec.structs.replace(seeing(box(VESSEL, xyxy, confidence)), **lanes)
    _, advice, tracks = play([evidence] * 8, PAPER, period_s=0.1)
    vessel, advised = tracks[-1].tracks[0], advice[-1]
    assert vessel.confidence == pytest.approx(confidence)
    assert (vessel.motion, vessel.motion_cause) == (m.MotionState.UNKNOWN, m.MotionCause.CLIPPED_BY_FRAME)
    assert {name: getattr(advised, name).risk for name in risks} == pytest.approx(risks)
    assert (advised.direction, advised.reason) == (D.RIGHT, R.CENTER_RISK)


def test_v14_a_side_below_its_limit_may_still_be_occupied() -> None:
    """V14, J6: .6615/.6025/.4489 is STOP because the right lane is occupied, not because of its score."""
    risks = (0.6615, 0.6025, 0.4489)
    moored = box(BUOY, (0.70, 0.56, 0.95, 0.66), 0.45)
    obstacle = 0.45 * (0.6 * (0.66 - 0.30) / 0.70 + 0.4 * 0.10 / 0.50)
    evidence = msgspec.structs.replace(water(risks[0], risks[1], risks[2] - 0.65 * obstacle), detections=(moored,))
    _, advice, _ = play([evidence])
    assert (advice[0].left.risk, advice[0].center.risk, advice[0].right.risk) == pytest.approx(risks, abs=1e-9)
    assert (advice[0].direction, advice[0].reason) == (D.STOP, R.NO_SIDE_UNOCCUPIED)
    assert advice[0].right.occupied
    assert not advice[0].left.occupied


@pytest.mark.parametrize(
    ("risks", "direction", "reason"),
    [
        ((0.60, 0.60, 0.60), D.STOP, R.NO_SAFE_SIDE),
        ((0.58, 0.48, 0.58), D.STOP, R.NO_SAFE_SIDE),  # thresholds block at equality
        ((0.10, 0.48, 0.60), D.LEFT, R.CENTER_RISK),
        ((0.60, 0.48, 0.10), D.RIGHT, R.CENTER_RISK),
        ((0.30, 0.50, 0.40), D.LEFT, R.CENTER_RISK),
        ((0.30, 0.50, 0.31), D.RIGHT, R.TIE_STARBOARD),
        ((0.30, 0.4799, 0.31), D.STRAIGHT, R.CENTER_CLEAR),
    ],
)
def test_thresholds_and_sides(risks: tuple[float, float, float], direction: m.Direction, reason: m.Reason) -> None:
    """J5, J8: equality blocks; the side of lower risk; starboard where both differ by less than a tie."""
    _, advice, _ = play([water(*risks)])
    assert (advice[0].direction, advice[0].reason) == (direction, reason)


def test_a_tie_keeps_the_side_in_progress() -> None:
    """Left by risk first, then both sides alike: still left, and the reason says so."""
    _, advice, _ = play([water(0.30, 0.50, 0.40), water(0.40, 0.50, 0.39)])
    assert (advice[1].direction, advice[1].reason) == (D.LEFT, R.TIE_KEPT_SIDE)


def test_a_tie_resumes_the_side_after_a_stop() -> None:
    _, advice, _ = play([water(0.30, 0.50, 0.40), water(0.60, 0.60, 0.60), water(0.40, 0.50, 0.39)])
    assert [a.direction for a in advice] == [D.LEFT, D.STOP, D.LEFT]


@pytest.mark.parametrize(
    ("xyxy", "direction", "reason"),
    [
        pytest.param((0.30, 0.30, 0.40, 0.62), D.SLIGHT_RIGHT, R.CENTER_EDGE_INCURSION, id="left-edge"),
        pytest.param((0.60, 0.30, 0.70, 0.62), D.SLIGHT_LEFT, R.CENTER_EDGE_INCURSION, id="right-edge"),
        pytest.param((0.40, 0.30, 0.50, 0.62), D.RIGHT, R.CENTER_RISK, id="core"),
        pytest.param((0.305, 0.30, 0.4049, 0.62), D.SLIGHT_RIGHT, R.CENTER_EDGE_INCURSION, id="up-to-the-core"),
        pytest.param((0.305, 0.30, 0.4051, 0.62), D.RIGHT, R.CENTER_RISK, id="into-the-core"),
        pytest.param((0.5951, 0.30, 0.695, 0.62), D.SLIGHT_LEFT, R.CENTER_EDGE_INCURSION, id="from-the-core-on"),
        pytest.param((0.5949, 0.30, 0.695, 0.62), D.LEFT, R.CENTER_RISK, id="into-the-core-from-the-right"),
    ],
)
@pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
def test_j9_edge_is_slight_and_core_is_full(
    config: Config, xyxy: m.BoxXyxy, direction: m.Direction, reason: m.Reason
) -> None:
    """J9: an obstacle in an edge of the centre corridor is a slight turn, one in its core a full turn."""
    evidence = msgspec.structs.replace(
        CLEAR, left=lane(0.25), center=lane(0.30), right=lane(0.20), detections=(box(PIER, xyxy, 0.9),)
    )
    if direction is D.SLIGHT_LEFT:
        evidence = msgspec.structs.replace(evidence, left=lane(0.20), right=lane(0.25))
    _, advice, _ = play([evidence] * 2, config)
    assert advice[1].center.risk >= 0.48
    assert (advice[1].direction, advice[1].reason) == (direction, reason)


def test_an_edge_incursion_never_turns_towards_it() -> None:
    """J8, J9: the far side is blocked, so it stops although the near side has a low risk."""
    evidence = msgspec.structs.replace(
        CLEAR, center=lane(0.30), right=lane(0.65), detections=(box(PIER, (0.30, 0.30, 0.40, 0.62), 0.9),)
    )
    _, advice, _ = play([evidence] * 2)
    assert (advice[1].direction, advice[1].reason) == (D.STOP, R.NO_SAFE_SIDE)


def test_blocking_water_is_no_edge_incursion() -> None:
    evidence = msgspec.structs.replace(CLEAR, center=lane(0.50), detections=(box(PIER, (0.30, 0.30, 0.40, 0.62), 0.9),))
    _, advice, _ = play([evidence] * 2)
    assert advice[1].direction is D.RIGHT


def test_j6_occupancy_needs_two_distinct_frames() -> None:
    """J6: low and a quarter of the lane wide, in two distinct frames; by score alone the centre would be clear."""
    low = box(BUOY, (0.45, 0.62, 0.58, 0.68), 0.42)  # area 0.0078: no immediate danger
    _, advice, _ = play([msgspec.structs.replace(seeing(low), right=lane(0.01))] * 3)
    assert [a.center.occupied for a in advice] == [False, False, True]  # accepted at 2, then 2 frames occupied
    assert advice[2].center.risk < 0.48
    assert (advice[2].direction, advice[2].reason) == (D.RIGHT, R.CENTER_OCCUPIED)


def test_j6_immediate_danger_occupies_at_once() -> None:
    """J6, G5."""
    near = box(BUOY, (0.42, 0.56, 0.58, 0.70), 0.41)
    _, advice, _ = play([msgspec.structs.replace(seeing(near), left=lane(0.2), right=lane(0.05))])
    assert advice[0].center.occupied
    assert advice[0].center.risk < 0.48
    assert (advice[0].direction, advice[0].reason) == (D.RIGHT, R.CENTER_OCCUPIED)


@pytest.mark.parametrize(
    ("label", "clear", "calibrated", "occupied"),
    [
        (PIER, 1.0, True, False),
        (PIER, 0.55, True, False),
        (PIER, 0.5, True, True),
        (PIER, 1.0, False, True),
        (VESSEL, 1.0, True, True),
    ],
)
def test_a_quay_occupies_no_lane_that_shows_water_across_more_than_half(
    label: m.Label, clear: float, calibrated: bool, occupied: bool
) -> None:
    """The box of an oblique quay reaches down to its near end, across lanes of open water where its foot is not.

    Without this rule the boat stops before an open canal.
    """
    quay = box(label, (0.31, 0.3, 1.0, 0.8))
    water = msgspec.structs.replace(lane(0.05), clear_width=clear)
    evidence = msgspec.structs.replace(seeing(quay), left=water, center=water, right=water)
    config = CALIBRATED if calibrated else PAANI
    _, advice, _ = play([evidence] * 4, config)
    assert advice[-1].center.occupied is occupied
    assert advice[-1].right.occupied is occupied


HULLS = (box(VESSEL, (0.02, 0.3, 0.36, 0.6), 0.9), box(VESSEL, (0.64, 0.3, 0.98, 0.6), 0.9))


@pytest.mark.parametrize(("hulls", "calibrated", "stops"), [((), False, True), ((), True, False), (HULLS, True, True)])
def test_a_side_is_blocked_later_where_the_metric_planner_acts(
    hulls: tuple[m.Detection, ...], calibrated: bool, stops: bool
) -> None:
    """Where the metric planner judges whether there is room, a side is blocked at 0.75.

    Hulls moored along a harbour make risks of 0.57 to 0.66 on both sides with open water between them.
    """
    side = murky(0.63)
    evidence = msgspec.structs.replace(CLEAR, center=lane(0.6), left=side, right=side, detections=hulls)
    _, advice, _ = play([evidence] * 4, CALIBRATED if calibrated else PAANI)
    assert (advice[-1].direction is D.STOP) is stops
    assert advice[-1].side_block_risk == (0.75 if calibrated else 0.58)


FANS = msgspec.structs.replace(load_config(profile="fans"), calibration=CALIBRATED.calibration)
NO_WATER = water(0.55, 0.65, 0.70)
BLOCKED_ALL_ROUND = msgspec.structs.replace(NO_WATER, center=murky(0.6))


@pytest.mark.parametrize(
    ("config", "frame", "searches"),
    [
        (CALIBRATED, BLOCKED_ALL_ROUND, True),
        (CALIBRATED, NO_WATER, False),  # no water anywhere: a covered lens may read so
        (PAANI, BLOCKED_ALL_ROUND, False),  # no map of what lies beside the boat
        (FANS, BLOCKED_ALL_ROUND, False),  # it cannot turn on the spot
        (PAPER, water(0.6, 0.65, 0.65), False),  # J5
    ],
    ids=["paani", "no-water", "uncalibrated", "fans", "paper"],
)
def test_after_forty_frames_without_a_free_side_the_boat_searches(
    config: Config, frame: m.Evidence, searches: bool
) -> None:
    """STOP for 40 frames, then a turn to the better side, kept whatever the risks are until a side is free.

    It lets a boat before a hull find the open water abeam. The navigator sees to it that the boat only turns.
    """
    state, advice, _ = play([frame] * 60, config)
    assert [a.direction for a in advice[:40]] == [D.STOP] * 40
    assert {(a.direction, a.reason) for a in advice[40:]} == (
        {(D.LEFT, R.NO_SIDE_FOR_LONG)} if searches else {(D.STOP, advice[0].reason)}
    )
    turned = msgspec.structs.replace(frame, left=frame.right, right=frame.left)
    state, after, _ = play([turned] * 3 + [CLEAR] * 3 + [frame], config, state=state, first_seq=60)
    assert [a.direction for a in after[:3]] == [D.LEFT if searches else D.STOP] * 3
    assert after[5].direction is D.STRAIGHT
    assert after[6].direction is D.STOP  # anew


def test_a_search_without_result_goes_on_to_the_other_side() -> None:
    """16 s to each side, however little the picture changes."""
    state, advice, _ = play([BLOCKED_ALL_ROUND] * 360, CALIBRATED)
    assert [a.direction for a in advice] == [D.STOP] * 40 + ([D.LEFT] * 80 + [D.RIGHT] * 80) * 2
    assert {a.reason for a in advice[40:]} == {R.NO_SIDE_FOR_LONG}
    _, after, _ = play([CLEAR] * 3 + [BLOCKED_ALL_ROUND] * 40, CALIBRATED, state=state, first_seq=360)
    assert {a.direction for a in after[3:]} == {D.STOP}  # anew


def test_a_frame_without_water_ends_the_search() -> None:
    """STOP however long it has searched, and it waits anew."""
    state, advice, _ = play([BLOCKED_ALL_ROUND] * 45, CALIBRATED)
    assert advice[-1].reason is R.NO_SIDE_FOR_LONG
    _, after, _ = play([NO_WATER, *[BLOCKED_ALL_ROUND] * 39], CALIBRATED, state=state, first_seq=45)
    assert {a.direction for a in after} == {D.STOP}


def test_occupancy_does_not_count_republishes() -> None:
    """J6, J10: the same frame again is no second frame."""
    low = box(BUOY, (0.45, 0.62, 0.58, 0.68), 0.42)
    state, _, _ = play([seeing(low)] * 2)
    evidence = state.evidence
    assert evidence is not None
    for repeat in range(5):
        state, advised, _ = advise(state, evidence, evidence.source_us + 1000 * repeat, PAANI)
        assert not advised.center.occupied


def test_j7_center_vessel() -> None:
    """J7: a vessel whose part inside the centre is at least 0.04 blocks it, a pier of that size does not."""
    large = (0.40, 0.22, 0.60, 0.43)
    sides = {"left": lane(0.2), "right": lane(0.05)}
    config = load_config(sets=["advisor.policy.center_vessel_height=0"])
    for label, direction in ((VESSEL, D.RIGHT), (PIER, D.STRAIGHT)):
        _, advice, _ = play([msgspec.structs.replace(seeing(box(label, large, 0.6)), **sides)] * 2, config)
        assert advice[1].center.risk < 0.48
        assert advice[1].direction is direction
        if label is VESSEL:
            assert advice[1].reason is R.CENTER_VESSEL


def test_j10_a_turn_is_kept_until_two_distinct_clear_frames() -> None:
    """J10: turn, one clear frame keeps it, the second releases it; a republish never counts."""
    blocked, clear = water(0.05, 0.50, 0.30), CLEAR
    state, advice, _ = play([blocked, clear])
    assert [(a.direction, a.reason) for a in advice] == [(D.LEFT, R.CENTER_RISK), (D.LEFT, R.TURN_RETAINED)]
    evidence = state.evidence
    assert evidence is not None
    for repeat in range(5):
        state, advised, _ = advise(state, evidence, evidence.source_us + 10_000 * repeat, PAANI)
        assert advised.reason is R.TURN_RETAINED
    _, advice, _ = play([clear], state=state, first_seq=2)
    assert (advice[0].direction, advice[0].reason) == (D.STRAIGHT, R.CENTER_CLEAR)


def test_j10_an_unusable_frame_is_no_clear_frame() -> None:
    black = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.BLACK)
    _, advice, _ = play([water(0.05, 0.50, 0.30), CLEAR, black, CLEAR, CLEAR])
    assert [a.direction for a in advice] == [D.LEFT, D.LEFT, D.STOP, D.LEFT, D.STRAIGHT]


def test_j10_a_turn_is_not_kept_into_a_blocked_side() -> None:
    _, advice, _ = play([water(0.05, 0.50, 0.30), water(0.65, 0.05, 0.05)])
    assert advice[1].direction is D.STRAIGHT


def test_a_hidden_obstacle_fades_in_paani_and_stays_in_paper() -> None:
    """G3, G11: held tracks stay listed; how fast their weight decays while unseen is a setting."""
    ahead = box(PIER, (0.40, 0.35, 0.60, 0.64), 0.9)
    frames = [seeing(ahead)] * 2 + [CLEAR] * 10
    _, fading, tracks = play(frames, PAANI)
    _, lasting, _ = play(frames, PAPER)
    assert [len(t.tracks) for t in tracks] == [1] * 12
    assert fading[11].center.obstacle < 0.2 * fading[1].center.obstacle
    assert lasting[11].center.obstacle == pytest.approx(lasting[1].center.obstacle)


@pytest.mark.parametrize("non_water", [0.96, 1.0])
def test_no_turn_into_a_lane_without_water(non_water: float) -> None:
    """A beach from side to side, seen for certain, is a risk of 0.55 in each lane, and no side's limit is that low."""
    land = m.LaneEvidence(non_water=non_water, uncertainty=0.0, clear_width=1.0 - non_water)
    beach = msgspec.structs.replace(CLEAR, left=land, center=land, right=land)
    _, advice, _ = play([beach])
    assert (advice[0].direction, advice[0].reason) == (D.STOP, R.NO_SAFE_SIDE)
    _, advice, _ = play([msgspec.structs.replace(beach, left=lane(0.4))])
    assert advice[0].direction is D.LEFT
    _, advice, _ = play([beach], PAPER)
    assert advice[0].direction is D.RIGHT


@settings(max_examples=300, deadline=None)
@given(scenes(6), st.sampled_from((PAANI, PAPER, CALIBRATED)))
@pytest.mark.slow
def test_only_a_turn_to_a_blocked_side_is_to_look(given_scene: Scene, config: Config) -> None:
    """Every other advice is to pass; a search is advised with NO_SIDE_FOR_LONG alone."""
    decision = given_scene.decided(config)
    side = m.SIDE_OF.get(decision.direction)
    looks = side is not None and getattr(decision, side).blocked
    assert advised_purpose(decision) is (m.Purpose.LOOK if looks else m.Purpose.PASS)
    assert looks is (decision.reason is R.NO_SIDE_FOR_LONG)


def test_the_advisory_says_its_purpose() -> None:
    _, advice, _ = play([BLOCKED_ALL_ROUND] * 42, CALIBRATED)
    assert [a.purpose for a in advice] == [m.Purpose.PASS] * 40 + [m.Purpose.LOOK] * 2
    _, advisory, _ = advise(AdvisorState(), None, 1_000_000, PAANI)
    assert advisory.purpose is m.Purpose.PASS
