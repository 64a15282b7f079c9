"""Texts to ground stations: every reason has one that fits, and is said once."""

from __future__ import annotations

import pytest

from paani import messages as m
from paani_services.mavlink.announcements import INHIBIT_TEXTS, MAX_TEXT_BYTES, Announcer, conditions
from paani_services.mavlink.snapshot import Snapshot
from tests.mavlink_peer import NOW_US, armed, in_order


def order(*inhibits: m.Inhibit) -> m.NavCommand:
    return m.NavCommand(source_us=NOW_US, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=inhibits)


def texts(announcer: Announcer, snapshot: Snapshot) -> list[str]:
    return [message.text for message in announcer.observe(snapshot)]


@pytest.mark.parametrize("inhibit", [each for each in m.Inhibit if each is not m.Inhibit.NOT_ARMED])
def test_every_inhibit_has_a_text_that_fits(inhibit: m.Inhibit) -> None:
    assert 0 < len(INHIBIT_TEXTS[inhibit]) <= MAX_TEXT_BYTES


@pytest.mark.parametrize("cause", [each for each in m.ZeroCause if each is not m.ZeroCause.NONE])
def test_every_zero_of_an_armed_boat_is_told_but_what_its_order_says(
    cause: m.ZeroCause,
) -> None:
    applied = m.ThrustApplied(source_us=0, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=cause)
    found = conditions(armed(applied=applied))
    assert (f"zero {cause}" in found) is (cause not in {m.ZeroCause.NOT_ENABLED, m.ZeroCause.NOT_ARMED})
    assert f"zero {cause}" not in conditions(in_order(applied=applied))
    assert all(len(text) <= MAX_TEXT_BYTES for _, text in found.values())


def test_a_condition_is_said_when_it_begins_and_not_again_within_five_seconds() -> None:
    announcer = Announcer()
    assert texts(announcer, in_order()) == ["disarmed"]
    assert texts(announcer, in_order()) == []
    assert texts(announcer, armed()) == ["armed by dashboard"]
    stop, go = order(m.Inhibit.ADVISED_STOP), armed().command
    heard = []
    for step in range(60):  # comes and goes ten times a second, for six seconds
        heard += texts(announcer, armed(command=stop if step % 2 else go, now_us=NOW_US + step * 100_000))
    assert heard == ["stopped: advised by the camera"] * 2


@pytest.mark.parametrize("veto", m.Inhibit)
def test_a_veto_of_the_stick_is_told(veto: m.Inhibit) -> None:
    command = m.NavCommand(source_us=0, enable=True, heading_rad=0.0, speed_mps=0.0, vetoes=(veto,))
    text = conditions(armed(command=command))[f"veto {veto}"][1]
    assert text.startswith("no thrust ahead: ")
    assert len(text) <= MAX_TEXT_BYTES


def test_a_boat_that_is_kept_on_station_is_told_as_stopped() -> None:
    vetoes = (m.Inhibit.ADVISED_STOP,)
    command = m.NavCommand(source_us=0, enable=True, heading_rad=0.0, speed_mps=0.0, vetoes=vetoes, keeps_station=True)
    assert {text for _, text in conditions(armed(command=command)).values()} >= {"stopped: advised by the camera"}
    assert not any(key.startswith("veto") for key in conditions(armed(command=command)))


def test_silence_is_told() -> None:
    found = {text for _, text in conditions(Snapshot(now_us=NOW_US)).values()}
    assert found == {"operator process silent: not armed", "navigator silent", "thrust adapter silent"}
