"""The message on the state of the line, from what the caller knows. Pure."""

from __future__ import annotations

from paani import messages as m
from paani.microcontroller.caller import McuCaller
from paani.microcontroller.payloads import INDICATION, McuStatus
from paani_services.bridge.symbols import Symbols

NEVER_MS = 1e9
NO_STATUS = McuStatus(kind=INDICATION, state=m.McuState.UNKNOWN)
SILENT_MS = 1000.0  # of a microcontroller silent for longer nobody knows what it shows


def bridge_state(caller: McuCaller, symbols: Symbols, session: int, now_us: int, now_ms: float) -> m.BridgeState:
    """`session`: of the frames sent. Of a silent microcontroller neither state nor display is known."""
    status = caller.status or NO_STATUS
    answer_age_ms = now_ms - caller.status_ms if caller.status is not None else NEVER_MS
    is_known = answer_age_ms <= SILENT_MS and caller.is_connected
    refusals = status.refusals
    return m.BridgeState(
        source_us=now_us,
        line=caller.address[:400],
        connected=caller.is_connected,
        problem=caller.problem[:400],
        direction=symbols.direction,
        reason=symbols.reason,
        display=status.display if is_known else m.Direction.NO_DATA,
        mcu=status.state if is_known else m.McuState.UNKNOWN,
        verdict=status.verdict,
        session=session,
        sent=caller.sent,
        answered=caller.answered,
        unanswered=caller.unanswered,
        late=caller.late,
        junk_bytes=caller.junk_bytes,
        connections=caller.connections,
        answer_age_ms=min(max(answer_age_ms, 0.0), NEVER_MS),
        round_trip_p50_ms=caller.round_trip_ms(50),
        round_trip_p95_ms=caller.round_trip_ms(95),
        boot_count=status.boot_count,
        reset_cause=status.reset_cause,
        mcu_ms=status.mcu_ms,
        lease_left_ms=status.lease_left_ms,
        accepted=status.accepted,
        refused_crc=refusals.crc,
        refused_version=refusals.version,
        refused_range=refusals.range,
        refused_replayed=refusals.replayed,
        refused_foreign_session=refusals.foreign_session,
        refused_expired=refusals.expired,
        refused_lease=refusals.lease,
        refused_framing=refusals.framing,
    )
