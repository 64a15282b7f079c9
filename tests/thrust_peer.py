"""What is at the far end of the line of the thrusters: a stand-in for the microcontroller, with its lease and holds."""

from __future__ import annotations

from paani.clock import stopwatch_ms
from paani.messages import McuState, McuVerdict
from paani.microcontroller.payloads import THRUST, EscSettings, McuStatus, ThrustCall
from paani.microcontroller.rpc import Request, encode_response
from tests.mcu_peer import McuPeer

ESTOP, RECEIVER, BATTERY, CURRENT, NOT_ARMED = 1, 2, 4, 8, 16


class ThrustPeer(McuPeer):
    """Judges sessions, settings and leases, and keeps what it was sent and when."""

    def __init__(self) -> None:
        super().__init__()
        self.settings: list[EscSettings] = []
        self.thrusts: list[tuple[float, ThrustCall]] = []
        self.active = 0  # bits of what is pressed, taken over, too low or too high now
        self.latched = 0  # what held since the operator last disarmed
        self.is_armed = self.may_arm = False
        self.configured = self.accepted_ms = self.lease_ms = 0.0
        self.battery_v, self.current_a, self.rc = 12.4, 0.0, 0

    @property
    def is_fresh(self) -> bool:
        return self.session > 0 and stopwatch_ms() - self.accepted_ms <= self.lease_ms

    @property
    def newest(self) -> ThrustCall:
        return self.thrusts[-1][1]

    def hold(self, bits: int) -> None:
        """What holds the thrusters from now on; it stays latched until the operator has disarmed."""
        self.active = bits
        self.latched |= bits
        if bits:
            self.is_armed = self.may_arm = False

    def reset(self) -> None:
        super().reset()
        self.configured = 0
        self.is_armed = self.may_arm = False

    def pulses_us(self) -> tuple[int, int]:
        """What its timer holds."""
        if not self.settings:
            return 1500, 1500
        esc, live = self.settings[-1], self.is_live()
        pulses = []
        for side, trim, band, is_reversed in (
            (self.newest.left if self.thrusts else 0.0, esc.trim_left_us, esc.deadband_left_us, esc.left_reversed),
            (self.newest.right if self.thrusts else 0.0, esc.trim_right_us, esc.deadband_right_us, esc.right_reversed),
        ):
            width = band + abs(side) * (esc.span_us - band) if live and side else 0.0
            pulses.append(round(esc.neutral_us + trim + (width if (side > 0) != is_reversed else -width)))
        return pulses[0], pulses[1]

    def holds(self) -> int:
        return self.active | self.latched | (0 if self.is_armed else NOT_ARMED)

    def is_live(self) -> bool:
        """Whether its enable line is."""
        return self.is_fresh and self.holds() == 0

    def thrust_status(self, verdict: McuVerdict) -> McuStatus:
        left_us, right_us = self.pulses_us()
        state = McuState.FRESH if self.is_fresh else McuState.STALE if self.session else McuState.BOOT
        return McuStatus(
            kind=THRUST, state=state, verdict=verdict, session=self.session, boot_count=self.boot_count,
            seq=self.newest.seq if self.thrusts else 0, mcu_ms=self.mcu_ms, holds=self.holds(),
            accepted=len(self.thrusts) % 65_536, pulse_left_us=left_us, pulse_right_us=right_us,
            battery_v=self.battery_v, current_a=self.current_a, enabled=self.is_live(), rc=self.rc,
        )  # fmt: skip

    def answer(self, request: Request) -> bytes:
        verdict = McuVerdict.NONE
        if request.method == "paani_esc":
            settings = EscSettings.decode(request.params[0])
            assert settings is not None
            verdict = McuVerdict.LOCKED if self.is_fresh else McuVerdict.ACCEPTED
            if verdict is McuVerdict.ACCEPTED:
                self.settings.append(settings)
                self.configured = settings.session
                self.is_armed = self.may_arm = False
        elif request.method == "paani_thrust":
            verdict = self._judge(ThrustCall.decode(request.params[0]))
        return encode_response(request.id, self.thrust_status(verdict).encode())

    def _judge(self, call: ThrustCall | None) -> McuVerdict:
        assert call is not None
        if self.is_fresh and call.session != self.session:
            return McuVerdict.FOREIGN_SESSION
        if call.session != self.configured:
            return McuVerdict.NOT_CONFIGURED
        self.session, self.accepted_ms, self.lease_ms = call.session, stopwatch_ms(), call.lease_ms
        self.thrusts.append((self.accepted_ms, call))
        if not call.armed:
            self.is_armed, self.may_arm, self.latched = False, not self.active, self.active
        elif self.may_arm and not self.latched:
            self.is_armed = True
        return McuVerdict.ACCEPTED
