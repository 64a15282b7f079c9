"""The whole advisor: age, unusable and malformed evidence, republishing, explanation, determinism."""

from __future__ import annotations

import json
import math
import random
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani_services.advisor.advise import AdvisorState, advise, evidence_expiry_us
from tests.unit.paani_services.advisor.advisor_evidence import (
    BUOY_AHEAD,
    CLEAR,
    PAANI,
    PAPER,
    T0_US,
    box,
    play,
    seeing,
    water,
)

D, R = m.Direction, m.Reason


def at(evidence: m.Evidence, age_s: float, config: Any = PAANI) -> m.Advisory:
    _, advisory, _ = advise(AdvisorState(), evidence, evidence.source_us + round(age_s * 1e6), config)
    return advisory


def test_nothing_yet_is_no_data() -> None:
    """J15: no evidence at all is NO_DATA, never STRAIGHT."""
    _, advisory, tracks = advise(AdvisorState(), None, T0_US, PAANI)
    assert (advisory.direction, advisory.reason) == (D.NO_DATA, R.NO_EVIDENCE)
    assert tracks.tracks == ()
    assert advisory.explanation == "No advice: nothing has been seen yet. Only new evidence can change that."


@pytest.mark.parametrize(
    ("age_s", "direction", "reason"),
    [
        (0.0, D.STRAIGHT, R.CENTER_CLEAR),
        (0.6, D.STRAIGHT, R.CENTER_CLEAR),
        (0.600001, D.STOP, R.STALE_EVIDENCE),
        (9.3, D.STOP, R.STALE_EVIDENCE),  # V16
        (-0.1, D.STRAIGHT, R.CENTER_CLEAR),
        (-0.100001, D.STOP, R.FUTURE_EVIDENCE),
        (-60.0, D.STOP, R.FUTURE_EVIDENCE),
    ],
)
def test_j14_age_in_both_directions(age_s: float, direction: m.Direction, reason: m.Reason) -> None:
    """J14, J16, V16."""
    advisory = at(CLEAR, age_s)
    assert (advisory.direction, advisory.reason) == (direction, reason)
    assert advisory.evidence_age_s == pytest.approx(age_s)


def test_the_papers_advice_outlives_its_frame() -> None:
    """J16: 3.5 s at 0.5 Hz, in the `paper` profile."""
    assert at(CLEAR, 3.5, PAPER).direction is D.STRAIGHT
    assert at(CLEAR, 3.51, PAPER).direction is D.STOP


@pytest.mark.parametrize("cause", [cause for cause in m.UnusableCause if cause is not m.UnusableCause.NONE])
def test_an_unusable_picture_stops_within_one_frame(cause: m.UnusableCause) -> None:
    """J14, W1: whatever was advised before, with its cause; it recovers with the next good frame."""
    bad = msgspec.structs.replace(CLEAR, usable=False, cause=cause)
    _, advice, _ = play([CLEAR, bad, CLEAR])
    assert [a.direction for a in advice] == [D.STRAIGHT, D.STOP, D.STRAIGHT]
    assert (advice[1].reason, advice[1].cause) == (R.UNUSABLE_IMAGE, cause)
    assert advice[1].center.risk == 1.0


def test_republishing_keeps_the_date_and_the_decision_then_stops() -> None:
    """J17, I17: same source_us and frame; only the age moves, until it is too much."""
    state, first, tracks = advise(AdvisorState(), water(0.3, 0.5, 0.4), T0_US, PAANI)
    for age_us in (200_000, 400_000, 600_000):
        state, again, tracks_again = advise(state, state.evidence, T0_US + age_us, PAANI)
        assert (again.source_us, again.frame_seq, again.direction) == (first.source_us, first.frame_seq, D.LEFT)
        assert again.center == first.center
        assert tracks_again == tracks
    stale_us = evidence_expiry_us(state, PAANI)
    assert stale_us == T0_US + 600_001
    _, late, _ = advise(state, state.evidence, stale_us, PAANI)
    assert (late.direction, late.reason, late.source_us) == (D.STOP, R.STALE_EVIDENCE, T0_US)


def test_an_older_frame_of_the_same_epoch_is_no_evidence() -> None:
    """B3: it neither refreshes the advice nor replaces it."""
    state, _, _ = play([CLEAR, water(0.6, 0.6, 0.6)])
    old = msgspec.structs.replace(CLEAR, frame_seq=0, source_us=T0_US + 10_000_000)
    after, advisory, _ = advise(state, old, T0_US + 300_000, PAANI)
    assert after == state
    assert advisory.reason is R.NO_SAFE_SIDE


def test_a_new_epoch_begins_again() -> None:
    """B2: a lower frame number in another epoch is a new frame, and tracks do not carry over."""
    state, _, _ = play([seeing(BUOY_AHEAD)] * 3)
    fresh = msgspec.structs.replace(seeing(BUOY_AHEAD), frame_epoch=2, frame_seq=0, source_us=T0_US + 600_000)
    state, _, tracks = advise(state, fresh, T0_US + 600_000, PAANI)
    assert [t.hits for t in tracks.tracks] == [1]
    assert tracks.tracks[0].motion_cause is m.MotionCause.EPOCH_CHANGE  # I15


def test_a_future_frame_leaves_no_trace() -> None:
    state, _, _ = play([CLEAR])
    future = msgspec.structs.replace(CLEAR, frame_seq=5, source_us=T0_US + 60_000_000)
    after, advisory, _ = advise(state, future, T0_US + 100_000, PAANI)
    assert advisory.reason is R.FUTURE_EVIDENCE
    assert after == state


@pytest.mark.parametrize(
    "bad",
    [
        seeing(box(m.Label.BUOY, (0.5, 0.5, 0.4, 0.6))),
        seeing(box(m.Label.BUOY, (0.4, 0.6, 0.5, 0.6))),
        seeing(box(m.Label.BUOY, (0.4, math.nan, 0.5, 0.6))),
        seeing(box(m.Label.BUOY, (0.4, 0.5, 0.5, math.inf))),
        seeing(box(m.Label.BUOY, (0.4, 0.5, 0.5, 0.6), math.nan)),
        msgspec.structs.replace(CLEAR, left=m.LaneEvidence(non_water=math.nan)),
        msgspec.structs.replace(CLEAR, right=m.LaneEvidence(uncertainty=-0.1)),
        msgspec.structs.replace(CLEAR, center=m.LaneEvidence(clear_width=1.5)),
        msgspec.structs.replace(CLEAR, water_edge=(0.5, math.nan)),
        msgspec.structs.replace(
            CLEAR,
            candidates=(
                m.Candidate(kind=m.CandidateKind.LONE_OBSTACLE, confidence=0.2, box_xyxy=(0.5, 0.5, 0.4, 0.6)),
            ),
        ),
    ],
)
def test_malformed_evidence_stops(bad: m.Evidence) -> None:
    """J15: counted and stopped for, never raised; the sound boxes beside it are still tracked."""
    state, advice, tracks = play([CLEAR, msgspec.structs.replace(bad, detections=(*bad.detections, BUOY_AHEAD))])
    assert (advice[1].direction, advice[1].reason) == (D.STOP, R.MALFORMED_EVIDENCE)
    assert len(tracks[1].tracks) == 1
    assert state.tracker.malformed == len(bad.detections)


@pytest.mark.parametrize("inverted", [False, True])
def test_ten_thousand_boxes_are_bounded_work(inverted: bool) -> None:
    """G1: as many tracks as the tracker may hold, every malformed box counted, and messages that are taken."""
    rng = random.Random(1)
    boxes = [sorted((rng.random(), rng.random())) + sorted((rng.random(), rng.random())) for _ in range(10_000)]
    crowd = tuple(
        box(m.Label.BUOY, (x2, y1, x1, y2) if inverted else (x1, y1, x2, y2), 0.9) for x1, x2, y1, y2 in boxes
    )
    state, advice, tracks = play([seeing(*crowd)] * 2)
    assert len(tracks[1].tracks) == (0 if inverted else 64)
    assert state.tracker.malformed == (20_000 if inverted else 0)
    assert advice[1].direction is D.STOP
    assert advice[1].counterfactual.judged <= 3303
    for message in (*advice, *tracks):
        assert msgspec.json.decode(msgspec.json.encode(message), type=type(message)) == message


def test_j11_everything_that_decided_is_in_the_advisory() -> None:
    """J11: direction, reason, components, thresholds, occupancy, tracks, age."""
    _, advice, tracks = play([seeing(box(m.Label.VESSEL, (0.40, 0.30, 0.60, 0.70), 0.9))] * 2)
    given = advice[1]
    assert (given.center_block_risk, given.side_block_risk) == (0.48, 0.58)
    assert given.center.occupied
    assert given.contributing_track_ids == (tracks[1].tracks[0].id,)
    assert given.evidence_age_s == pytest.approx(0.1)
    assert given.lifetime_s == 3.5
    judged = at(water(0.1, 0.5, 0.3), 0.0)
    assert (judged.left.risk, judged.center.risk, judged.right.risk) == pytest.approx((0.1, 0.5, 0.3))
    parts = given.center
    assert parts.risk == pytest.approx(
        min(1.0, 0.55 * parts.non_water + 0.65 * parts.obstacle + 0.20 * parts.urgency + 0.15 * parts.uncertainty)
    )


def test_j12_the_explanation_is_made_last_from_the_same_numbers() -> None:
    """J12: after hysteresis and after the age override, and it quotes the lanes that decided."""
    state, advice, _ = play([water(0.10, 0.50, 0.40), CLEAR])
    assert advice[0].explanation == (
        "Turn left: centre risk 0.50 (limit 0.48); left 0.10, right 0.40 (limit 0.58). "
        "With clear water in the centre it would go STRAIGHT."
    )
    assert advice[1].explanation == (
        "Turn left: keeping the turn until the way ahead stays clear, centre risk 0.05 (limit 0.48). "
        "Nothing in the picture asks for it any more."
    )
    _, late, _ = advise(state, state.evidence, T0_US + 2_200_000, PAANI)
    assert late.explanation == "Stop: the last picture is 2.0 s old. Only new evidence can change that."
    black = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.BLACK)
    assert at(black, 0.1).explanation == "Stop: the picture is black. Only new evidence can change that."


def test_j18_the_directions_are_these_seven_under_these_names() -> None:
    """J18: whoever reads an advisory from the bus or a recording meets no other word."""
    assert [json.loads(msgspec.json.encode(direction)) for direction in D] == [
        "STRAIGHT",
        "SLIGHT_LEFT",
        "SLIGHT_RIGHT",
        "LEFT",
        "RIGHT",
        "STOP",
        "NO_DATA",
    ]


def test_b17_reasons_of_different_kinds_never_share_a_code() -> None:
    """B17: a score, an override, a temporal rule, an age and an input fault each have their own reason."""
    black = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.BLACK)
    near = seeing(box(m.Label.BUOY, (0.42, 0.56, 0.58, 0.70), 0.41))
    _, advice, _ = play([water(0.1, 0.5, 0.3), CLEAR, black, CLEAR, CLEAR])
    reasons = [a.reason for a in advice[:3]] + [at(near, 0.1).reason, at(CLEAR, 2.0).reason, at(CLEAR, -2.0).reason]
    assert len(set(reasons)) == len(reasons)


def test_the_same_inputs_give_the_same_bytes() -> None:
    """Determinism over a sequence with tracks, turns, gaps and republishes."""
    frames = [seeing(BUOY_AHEAD)] * 4 + [water(0.2, 0.5, 0.5)] * 2 + [CLEAR] * 4
    runs = [play(frames) for _ in range(2)]
    assert msgspec.json.encode(runs[0]) == msgspec.json.encode(runs[1])


ANY = st.floats(allow_nan=True, allow_infinity=True) | st.floats(0.0, 1.0)
LANE = st.builds(m.LaneEvidence, non_water=ANY, uncertainty=ANY, clear_width=ANY)
DETECTION = st.builds(
    m.Detection, label=st.sampled_from(m.Label), confidence=ANY, box_xyxy=st.tuples(ANY, ANY, ANY, ANY)
)
STAMP = st.integers(0, 2**53)
EVIDENCE = st.builds(
    m.Evidence,
    source_us=STAMP, frame_seq=st.integers(0, 6), frame_epoch=st.integers(0, 1), width_px=st.just(320),
    height_px=st.just(240), usable=st.booleans(), cause=st.sampled_from(m.UnusableCause),
    time_base=st.sampled_from(m.TimeBase), media_us=STAMP, detections=st.lists(DETECTION, max_size=6).map(tuple),
    left=LANE, center=LANE, right=LANE, segmentation=st.sampled_from(m.SegmentationSource),
    navigation_eligible=st.booleans(),
)  # fmt: skip


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(EVIDENCE, st.integers(-3_000_000, 3_000_000)), max_size=6))
@pytest.mark.slow
def test_any_evidence_gives_an_advisory_that_survives_the_wire(frames: list[tuple[m.Evidence, int]]) -> None:
    """Time backwards, epochs back and forth, NaN and inverted boxes: never raises; risks stay in [0, 1]; STOP whenever
    unusable, malformed, stale or future.
    """
    state = AdvisorState()
    for evidence, age_us in frames:
        now_us = max(0, evidence.source_us + age_us)
        state, advisory, tracks = advise(state, evidence, now_us, PAANI)
        decoded = msgspec.json.decode(msgspec.json.encode(advisory), type=m.Advisory)
        assert decoded == advisory
        assert msgspec.json.decode(msgspec.json.encode(tracks), type=m.Tracks) == tracks
        judged = state.evidence
        assert all(0.0 <= lane.risk <= 1.0 for lane in (advisory.left, advisory.center, advisory.right))
        age_s = advisory.evidence_age_s
        if judged is None or not judged.usable or age_s > 0.6 or age_s < -0.1:
            assert advisory.direction is D.STOP


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.builds(box, st.sampled_from(m.Label), st.just((0.42, 0.3, 0.58, 0.6)), st.floats(0.41, 1.0)), max_size=3
    ),
    st.floats(0.0, 0.6),
    st.floats(0.0, 0.1),
)
@pytest.mark.slow
def test_more_evidence_of_danger_never_lowers_a_risk(detections: list[m.Detection], risk: float, more: float) -> None:
    """J4: risk is monotone in the water's part and in the number of boxes."""

    def center_risk(water_risk: float, boxes: list[m.Detection]) -> float:
        frame = msgspec.structs.replace(water(0.1, water_risk, 0.1), detections=tuple(boxes))
        return play([frame] * 2)[1][1].center.risk

    assert center_risk(risk + more, detections) >= center_risk(risk, detections) - 1e-12
    assert center_risk(risk, detections) >= center_risk(risk, []) - 1e-12
