"""Drives recorded before still replay: every decision of advisor, navigator and controller, to the byte.

A change that is meant to decide otherwise cuts new recordings (`cut_recording.py`) and says so.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.logs.reader import open_log
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.verify import check_log

FOLDER = Path(__file__).parent
DECISIONS = {"river_camera_black": 757, "river_paper": 1007}


@pytest.mark.parametrize("name", DECISIONS)
def test_a_recording_made_before_is_decided_again_to_the_byte(name: str) -> None:
    log = open_log(FOLDER / f"{name}.mcap")
    made_by = provenance_of(log, force=True)
    report = check_log(log, made_by.config, made_by.notes)
    assert report.is_exact, [service.differences[:3] for service in report.services if service.differ]
    assert (report.decisions, report.differ) == (DECISIONS[name], 0)
    assert {service.service for service in report.services} == {"advisor", "navigator", "controller"}


@pytest.mark.parametrize(
    ("name", "reasons"),
    [
        ("river_camera_black", {m.Reason.CENTER_CLEAR, m.Reason.UNUSABLE_IMAGE}),
        ("river_paper", {m.Reason.CENTER_VESSEL, m.Reason.CENTER_OCCUPIED, m.Reason.TURN_RETAINED}),
    ],
)
def test_the_recordings_hold_what_they_are_kept_for(name: str, reasons: set[m.Reason]) -> None:
    records = open_log(FOLDER / f"{name}.mcap").records({keys.ADVISORY.name})
    assert reasons <= {msgspec.json.decode(record.data, type=m.Advisory).reason for record in records}
