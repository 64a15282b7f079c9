"""The boat's state for the monitors of ROS: what moves it or not, and which process speaks no more."""

from __future__ import annotations

from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani_services.ros2 import schemas
from paani_services.ros2.diagnostics import Diagnostics

NOW_US = 1_700_000_000_000_000
OK, WARN, ERROR, STALE = 0, 1, 2, 3


def report(diagnostics: Diagnostics, now_us: int = NOW_US) -> dict[str, Any]:
    """Statuses by name, as a node reads them."""
    array = schemas.decode(diagnostics.report(now_us).data, "diagnostic_msgs/DiagnosticArray")
    assert (array.header.stamp.sec, {status.hardware_id for status in array.status}) == (now_us // 1_000_000, {"otter"})
    return {status.name.removeprefix("otter: "): status for status in array.status}


def values(status: Any) -> dict[str, str]:
    return {value.key: value.value for value in status.values}


def boat() -> Diagnostics:
    return Diagnostics("otter", keys.Graph.SIMULATION)


def applied(cause: m.ZeroCause) -> m.ThrustApplied:
    return m.ThrustApplied(source_us=NOW_US, left=0.25, right=0.5, left_n=1.0, right_n=2.0, zero_cause=cause)


def test_what_was_never_heard_is_stale() -> None:
    found = report(boat())
    assert {name: status.level for name, status in found.items()} == {
        "motion": STALE,
        "picture": STALE,
        "position": STALE,
    }


def test_motion_and_why_not() -> None:
    diagnostics = boat()
    diagnostics.note(keys.THRUST_APPLIED.name, applied(m.ZeroCause.NONE), NOW_US)
    status = report(diagnostics)["motion"]
    assert (status.level, status.message, values(status)["left"]) == (OK, "thrust applied", "0.25")
    diagnostics.note(keys.THRUST_APPLIED.name, applied(m.ZeroCause.NOT_ARMED), NOW_US)
    inhibits = (m.Inhibit.NOT_ARMED, m.Inhibit.ADVISED_STOP)
    order = m.NavCommand(source_us=NOW_US, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=inhibits)
    diagnostics.note(keys.COMMAND.name, order, NOW_US)
    diagnostics.note(keys.OPERATOR_STATE.name, m.OperatorState(source_us=NOW_US, armed=False, stopped=True), NOW_US)
    status = report(diagnostics)["motion"]
    assert (status.level, status.message) == (WARN, "no thrust: not_armed")
    assert values(status)["inhibits"] == "NOT_ARMED, ADVISED_STOP"
    assert values(status)["stopped"] == "True"
    vetoes = (m.Inhibit.ADVISED_STOP,)
    keeping = msgspec.structs.replace(order, enable=True, inhibits=(), vetoes=vetoes, keeps_station=True)
    diagnostics.note(keys.COMMAND.name, keeping, NOW_US)
    assert values(report(diagnostics)["motion"])["inhibits"] == "ADVISED_STOP"


def test_silence_is_stale_after_the_time_of_the_table() -> None:
    diagnostics, fresh_us = boat(), round(keys.THRUST_APPLIED.fresh_s * 1e6)
    diagnostics.note(keys.THRUST_APPLIED.name, applied(m.ZeroCause.NONE), NOW_US)
    assert report(diagnostics, NOW_US + fresh_us)["motion"].level == OK
    assert report(diagnostics, NOW_US + fresh_us + 1)["motion"].level == STALE
    assert report(diagnostics, NOW_US - 1)["motion"].level == STALE  # the clock was set back: its age is none


def test_picture_and_position() -> None:
    diagnostics = boat()
    evidence = m.Evidence(
        source_us=NOW_US, frame_seq=1, frame_epoch=1, width_px=320, height_px=240, usable=False,
        cause=m.UnusableCause.BLACK,
    )  # fmt: skip
    pose = m.Odometry(source_us=NOW_US, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, refused_fixes=3)
    diagnostics.note(keys.EVIDENCE.name, evidence, NOW_US)
    diagnostics.note(keys.ODOMETRY.name, pose, NOW_US)
    found = report(diagnostics)
    assert (found["picture"].level, values(found["picture"])["cause"]) == (WARN, "black")
    assert (found["position"].level, values(found["position"])["refused_fixes"]) == (ERROR, "3")
    assert "withheld" in found["position"].message


def test_each_process_that_reported() -> None:
    diagnostics = boat()
    late = m.InputHealth(
        topic="camera/picture", alive=True, fresh=False, rate_ok=True, rate_hz=5.0, age_s=2.0, received=9, superseded=0
    )
    never = msgspec.structs.replace(late, topic="navigator/route", alive=False, received=0)
    undue = msgspec.structs.replace(late, topic="operator/request/stop")
    reports: list[tuple[str, bool, tuple[m.InputHealth, ...]]] = [
        ("camera", True, (never, undue)), ("advisor", False, ()), ("perception", True, (late,)),
    ]  # fmt: skip
    for service, ready, inputs in reports:
        health = m.Health(
            source_us=NOW_US, service=service, ready=ready, uptime_s=5.0, cpu_cores=0.1, rss_mib=60.0, inputs=inputs,
            drops=(m.DropCount(cause="future", count=2),), note="all well",
        )  # fmt: skip
        diagnostics.note(keys.health(service).name, health, NOW_US)
    found = report(diagnostics)
    levels = {name: status.level for name, status in found.items() if name.startswith("process ")}
    assert levels == {"process camera": OK, "process advisor": WARN, "process perception": WARN}
    assert found["process perception"].message == "hears no longer camera/picture"
    assert values(found["process camera"])["refused future"] == "2"
    assert report(diagnostics, NOW_US + 3_000_001)["process camera"].level == STALE
