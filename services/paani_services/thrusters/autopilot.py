"""What an ArduPilot Rover is told, and whether it may be: the conversation as a state machine. Pure.

Thrust goes out as sticks in MANUAL, never as a speed in GUIDED: there the autopilot's own speed loop would push harder
than the thrust adapter allowed, and a boat that hears nothing keeps its station under power. In MANUAL the autopilot's
motors do what the adapter decided, and silence ends in HOLD, without thrust.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import NamedTuple

from paani import messages as m
from paani.thrust_adapter import AppliedThrust
from paani_services.thrusters.autopilot_parameters import ParameterTable
from paani_services.thrusters.autopilot_sticks import Mixed, StickMixer, Sticks

MANUAL = 0  # ArduPilot Rover's number of the mode
ROVER_TYPES = (10, 11)  # MAV_TYPE: ground rover, surface boat
ARDUPILOT = 3  # MAV_AUTOPILOT
ARM, SET_MODE = 400, 176  # MAV_CMD
MODE_NAMES = {0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 10: "AUTO", 11: "RTL", 12: "SMART_RTL",
              15: "GUIDED", 16: "INITIALISING"}  # fmt: skip
SILENT_MS = 2500.0  # two of its heartbeats, which come once a second, and half of one
HEARTBEAT_MS, ASK_MS = 1000.0, 250.0
PATIENCE_MS = 5000.0  # for the parameters, and for the autopilot to arm
LATE_MS = 2000.0  # parameters that are not as required by then are told
REASON_MS = 500.0  # an autopilot first refuses and then says why, each check in a line of its own
REASON_STARTS, MAX_REASONS = ("Arm: ", "PreArm: "), 3


class Phase(Enum):
    """IDLE: not armed from here. LATCHED: something ended it, and the operator disarms before anything else."""

    IDLE = auto()
    CHECKING = auto()
    ARMING = auto()
    DRIVING = auto()
    LATCHED = auto()


class Heartbeat(NamedTuple):
    """Of the autopilot."""

    vehicle_type: int
    autopilot: int
    mode: int
    is_armed: bool


class Beat(NamedTuple):
    """Our own, which the autopilot's failsafe waits for."""


class Command(NamedTuple):
    """COMMAND_LONG."""

    number: int
    first: float
    second: float = 0.0


class ReadParameter(NamedTuple):
    """PARAM_REQUEST_READ."""

    name: str


class WriteParameter(NamedTuple):
    """PARAM_SET."""

    name: str
    value: float


STILL = Mixed(Sticks(0, 0), 0.0, 0.0)  # while the autopilot's own rest is not known
Order = Beat | Sticks | Command | ReadParameter | WriteParameter


class Autopilot:
    """Every method takes a monotonic clock, `now_ms`. `problem` says in one line why there is no thrust.

    Arming takes, in this order: the operator's word that the boat is not armed, heard since the start and since
    anything ended the last drive; his word that it is; every parameter read back as required; MANUAL; and the
    autopilot's own consent.
    """

    def __init__(self, own_system: int) -> None:
        self._parameters = ParameterTable(own_system)
        self._mixer: StickMixer | None = None
        self._heartbeat: Heartbeat | None = None
        self._heard_ms = self._beat_ms = self._asked_ms = self._armed_ms = -math.inf
        self._phase, self._phase_ms = Phase.IDLE, 0.0
        self._has_been_disarmed = self._has_armed = False
        self._refused_ms: float | None = None
        self._reasons: list[str] = []
        self._cause_text = ""
        self.mixed = STILL

    def receive_heartbeat(self, heartbeat: Heartbeat, now_ms: float) -> None:
        """Take the newest heartbeat of the autopilot."""
        self._heartbeat, self._heard_ms = heartbeat, now_ms

    def receive_parameter(self, name: str, value: float) -> None:
        """Take a parameter that was read; one that is not asked for now counts for nothing."""
        if self._phase is Phase.CHECKING:
            self._parameters.receive(name, value)

    def receive_text(self, text: str) -> None:
        """Take what the autopilot says, which tells why it does not arm."""
        is_new = text.startswith(REASON_STARTS) and text not in self._reasons
        if self._phase is Phase.ARMING and is_new and len(self._reasons) < MAX_REASONS:
            self._reasons.append(text)

    def receive_refusal(self, command: int, now_ms: float) -> None:
        """The autopilot does not do what it was told."""
        if self._phase is Phase.ARMING and command == ARM and self._refused_ms is None:
            self._refused_ms = now_ms

    def lose_line(self) -> None:
        """The line to the autopilot has broken: what was under way is over."""
        if self._phase is not Phase.IDLE:
            self._latch("the line to the autopilot broke")

    def silence_ms(self, now_ms: float) -> float:
        """Since its newest heartbeat, 1e9 before the first."""
        return min(max(now_ms - self._heard_ms, 0.0), 1e9)

    @property
    def is_driving(self) -> bool:
        """Whether the autopilot follows our sticks, as far as is known."""
        return self._phase is Phase.DRIVING

    def advance(self, decided: AppliedThrust, is_armed: bool | None, now_ms: float) -> list[Order]:
        """What to send now. is_armed: the operator's newest word, None where it is not known."""
        orders: list[Order] = []
        if now_ms - self._beat_ms >= HEARTBEAT_MS:
            self._beat_ms = now_ms
            orders.append(Beat())
        self._follow_operator(is_armed, now_ms)
        self._watch(now_ms)
        asks = now_ms - self._asked_ms >= ASK_MS
        if asks:
            self._asked_ms = now_ms
        self.mixed = self._mixer.still if self._mixer else STILL
        if self._mixer and self._phase is Phase.DRIVING and decided.zero_cause is m.ZeroCause.NONE:
            self.mixed = self._mixer.mix(decided.left, decided.right)
        heartbeat = self._heartbeat
        if not self._is_alive(now_ms):
            if self._has_armed:
                orders += self._let_go(asks)
        elif self._phase is Phase.CHECKING and heartbeat is not None and heartbeat.is_armed:
            orders += self._let_go(asks)  # the operator has disarmed since
        elif self._phase is Phase.CHECKING:
            orders += [self.mixed.sticks, *(self._check(now_ms) if asks else ())]
        elif self._phase is Phase.ARMING:
            self._has_armed = True
            orders.append(self.mixed.sticks)
            if asks and self._refused_ms is None:
                self._armed_ms = now_ms
                orders.append(Command(ARM, 1.0))
        elif self._phase is Phase.DRIVING:
            orders.append(self.mixed.sticks)
        elif self._has_armed and heartbeat is not None:
            if not heartbeat.is_armed:
                self._has_armed = now_ms - self._armed_ms <= SILENT_MS  # what is under way may arm it yet
            elif is_armed is False or heartbeat.mode == MANUAL:
                orders += self._let_go(asks)
        return orders

    def zero_cause(self, now_ms: float) -> m.ZeroCause:
        """Why the autopilot gives no thrust; NONE while it follows the sticks."""
        if not self._is_alive(now_ms):
            return m.ZeroCause.LINE_LOST
        if self._phase is Phase.DRIVING:
            return m.ZeroCause.NONE
        return m.ZeroCause.REARM if self._phase is Phase.IDLE else m.ZeroCause.REFUSED

    def problem(self, now_ms: float) -> str:
        """Empty while the autopilot is driven, or waits for the operator alone."""
        heartbeat = self._heartbeat
        if self._phase is Phase.LATCHED:
            return f"{self._cause_text}; disarm and arm again"
        if heartbeat is None or not self._is_alive(now_ms):
            return "no heartbeat of the autopilot"
        if foreign := _foreign(heartbeat):
            return foreign
        if self._phase is Phase.IDLE and heartbeat.is_armed and not self._has_armed:
            return "the autopilot was armed by somebody else"
        is_late = self._phase is Phase.CHECKING and now_ms - self._phase_ms > LATE_MS
        return self._parameters.problem() if is_late else ""

    def _follow_operator(self, is_armed: bool | None, now_ms: float) -> None:
        if is_armed is False:
            self._has_been_disarmed = True
            self._enter(Phase.IDLE, now_ms)
        elif is_armed is None and self._phase not in {Phase.IDLE, Phase.LATCHED}:
            self._latch("the operator's word is not known")
        elif is_armed and self._has_been_disarmed and self._phase is Phase.IDLE:
            self._parameters.clear()
            self._reasons, self._refused_ms = [], None
            self._enter(Phase.CHECKING, now_ms)

    def _watch(self, now_ms: float) -> None:
        """Latch what ends the drive, or its beginning."""
        heartbeat, waited_ms = self._heartbeat, now_ms - self._phase_ms
        if self._phase in {Phase.IDLE, Phase.LATCHED}:
            return
        if heartbeat is None or not self._is_alive(now_ms):
            self._latch("no heartbeat of the autopilot")
        elif foreign := _foreign(heartbeat):
            self._latch(foreign)
        elif self._phase is Phase.CHECKING and heartbeat.is_armed and not self._has_armed:
            self._latch("the autopilot was armed by somebody else")
        elif self._phase is Phase.CHECKING and waited_ms > PATIENCE_MS:
            self._latch(self._parameters.problem() or f"its mode is {_mode_name(heartbeat.mode)}, not MANUAL")
        elif self._phase in {Phase.ARMING, Phase.DRIVING} and heartbeat.mode != MANUAL:
            self._latch(f"its mode was changed to {_mode_name(heartbeat.mode)}, not from here")
        elif self._phase is Phase.ARMING and self._refused_ms is not None:
            if now_ms - self._refused_ms > REASON_MS:
                self._latch(f"does not arm: {self._reason('without a reason')}")
        elif self._phase is Phase.ARMING and heartbeat.is_armed:
            self._enter(Phase.DRIVING, now_ms)
        elif self._phase is Phase.ARMING and waited_ms > PATIENCE_MS:
            self._latch(f"does not arm: {self._reason('no answer')}")
        elif self._phase is Phase.DRIVING and not heartbeat.is_armed:
            self._latch("it was disarmed, not from here")

    def _check(self, now_ms: float) -> list[Order]:
        """Read what is not known, write what differs and read it again; then arm."""
        writes, reads = self._parameters.due()
        orders: list[Order] = [WriteParameter(*write) for write in writes]
        orders += map(ReadParameter, reads)
        is_manual = self._heartbeat is not None and self._heartbeat.mode == MANUAL
        if is_manual and not orders and not self._parameters.problem():
            self._mixer = self._parameters.mixer()
            self._enter(Phase.ARMING, now_ms)
        return orders if is_manual else [*orders, Command(SET_MODE, 1.0, MANUAL)]

    def _reason(self, otherwise: str) -> str:
        return "; ".join(self._reasons) or otherwise

    def _let_go(self, asks: bool) -> list[Order]:
        """No thrust, and disarmed: whether or not it is heard."""
        return [self.mixed.sticks, *([Command(ARM, 0.0)] if asks else ())]

    def _is_alive(self, now_ms: float) -> bool:
        return now_ms - self._heard_ms <= SILENT_MS

    def _enter(self, phase: Phase, now_ms: float) -> None:
        if phase is not self._phase:
            self._phase, self._phase_ms = phase, now_ms

    def _latch(self, cause_text: str) -> None:
        self._phase, self._cause_text = Phase.LATCHED, cause_text


def _foreign(heartbeat: Heartbeat) -> str:
    """Why what is at the other end is none that may be driven; empty where it is one."""
    if heartbeat.autopilot == ARDUPILOT and heartbeat.vehicle_type in ROVER_TYPES:
        return ""
    return f"no ArduPilot Rover (MAV_AUTOPILOT {heartbeat.autopilot}, MAV_TYPE {heartbeat.vehicle_type})"


def _mode_name(mode: int) -> str:
    return MODE_NAMES.get(mode, str(mode))
