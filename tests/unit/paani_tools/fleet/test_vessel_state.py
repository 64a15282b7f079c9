"""The row of a vessel: what is old is seen to be old, and what was never heard is not made up."""

from __future__ import annotations

import math

import pytest

from paani import messages as m
from paani_tools.fleet.vessel_state import STALE_S, Contact, Telemetry, describe_vessel, fleet_table

POSE = m.Odometry(
    source_us=1, x_m=3.0, y_m=-4.0, yaw_rad=1.5, surge_mps=0.3, sway_mps=0.4, latitude_deg=52.0, longitude_deg=4.5
)
STOPPED = m.OperatorState(source_us=1, armed=False, stopped=True, by="shore")


def health(service: str, *, ready: bool = True) -> m.Health:
    return m.Health(source_us=1, service=service, ready=ready, uptime_s=1.0, cpu_cores=0.1, rss_mib=1.0)


def test_a_vessel_that_was_never_heard_has_no_figures() -> None:
    state = describe_vessel("otter", Telemetry(age_s=math.inf))
    assert (state.contact, state.age_s, state.mode, state.x_m) == (Contact.AWAY, None, "unknown", None)
    assert fleet_table([state]).splitlines()[1].split() == ["otter", "away", "-", "unknown", *["-"] * 6]


@pytest.mark.parametrize(("age_s", "contact"), [(STALE_S, Contact.LIVE), (STALE_S + 0.01, Contact.STALE)])
def test_what_is_old_is_stale(age_s: float, contact: Contact) -> None:
    state = describe_vessel("otter", Telemetry(age_s=age_s, odometry=POSE))
    assert state.contact is contact
    assert contact.value in fleet_table([state])


def test_what_was_heard_is_in_the_row() -> None:
    applied = m.ThrustApplied(
        source_us=1, left=0.5, right=-0.25, left_n=1.0, right_n=1.0, zero_cause=m.ZeroCause.NOT_ARMED
    )
    command = m.NavCommand(
        source_us=1, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.NOT_ARMED, m.Inhibit.NO_ROUTE)
    )
    reports = {
        "eye": (health("eye", ready=False), 0.5),
        "plant": (health("plant"), 3.5),
        "camera": (health("camera"), 1.0),
    }
    state = describe_vessel(
        "otter",
        Telemetry(age_s=0.1, odometry=POSE, operator=STOPPED, applied=applied, command=command, health=reports),
    )
    assert state.speed_mps == pytest.approx(0.5)
    assert (state.pose_healthy, state.latitude_deg) == (False, 52.0)
    assert (state.mode, state.changed_by, state.zero_cause) == ("STOPPED", "shore", "not_armed")
    assert (state.inhibits, state.silent, state.unready) == (("NOT_ARMED", "NO_ROUTE"), ("plant",), ("eye",))
    line = fleet_table([state]).splitlines()[1]
    for text in ("STOPPED by shore", "3.0, -4.0 (not to be trusted)", "0.50", "+0.50 -0.25", "NOT_ARMED, NO_ROUTE"):
        assert text in line
    assert line.endswith("plant silent, eye not ready")


def test_what_fell_silent_before_the_rest_is_not_told_as_of_now() -> None:
    """Of a vessel that is out of reach as a whole, what was known last stays, and its age is told."""
    for age_s in (0.1, 3600.0):
        ages_s = {"odometry": age_s + 3600.0, "operator": age_s}
        state = describe_vessel("otter", Telemetry(age_s=age_s, ages_s=ages_s, odometry=POSE, operator=STOPPED))
        assert (state.x_m, state.speed_mps, state.mode) == (None, None, "STOPPED")
    assert describe_vessel("otter", Telemetry(age_s=3600.0, ages_s={"odometry": 3600.0}, odometry=POSE)).x_m == 3.0
