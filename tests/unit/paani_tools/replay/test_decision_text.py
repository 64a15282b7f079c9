"""A decision in words: they change when the decision does."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani_tools.replay.decision_text import decision_text, reason_text

GOING = m.NavCommand(source_us=1, enable=True, heading_rad=0.4, speed_mps=0.3, direction=m.Direction.STRAIGHT)
VETOED = (m.Inhibit.ADVISED_STOP,)
KEEPING = msgspec.structs.replace(GOING, speed_mps=0.0, direction=m.Direction.STOP, vetoes=VETOED, keeps_station=True)
HELD = msgspec.structs.replace(GOING, enable=False, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED, m.Inhibit.NO_CLOCK))


@pytest.mark.parametrize(
    ("order", "decision", "reason"),
    [(GOING, "go STRAIGHT", ""), (KEEPING, "keep station", "ADVISED_STOP"), (HELD, "hold", "NOT_ARMED, NO_CLOCK")],
)
def test_an_order_goes_keeps_its_station_or_holds(order: m.NavCommand, decision: str, reason: str) -> None:
    assert (decision_text(order), reason_text(order)) == (decision, reason)
    assert order.halt_reasons == tuple(map(m.Inhibit, reason.split(", "))) if reason else order.halt_reasons == ()
