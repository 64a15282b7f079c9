"""The thrusters of a hull: what was sent to the microcontroller that drives them, and what it says."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.header import Count, Finite, Message, NonNegative, Signed, Text
from paani.messages.microcontroller import McuState, McuVerdict, ResetCause
from paani.messages.plant import ZeroCause


class ThrustHold(StrEnum):
    """What keeps the thrusters still on the microcontroller itself, whatever it is sent."""

    EMERGENCY_STOP = "emergency_stop"
    RECEIVER = "receiver"
    BATTERY_LOW = "battery_low"
    OVER_CURRENT = "over_current"
    NOT_ARMED = "not_armed"


class ReceiverState(StrEnum):
    """The radio receiver on the microcontroller: NONE is heard, it STANDS_BY, or it has TAKEN_OVER the thrusters."""

    NONE = "none"
    STANDS_BY = "stands_by"
    TAKEN_OVER = "taken_over"


class ThrustersState(Message, frozen=True, kw_only=True):
    """The line to the microcontroller that drives the thrusters; `source_us` is when this was written.

    problem: one line that names the device; empty while frames are accepted. zero_cause: why the thrusters stand still.
    armed, left, right: what was last sent. The rest is the microcontroller's own word: pulse_*_us as read back from its
    timer, `enabled` its enable line, battery and current 0 where it measures none. answer_age_ms: since the newest
    answer, 1e9 before the first. refused: frames that it refused since it started.
    """

    line: Text
    connected: bool
    zero_cause: ZeroCause
    problem: Text = ""
    armed: bool = False
    left: Signed = 0.0
    right: Signed = 0.0
    mcu: McuState = McuState.UNKNOWN
    verdict: McuVerdict = McuVerdict.NONE
    holds: tuple[ThrustHold, ...] = ()
    receiver: ReceiverState = ReceiverState.NONE
    enabled: bool = False
    pulse_left_us: Count = 0
    pulse_right_us: Count = 0
    battery_v: NonNegative = 0.0
    current_a: Finite = 0.0
    session: Count = 0
    sent: Count = 0
    answered: Count = 0
    unanswered: Count = 0
    connections: Count = 0
    answer_age_ms: NonNegative = 1e9
    round_trip_p50_ms: NonNegative = 0.0
    round_trip_p95_ms: NonNegative = 0.0
    boot_count: Count = 0
    reset_cause: ResetCause = ResetCause.UNKNOWN
    mcu_ms: Count = 0
    lease_left_ms: Count = 0
    accepted: Count = 0
    refused: Count = 0
