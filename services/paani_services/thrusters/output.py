"""What goes to the microcontroller, and what is known to come out of it. Pure."""

from __future__ import annotations

from typing import NamedTuple

from paani import messages as m
from paani.config import ThrustersConfig
from paani.microcontroller.payloads import EscSettings, McuStatus, ThrustCall
from paani.thrust_adapter import AppliedThrust

# The bits of a status, in their order; the first that is set is the cause that is shown.
HOLDS = (
    m.ThrustHold.EMERGENCY_STOP,
    m.ThrustHold.RECEIVER,
    m.ThrustHold.BATTERY_LOW,
    m.ThrustHold.OVER_CURRENT,
    m.ThrustHold.NOT_ARMED,
)
CAUSE_OF_HOLD = {
    m.ThrustHold.EMERGENCY_STOP: m.ZeroCause.EMERGENCY_STOP,
    m.ThrustHold.RECEIVER: m.ZeroCause.RECEIVER,
    m.ThrustHold.BATTERY_LOW: m.ZeroCause.BATTERY_LOW,
    m.ThrustHold.OVER_CURRENT: m.ZeroCause.OVER_CURRENT,
    m.ThrustHold.NOT_ARMED: m.ZeroCause.REARM,
}


def esc_settings(settings: ThrustersConfig, session: int) -> EscSettings:
    """How the speed controllers are driven, for this session."""
    left, right = settings.left, settings.right
    return EscSettings(
        session=session,
        left_reversed=left.reversed,
        right_reversed=right.reversed,
        trim_left_us=left.trim_us,
        trim_right_us=right.trim_us,
        neutral_us=settings.neutral_us,
        span_us=settings.span_us,
        deadband_left_us=left.deadband_us,
        deadband_right_us=right.deadband_us,
        slew_per_s=settings.slew_per_s,
        min_battery_v=settings.min_battery_v,
        max_current_a=settings.max_current_a,
    )


def thrust_call(applied: AppliedThrust, is_armed: bool, numbers: tuple[int, int], lease_ms: int) -> ThrustCall:
    """The frame for a decision that was made just now. A boat that is not armed is sent zero, whatever is decided."""
    left, right = (applied.left, applied.right) if is_armed else (0.0, 0.0)
    session, seq = numbers
    return ThrustCall(armed=is_armed, session=session, seq=seq, lease_ms=lease_ms, left=left, right=right)


def holds_of(status: McuStatus) -> tuple[m.ThrustHold, ...]:
    """What keeps the thrusters still on the microcontroller; bits that nobody knows say nothing."""
    return tuple(hold for place, hold in enumerate(HOLDS) if status.holds >> place & 1)


def find_output_cause(status: McuStatus | None, age_ms: float, lease_ms: float) -> m.ZeroCause:
    """Why the microcontroller gives no thrust, by its newest status, `age_ms` old; NONE while it gives some."""
    if status is None or age_ms > lease_ms:
        return m.ZeroCause.LINE_LOST
    if status.verdict not in {m.McuVerdict.ACCEPTED, m.McuVerdict.NONE}:
        return m.ZeroCause.REFUSED
    for hold in holds_of(status):
        return CAUSE_OF_HOLD[hold]
    return m.ZeroCause.NONE if status.state is m.McuState.FRESH else m.ZeroCause.REFUSED


class ReportSchedule:
    """When what is applied is due on the bus."""

    def __init__(self, period_ms: float, now_ms: float) -> None:
        self._period_ms, self._due_ms = period_ms, now_ms
        self._cause = m.ZeroCause.NO_COMMAND
        self.count = 0

    def advance(self, cause: m.ZeroCause, now_ms: float) -> tuple[bool, bool]:
        """Whether a report is due, and whether the cause of a zero is another than before."""
        is_due, has_changed = now_ms >= self._due_ms, cause is not self._cause
        self._cause = cause
        if is_due:
            self._due_ms = max(self._due_ms + self._period_ms, now_ms)
            self.count += 1
        return is_due, has_changed

    def wait_s(self, now_ms: float) -> float:
        """Until the next report is due."""
        return max(0.0, self._due_ms - now_ms) * 1e-3


class _Sent(NamedTuple):
    decided: AppliedThrust
    at_ms: float


class OutputTracker:
    """What the thrusters do, as far as it is known: the newest decision that was answered, until its lease is over.

    A zero that the microcontroller has not confirmed is not applied yet; it is once the last lease has run out, that of
    a frame without an answer included, which may have arrived.
    """

    def __init__(self, lease_ms: float) -> None:
        self._lease_ms = lease_ms
        self._accepted: _Sent | None = None
        self._unanswered: _Sent | None = None
        self._sent: _Sent | None = None

    def send(self, decided: AppliedThrust, now_ms: float) -> None:
        """The frame of this decision is on its way."""
        self._sent = _Sent(decided, now_ms)

    def accept(self, now_ms: float) -> None:
        """The microcontroller has accepted this frame: no earlier one counts any more."""
        if self._sent is not None:
            self._accepted, self._unanswered, self._sent = self._sent._replace(at_ms=now_ms), None, None

    def refuse(self) -> None:
        """The microcontroller has refused this frame: what came before it runs on."""
        self._sent = None

    def lose(self, now_ms: float) -> None:
        """This frame had no answer until now."""
        if self._sent is not None and self._sent.decided.zero_cause is m.ZeroCause.NONE:
            self._unanswered = self._sent._replace(at_ms=now_ms)
        self._sent = None

    def applied(self, decided: AppliedThrust, output_cause: m.ZeroCause, now_ms: float) -> AppliedThrust:
        """What is applied now: the decision, unless the microcontroller withholds it or still runs an earlier one."""
        if output_cause not in {m.ZeroCause.NONE, m.ZeroCause.LINE_LOST, m.ZeroCause.REFUSED}:
            return zero(decided, output_cause)
        is_zero = decided.zero_cause is not m.ZeroCause.NONE
        for sent in (self._sent, self._unanswered, self._accepted) if is_zero else (self._accepted,):
            is_live = sent is not None and now_ms - sent.at_ms <= self._lease_ms
            if sent is not None and is_live and sent.decided.zero_cause is m.ZeroCause.NONE:
                return sent.decided
        return zero(decided, m.ZeroCause.LINE_LOST if output_cause is m.ZeroCause.NONE else output_cause)


def zero(decided: AppliedThrust, cause: m.ZeroCause) -> AppliedThrust:
    """Zero thrust: for the adapter's own cause where it has one."""
    if decided.zero_cause is not m.ZeroCause.NONE:
        return decided
    return AppliedThrust(0.0, 0.0, 0.0, 0.0, cause)
