"""What is proposed for the writes of ground stations, and what an answer of the advisor means for each."""

from __future__ import annotations

from typing import Any

import pytest

from paani import messages as m
from paani_services.mavlink.announcements import MAX_TEXT_BYTES
from paani_services.mavlink.parameter_exchange import DENIED, RANGE, ParameterWrite
from paani_services.mavlink.trials import changes_on_trial, is_answer, judge_answer, trial_text
from tests.mavlink_peer import NOW_US, Peer, Port, in_order

A, B, C = "advisor.policy.tie", "advisor.policy.center_block_risk", "advisor.risk.urgency"


def change(path: str, value: str) -> m.Change:
    return m.Change(path=path, value=value)


def write(path: str, text: str) -> ParameterWrite:
    return ParameterWrite(Peer(Port(in_order()).gateway).station, (255, 190), "N", path, text)


def shadow(**fields: Any) -> m.Shadow:
    return m.Shadow(source_us=NOW_US, **fields)


def test_a_write_joins_what_the_stations_already_try() -> None:
    in_force = (change(A, "0.1"),)
    ours = shadow(active="7f3a", active_changes=in_force, proposal="mavlink01", changes=(*in_force, change(B, "0.4")))
    assert changes_on_trial(ours, "mavlink", [write(C, "0.2")]) == (change(B, "0.4"), change(C, "0.2"))
    assert changes_on_trial(ours, "mavlink", [write(B, "0.5")]) == (change(B, "0.5"),)


def test_what_the_page_tries_is_not_taken_over() -> None:
    theirs = shadow(proposal="7f3a", changes=(change(B, "0.4"),))
    assert changes_on_trial(theirs, "mavlink", [write(C, "0.2")]) == (change(C, "0.2"),)


@pytest.mark.parametrize(
    ("report", "request_id", "is_answered"),
    [
        (shadow(proposal="mavlink01"), "7f3a", True),  # on trial, whatever was asked since
        (shadow(answered_epoch=4, answered=2), "mavlink01", True),  # refused
        (shadow(answered_epoch=4, answered=1), "mavlink01", False),  # the request before it
        (shadow(answered_epoch=3, answered=2), "mavlink01", False),  # of an earlier run of the page's process
        (shadow(answered_epoch=4, answered=2), "7f3a", False),  # another's request
        (None, "mavlink01", False),
    ],
)
def test_which_report_is_the_answer(report: m.Shadow | None, request_id: str, is_answered: bool) -> None:
    request = m.Tuning(source_us=NOW_US, epoch=4, request=2, act=m.TuningAct.PROPOSE, proposal=request_id)
    assert is_answer(report, request, "mavlink01") is is_answered
    assert not is_answer(shadow(), None, "mavlink01")


def test_an_answer_is_said_to_the_write_at_fault_or_to_all() -> None:
    on_trial = shadow(proposal="mavlink01")
    assert judge_answer(on_trial, "mavlink01", {A}) == (DENIED, trial_text("mavlink01"), "")
    invalid = shadow(refusal=m.TuningRefusal.INVALID_VALUE, refused_path=A)
    assert judge_answer(invalid, "mavlink01", {A, B}) == (RANGE, "parameter: invalid value", A)
    assert judge_answer(invalid, "mavlink01", {B}) == (RANGE, "parameter: invalid value", "")
    assert judge_answer(None, "mavlink01", {A})[0] == DENIED


def test_the_longest_text_fits_its_field() -> None:
    assert len(trial_text("mavlinkffff")) <= MAX_TEXT_BYTES
