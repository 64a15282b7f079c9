"""What the bridge says of its microcontroller."""

from __future__ import annotations

from typing import Any

import pytest

from paani import messages as m
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import INDICATION, McuStatus
from paani_services.bridge.state import SILENT_MS, bridge_state
from paani_services.bridge.symbols import Symbols

SHOWN = McuStatus(kind=INDICATION, state=m.McuState.FRESH, display=m.Direction.LEFT)


@pytest.mark.parametrize(("is_open", "age_ms"), [(True, SILENT_MS), (True, SILENT_MS + 1.0), (False, 0.0)])
def test_of_a_silent_microcontroller_and_of_a_broken_line_nothing_is_claimed(is_open: bool, age_ms: float) -> None:
    caller = McuCaller("serial:/dev/absent", INDICATION)
    port: Any = object() if is_open else None
    caller.status, caller._port = SHOWN, port
    state = bridge_state(caller, Symbols(m.Direction.LEFT, m.Reason.CENTER_RISK), 7, 5, age_ms)
    known = (m.McuState.FRESH, m.Direction.LEFT), (m.McuState.UNKNOWN, m.Direction.NO_DATA)
    assert (state.mcu, state.display) == known[0 if is_open and age_ms <= SILENT_MS else 1]
