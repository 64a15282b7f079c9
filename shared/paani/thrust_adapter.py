"""The thrust adapter, the last decision before force: zero thrust unless every check passes (O1, O2).

It stands before whatever turns thrust into force: the simulated plant, or the microcontroller of a hull. Time is the
monotonic clock of the process that it runs in, which hands it out as the plant's stamp. A command is as old as the
stamp that it echoes, so no other clock matters and a burst of delayed commands is refused whole.

The order of epochs and sequence numbers is kept for as long as a command that was sent before the newest one could pass
by its echo. After that a lower epoch is a controller that began after its wall clock was set back.
"""

import math
from typing import NamedTuple

from paani import keys
from paani.config import AdapterConfig
from paani.messages import Arming, Thrust, ThrustApplied, ZeroCause

PRODUCER = keys.THRUST.producer  # in every graph


class AppliedThrust(NamedTuple):
    """Normalised thrust and force of each fan, astern negative, and why they are zero when they are."""

    left: float
    right: float
    left_n: float
    right_n: float
    zero_cause: ZeroCause
    lost_pulse: str = ""


class ThrustAdapter:
    """State machine of the thrust adapter. Every method takes the plant's clock, `now_us`.

    After a timeout, thrust resumes by itself with the next valid input. After a latched stop it does not:
    `Arming.stopped` holds until the operator arms again.
    """

    def __init__(self, config: AdapterConfig, domain: int) -> None:
        self._config = config
        self._domain = domain
        self._epoch = -1
        self._seq = -1
        self._ordered_us = 0  # when epoch and sequence number were taken
        self._accepted_us: int | None = None
        self._refused = ZeroCause.NO_COMMAND
        self._arming: Arming | None = None
        self._arming_us = 0
        self._pulses_us: dict[str, int] = {}
        self.command: Thrust | None = None
        self.rejected = 0

    def offer(self, thrust: Thrust, now_us: int) -> ZeroCause:
        """Check one command; NONE if it is now in force, else the cause it was refused for.

        An invalid command from the controller itself also revokes the one in force.
        """
        cause = self._find_refusal(thrust, now_us)
        if cause is ZeroCause.NONE:
            self._epoch, self._seq, self._ordered_us = thrust.epoch, thrust.seq, now_us
            self.command, self._accepted_us = thrust, now_us
            self._refused = ZeroCause.TIMEOUT
            return cause
        self.rejected += 1
        self._refused = cause
        if cause is ZeroCause.INVALID:
            self._accepted_us = None
        return cause

    @property
    def has_heard_operator(self) -> bool:
        """Whether an arming message has come since the start."""
        return self._arming is not None

    @property
    def is_armed(self) -> bool:
        """The operator's newest word, however old it is; `decide` judges its age."""
        return self._arming is not None and self._arming.armed and not self._arming.stopped

    def receive_arming(self, arming: Arming, now_us: int) -> None:
        """Take the newest arming message."""
        self._arming, self._arming_us = arming, now_us

    def receive_pulse(self, service: str, now_us: int) -> None:
        """Take a pulse, which shows that the event loop of a vital process runs."""
        self._pulses_us[service] = now_us

    def decide(self, now_us: int) -> AppliedThrust:
        """The thrust to apply now."""
        cause, lost_pulse = self._zero_cause(now_us)
        if cause is not ZeroCause.NONE or self.command is None:
            return AppliedThrust(0.0, 0.0, 0.0, 0.0, cause, lost_pulse)
        force_n = self._config.force_per_unit_n
        left, right = self.command.left, self.command.right
        return AppliedThrust(left, right, force_n * left, force_n * right, cause)

    def _zero_cause(self, now_us: int) -> tuple[ZeroCause, str]:
        config = self._config
        if self._arming is None or not self._arming.armed or self._arming.stopped:
            return ZeroCause.NOT_ARMED, ""
        if now_us - self._arming_us > config.arming_timeout_s * 1e6:
            return ZeroCause.ARMING_LOST, ""
        for service in config.require_pulses:
            received_us = self._pulses_us.get(service)
            if received_us is None or now_us - received_us > config.pulse_timeout_s * 1e6:
                return ZeroCause.PULSE_LOST, service
        if self.command is None or self._accepted_us is None:
            return self._refused, ""
        if now_us - self._accepted_us > config.timeout_s * 1e6:
            return self._refused, ""
        if not self.command.enabled:
            return ZeroCause.NOT_ENABLED, ""
        return ZeroCause.NONE, ""

    def _find_refusal(self, thrust: Thrust, now_us: int) -> ZeroCause:
        if thrust.producer != PRODUCER:
            return ZeroCause.WRONG_PRODUCER
        if thrust.domain != self._domain:
            return ZeroCause.WRONG_DOMAIN
        max_echo_age_us = self._config.max_echo_age_s * 1e6
        if now_us - self._ordered_us <= max_echo_age_us:
            if thrust.epoch < self._epoch:
                return ZeroCause.OLD_EPOCH
            if thrust.epoch == self._epoch and thrust.seq <= self._seq:
                return ZeroCause.REPLAYED
        if thrust.echo_us > now_us:
            return ZeroCause.FUTURE
        if now_us - thrust.echo_us > max_echo_age_us:
            return ZeroCause.STALE_ECHO
        fans = (thrust.left, thrust.right)
        if not all(math.isfinite(fan) and -self._config.astern <= fan <= 1.0 for fan in fans):
            return ZeroCause.INVALID
        return ZeroCause.NONE


class InForce:
    """Since when what is applied has been applied.

    `command`: the one in force; None while thrust is zero for a cause. `since_us`: since when it is, or none.
    `zero_since_us`: since when no fan has thrust, whatever the cause; 0 while one has.
    """

    def __init__(self) -> None:
        self.command: Thrust | None = None
        self.since_us = self.zero_since_us = 0

    def advance(self, applied: AppliedThrust, newest: Thrust | None, now_us: int) -> None:
        """Take what is applied from now on. newest: the newest command accepted."""
        command = newest if applied.zero_cause is ZeroCause.NONE else None
        if command is not self.command or self.since_us == 0:
            self.command, self.since_us = command, now_us
        if applied.left_n != 0.0 or applied.right_n != 0.0:
            self.zero_since_us = 0
        elif self.zero_since_us == 0:
            self.zero_since_us = now_us


def applied_message(adapter: ThrustAdapter, applied: AppliedThrust, source_us: int, in_force: InForce) -> ThrustApplied:
    """The thrust that the adapter applies, and the command behind it."""
    command = adapter.command
    return ThrustApplied(
        source_us=source_us,
        since_us=in_force.since_us,
        zero_since_us=in_force.zero_since_us,
        **applied._asdict(),
        rejected=adapter.rejected,
        command_seq=command.seq if command else 0,
        command_sent_us=command.sent_us if command else 0,
        command_source_us=command.source_us if command else 0,
    )
