"""Board and host joined by an emulated link: the boat drives, a cut stops it, and it goes on by itself."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from paani_tools.bench.faults.drives import faked_clock
from tests.link.namespaces import missing
from tests.link.two_hosts import driving

pytestmark = [pytest.mark.fault, pytest.mark.timeout(150)]

ZERO_S = 0.5
COMMAND_AGE_MS = 500.0  # plant.adapter.max_echo_age_s, and half a second that one in force stays so
WIFI = {"delay_ms": 20.0, "jitter_ms": 5.0, "loss": 0.02, "rate_bps": 4e6}
BACK_S = 10.0


@pytest.mark.parametrize(
    "board_ahead_s", [0.0, pytest.param(5.0, marks=pytest.mark.long), pytest.param(-5.0, marks=pytest.mark.long)]
)
def test_a_cut_stops_the_boat_and_it_goes_on_by_itself(tmp_path: Path, board_ahead_s: float) -> None:
    """The river over a link like a poor radio's: under way, cut for a second, under way again without hands.

    Board and host need no common time: neither may stop the boat for the other's clock, nor let it drive on by it.
    """
    if reason := missing():
        pytest.skip(reason)
    clock = {}
    if board_ahead_s:
        clock = faked_clock() | {"FAKETIME": f"{board_ahead_s:+g}"}
        if "LD_PRELOAD" not in clock:
            pytest.skip("needs libfaketime (Debian: faketime)")
    with driving(tmp_path, board_env=clock) as drive:
        drive.link.set(**WIFI)
        drive.await_under_way()
        cut_us, back_us = drive.cut(1.0)
        recovered_s = drive.await_thrust_after(back_us, BACK_S)
        drive.await_under_way()
        counters = drive.link.set()
    zero_s = drive.zero_after_s(cut_us)
    print(f"zero after {zero_s:.2f} s, thrust again {recovered_s:.2f} s after the link was back; {counters}")
    assert zero_s <= ZERO_S
    still = [each for each in drive.applied if cut_us + ZERO_S * 1e6 < each.at_us < back_us]
    assert len(still) > 5
    assert {each.force_n for each in still} == {0.0}
    assert {each.cause for each in still} <= {"pulse_lost", "timeout", "stale_echo", "not_enabled"}
    assert max(each.command_age_ms for each in drive.applied) <= COMMAND_AGE_MS + ZERO_S * 1e3
    assert counters.lost > 0
    assert counters.cut > 0
    assert "the board is there" in drive.output()
    summary = json.loads((tmp_path / "host.json").read_text())
    assert summary["distance_m"] > 1.0
    assert summary["collisions"] == 0
    assert all(service["restarts"] == 0 for service in summary["services"].values())
