"""Beside somebody the fans stand still: no search on the spot, and no station by what an earlier clock told."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.frame_facts import PolicyState
from paani_services.advisor.people import people_near
from paani_services.advisor.risk import Obstacle
from tests.unit.paani_services.advisor.advisor_evidence import (
    CALIBRATED,
    CLEAR,
    PAANI,
    PAPER,
    T0_US,
    box,
    lane,
    murky,
    play,
)

SHUT = msgspec.structs.replace(CLEAR, left=lane(0.55), center=murky(0.6), right=lane(0.70))
STOP_M = CALIBRATED.advisor.people.stop_m
SWIMMER = Obstacle(1, False, (0.7, 0.4, 0.8, 0.98), 0.5, 0.0, 1.0, is_danger=False, is_person=True, distance_m=STOP_M)


@pytest.mark.parametrize(
    ("detections", "candidates"),
    [
        ((box(m.Label.PERSON, (0.30, 0.5, 0.70, 1.0), 0.9),), ()),  # in the way
        ((box(m.Label.PERSON, (0.75, 0.5, 0.90, 1.0), 0.9),), ()),  # beside it
        ((), (m.Candidate(kind=m.CandidateKind.UNSURE_BOX, confidence=0.3, box_xyxy=(0.4, 0.8, 0.5, 1.0)),)),
    ],
    ids=["ahead", "beside", "maybe"],
)
def test_no_boat_searches_beside_somebody(
    detections: tuple[m.Detection, ...], candidates: tuple[m.Candidate, ...]
) -> None:
    """Where no side is free it waits, however long, and searches once they are gone."""
    beside = msgspec.structs.replace(SHUT, detections=detections, candidates=candidates)
    state, advice, _ = play([beside] * 60, CALIBRATED)
    assert {each.direction for each in advice} == {m.Direction.STOP}
    _, advice, _ = play([SHUT] * 60, CALIBRATED, state=state, first_seq=60)
    assert advice[-1].purpose is m.Purpose.LOOK


@pytest.mark.parametrize("foot", [0.985, 0.70])
def test_no_boat_searches_beside_whom_it_has_turned_away_from(foot: float) -> None:
    """At 1.46 m; at 2.9 m it does."""
    swimmer = box(m.Label.PERSON, (0.80, 0.6, 0.98, foot), 0.9)
    state = AdvisorState(policy=PolicyState(no_way_frames=CALIBRATED.advisor.policy.look_frames, turn=m.Direction.LEFT))
    purpose = m.Purpose.UNSAID
    for number in range(4):
        at_us = T0_US + number * 200_000
        yaw_rad, detections = (0.0, (swimmer,)) if number < 2 else (0.7, ())
        odometry = m.Odometry(source_us=at_us, x_m=0.0, y_m=0.0, yaw_rad=yaw_rad, surge_mps=0.0, healthy=True)
        frame = msgspec.structs.replace(SHUT, source_us=at_us, frame_seq=number, detections=detections)
        state, advisory, _ = advise(state, frame, at_us + 50_000, CALIBRATED, odometry)
        purpose = advisory.purpose
    assert all(track.is_out_of_view for track in state.tracker.tracks)
    assert (purpose is m.Purpose.LOOK) is (foot == 0.70)


@pytest.mark.parametrize(
    ("changes", "is_near"),
    [
        ({}, True),
        ({"distance_m": STOP_M + 0.01}, False),
        ({"distance_m": None}, True),
        ({"is_ashore": True}, False),
        ({"is_person": False}, False),
        ({"is_person": False, "candidate": 1}, True),
    ],
)
def test_near_is_who_is_within_the_distance_at_which_the_boat_stops(changes: dict[str, object], is_near: bool) -> None:
    obstacles = (msgspec.structs.replace(SWIMMER, is_person=False), msgspec.structs.replace(SWIMMER, **changes))
    assert people_near(obstacles, CALIBRATED) == ((1,) if is_near else ())
    assert people_near(obstacles, PAPER) == ()


@pytest.mark.parametrize(("later_us", "keeps"), [(1_000_000, True), (-1, msgspec.UNSET), (-100_000_000, msgspec.UNSET)])
def test_a_clock_that_was_set_back_lengthens_no_permission(later_us: int, keeps: object) -> None:
    """Nobody near is remembered for the seconds in which nobody can come, and not until a time that is long past."""
    state, _, _ = advise(AdvisorState(), CLEAR, T0_US, CALIBRATED)
    doubted = msgspec.structs.replace(
        CLEAR, usable=False, cause=m.UnusableCause.NO_WATER, candidates=(), frame_seq=1, source_us=T0_US + later_us
    )
    state, advisory, _ = advise(state, doubted, doubted.source_us, CALIBRATED)
    assert (advisory.direction, advisory.may_keep_station) == (m.Direction.STOP, keeps)
    assert advise(state, doubted, doubted.source_us, PAANI)[1].direction is m.Direction.STOP
