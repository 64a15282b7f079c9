"""The message on the state of the thrusters, from what the caller knows. Pure."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from paani import messages as m
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import THRUST, McuStatus
from paani_services.thrusters.output import holds_of

NEVER_MS = 1e9
NO_STATUS = McuStatus(kind=THRUST, state=m.McuState.UNKNOWN)
SILENT_MS = 1000.0  # of a microcontroller silent for longer nobody knows what it does
RECEIVERS = (m.ReceiverState.NONE, m.ReceiverState.STANDS_BY, m.ReceiverState.TAKEN_OVER)


class Sent(NamedTuple):
    """The newest thrust frame."""

    armed: bool = False
    left: float = 0.0
    right: float = 0.0
    session: int = 0


def thrusters_state(
    caller: McuCaller, sent: Sent, zero_cause: m.ZeroCause, now_us: int, now_ms: float
) -> m.ThrustersState:
    """Of a silent microcontroller neither state nor pulses are known."""
    answer_age_ms = now_ms - caller.status_ms if caller.status is not None else NEVER_MS
    is_known = answer_age_ms <= SILENT_MS and caller.is_connected
    status = caller.status if is_known and caller.status is not None else NO_STATUS
    return m.ThrustersState(
        source_us=now_us,
        line=caller.address[:400],
        connected=caller.is_connected,
        zero_cause=zero_cause,
        problem=caller.problem[:400],
        armed=sent.armed,
        left=sent.left,
        right=sent.right,
        mcu=status.state,
        verdict=status.verdict,
        holds=holds_of(status),
        receiver=RECEIVERS[status.rc] if status.rc < len(RECEIVERS) else m.ReceiverState.NONE,
        enabled=status.enabled,
        pulse_left_us=status.pulse_left_us,
        pulse_right_us=status.pulse_right_us,
        battery_v=status.battery_v,
        current_a=status.current_a,
        session=sent.session,
        sent=caller.sent,
        answered=caller.answered,
        unanswered=caller.unanswered,
        connections=caller.connections,
        answer_age_ms=min(max(answer_age_ms, 0.0), NEVER_MS),
        round_trip_p50_ms=caller.round_trip_ms(50),
        round_trip_p95_ms=caller.round_trip_ms(95),
        boot_count=status.boot_count,
        reset_cause=status.reset_cause,
        mcu_ms=status.mcu_ms,
        lease_left_ms=status.lease_left_ms,
        accepted=status.accepted,
        refused=sum(msgspec.structs.astuple(status.refusals)),
    )


def note_of(state: m.ThrustersState) -> str:
    """One line for the health report."""
    if state.problem:
        return state.problem
    if state.holds:
        return f"{state.mcu}; held by {', '.join(hold.replace('_', ' ') for hold in state.holds)}"
    return f"{state.mcu}, {state.pulse_left_us} and {state.pulse_right_us} us, {state.round_trip_p50_ms:.1f} ms"
