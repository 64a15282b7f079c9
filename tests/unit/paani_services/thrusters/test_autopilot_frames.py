"""Frames of the conversation with an autopilot: whose count."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common as dialect

from paani_services.thrusters.autopilot import Autopilot
from paani_services.thrusters.autopilot_frames import AutopilotFrames

AUTOPILOT, GIMBAL = 1, 154  # components


def heartbeat(system: int, component: int) -> bytes:
    """Of a boat that says it is armed."""
    message = dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_SURFACE_BOAT, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, dialect.MAV_MODE_FLAG_SAFETY_ARMED, 0,
        dialect.MAV_STATE_ACTIVE, 3,
    )  # fmt: skip
    return bytes(message.pack(dialect.MAVLink(None, system, component)))


@pytest.mark.parametrize(
    ("system", "component", "is_heard"), [(7, AUTOPILOT, True), (7, GIMBAL, False), (8, AUTOPILOT, False)]
)
def test_a_heartbeat_is_the_autopilots_own_alone(system: int, component: int, is_heard: bool) -> None:
    """What else has its number on the line, such as a gimbal, does not show that it lives."""
    autopilot = Autopilot(254)
    AutopilotFrames(7, 254).decode(heartbeat(system, component), autopilot, 1000.0)
    assert (autopilot.silence_ms(1000.0) == 0.0) is is_heard
