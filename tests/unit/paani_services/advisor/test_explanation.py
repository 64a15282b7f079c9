"""What the words say of sides that are closed, and of people before a stop."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from paani import messages as m
from paani_services.advisor.explanation import explain_advisory
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, box, play, seeing

SWIMMER = box(m.Label.PERSON, (0.20, 0.35, 0.80, 0.64))


def words(frame: m.Evidence) -> str:
    return play([frame] * 3)[1][-1].explanation


def test_a_stop_for_somebody_says_stop_once_and_who_closes_both_sides() -> None:
    text = words(seeing(SWIMMER))
    assert text.startswith(
        "Stop: swimmer ahead, waiting. Somebody is in the way ahead or beside it and no side is free: "
    )
    assert "left 0.14 with somebody in it, right 0.14 with somebody in it (limit 0.58)." in text
    assert text.count("Stop") == 1


@pytest.mark.parametrize(
    ("side", "says"),
    [
        (m.LaneRisk(risk=0.3, blocked=True, occupied=True, limit=0.58), "right 0.30 occupied"),
        (
            m.LaneRisk(risk=0.3, blocked=True, occupied=True, limit=0.58, track_ids=(1,)),
            "right 0.30 with somebody in it",
        ),
        (m.LaneRisk(risk=0.3, blocked=True, limit=0.58), "right 0.30 not free"),
        (m.LaneRisk(risk=0.3, blocked=True, limit=0.58, track_ids=(1,)), "right 0.30 with somebody in it"),
        (m.LaneRisk(risk=0.3, blocked=True, limit=0.58, track_ids=(2,)), "right 0.30 not free"),
        (m.LaneRisk(risk=0.58, blocked=True, limit=0.58), "right 0.58 (limit 0.58)"),
        (
            m.LaneRisk(risk=0.3, blocked=False, limit=0.58),
            "right 0.30 with an obstacle that reaches in from there (limit 0.58)",
        ),
    ],
)
def test_a_side_says_what_closes_it_unless_its_risk_does(side: m.LaneRisk, says: str) -> None:
    _, advice, tracks = play([seeing(SWIMMER, box(m.Label.BUOY, (0.85, 0.4, 0.9, 0.5)))] * 3)
    advisory = msgspec.structs.replace(advice[-1], right=side, reason=m.Reason.NO_SAFE_SIDE)
    assert [track.label for track in tracks[-1].tracks] == ["person", "buoy"]
    assert says in explain_advisory(advisory, tracks[-1].tracks)


def test_a_picture_of_too_few_pixels_is_called_too_small() -> None:
    frame = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.WRONG_SIZE)
    assert words(frame).startswith("Stop: the picture is too small.")


@pytest.mark.parametrize(
    ("risk", "fields", "says"),
    [
        (0.26, {}, "Stop: the way ahead shows no open water and no side is free"),
        (0.26, {"track_ids": (1,)}, "the way ahead is not free, with buoy #1 in it and no side is free"),
        (0.26, {"track_ids": (1,), "occupied": True}, "the way ahead is occupied by buoy #1 and no side is free"),
        (0.50, {}, "Stop: centre risk 0.50 (limit 0.48) and no side is free"),
    ],
)
def test_a_centre_says_what_closes_it_and_no_risk_that_does_not(risk: float, fields: dict[str, Any], says: str) -> None:
    center = m.LaneRisk(risk=risk, blocked=True, limit=0.48, **fields)
    _, advice, tracks = play([seeing(box(m.Label.BUOY, (0.45, 0.4, 0.55, 0.5)))] * 3)
    advisory = msgspec.structs.replace(
        advice[-1], center=center, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE
    )
    assert says in explain_advisory(advisory, tracks[-1].tracks)


@pytest.mark.parametrize(("foot", "says"), [(0.60, "Slow: swimmer ahead at about"), (0.485, "Swimmer ahead at about")])
def test_the_boat_is_said_to_slow_where_it_has_to(foot: float, says: str) -> None:
    """And the distance is that of whom the sentence names, however near somebody else may be."""
    frame = seeing(box(m.Label.PERSON, (0.47, foot - 0.1, 0.53, foot), 0.9))
    advisory = play([frame] * 3, CALIBRATED)[1][-1]
    assert advisory.explanation.startswith(says)
    assert isinstance(advisory.speed_limit_mps, msgspec.UnsetType) is (says[0] == "S" and says[1] == "w")
    candidate = m.Candidate(kind=m.CandidateKind.UNSURE_BOX, box_xyxy=(0.48, 0.7, 0.52, 0.8), confidence=0.3)
    both = play([msgspec.structs.replace(frame, candidates=(candidate,))] * 3, CALIBRATED)[1][-1]
    assert both.person_distance_m == advisory.person_distance_m
