"""Lines of the page's log for what the operator has ordered, and texts for every refusal."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani_services.dashboard.operator_events import (
    MODE_REFUSALS,
    OVERRIDE_ENDS,
    REFUSALS,
    describe_operator_change,
)

ARMED = m.OperatorState(source_us=1, armed=True, stopped=False, by="dashboard", wheel_by="dashboard", wheel_hand=1)
replace = msgspec.structs.replace
MANUAL = replace(ARMED, mode=m.DriveMode.MANUAL, mode_since_us=5)


@pytest.mark.parametrize(
    ("before", "now", "level", "text"),
    [
        (ARMED, MANUAL, "warn", "Manual: ordered by the page"),
        (ARMED, replace(ARMED, mode=m.DriveMode.HOLD, mode_since_us=5), "info", "Hold: ordered by the page"),
        (MANUAL, replace(ARMED, mode=m.DriveMode.IDLE, mode_since_us=9), "info", "Idle: driving by hand has ended"),
        (MANUAL, replace(MANUAL, override_ms=9990.0), "warn", "the page overrides the advice"),
        (ARMED, replace(ARMED, wheel_by="mavlink"), "info", "the wheel is in another hand of mavlink"),
        (ARMED, replace(ARMED, wheel_hand=2), "info", "the wheel is in another hand of the page"),
        (MANUAL, replace(ARMED, armed=False, stopped=True, stops=1), "stop", "STOP requested by the page"),
    ],
)
def test_what_the_operator_orders_is_a_line_of_the_log(
    before: m.OperatorState, now: m.OperatorState, level: str, text: str
) -> None:
    (event,) = describe_operator_change(before, now, 7)
    assert (event.level, event.text) == (level, text)


def test_an_override_that_goes_on_is_one_line() -> None:
    going = replace(MANUAL, override_ms=5000.0)
    assert describe_operator_change(going, replace(going, override_ms=9000.0), 7) == ()


def test_the_end_of_an_override_is_a_line_of_its_own_with_its_cause() -> None:
    going = replace(MANUAL, override_ms=5000.0)
    begins_with = "the advice is no longer overridden: "
    for end, why in OVERRIDE_ENDS.items():
        (event,) = describe_operator_change(going, replace(MANUAL, override_end=end), 7)
        assert (event.level, event.text) == ("warn", begins_with + why)
    stopped = replace(ARMED, armed=False, stopped=True, stops=1, override_end=m.OverrideEnd.DISARMED)
    assert [event.text for event in describe_operator_change(going, stopped, 7)] == [
        "STOP requested by the page",
        f"{begins_with}the boat is no longer armed",
    ]
    begun_again = replace(ARMED, armed=False, epoch=9)
    assert [event.text for event in describe_operator_change(going, begun_again, 7)] == [
        "the operator's process is here: not armed",
        f"{begins_with}the operator's process has begun again",
    ]


def test_every_refusal_has_a_text() -> None:
    assert set(REFUSALS) == set(m.ArmRefusal) - {m.ArmRefusal.NONE}
    assert set(MODE_REFUSALS) == set(m.ModeRefusal) - {m.ModeRefusal.NONE}
    assert set(OVERRIDE_ENDS) == set(m.OverrideEnd)
    assert len(set(OVERRIDE_ENDS.values())) == len(OVERRIDE_ENDS)
