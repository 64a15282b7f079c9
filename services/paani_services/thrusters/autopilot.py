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

MANUAL = 0  # ArduPilot Rover's number of the mode
ROVER_TYPES = (10, 11)  # MAV_TYPE: ground rover, surface boat
ARDUPILOT = 3  # MAV_AUTOPILOT
ARM, SET_MODE = 400, 176  # MAV_CMD
MODE_NAMES = {0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 10: "AUTO", 11: "RTL", 12: "SMART_RTL",
              15: "GUIDED", 16: "INITIALISING"}  # fmt: skip
SILENT_MS = 2500.0  # two of its heartbeats, which come once a second, and half of one
HEARTBEAT_MS, ASK_MS = 1000.0, 250.0
PATIENCE_MS = 5000.0  # for the parameters, and for the autopilot to arm
TOLERANCE = 1e-3


class Requirement(NamedTuple):
    """A parameter of the autopilot that must read `value`; of several names the autopilot knows one."""

    names: tuple[str, ...]
    value: float


def required_parameters(own_system: int) -> tuple[Requirement, ...]:
    """What makes the autopilot let go of the motors when this process, or its line, is gone.

    And what makes it mix the sticks as `thrust_of` does: its mixer (AP_MotorsUGV) adds and subtracts the two.
    """
    return (
        Requirement(("SYSID_MYGCS", "MAV_GCS_SYSID"), own_system),  # whose sticks and heartbeat count
        Requirement(("RC_OVERRIDE_TIME",), 0.5),  # sticks not renewed for so long are let go, in seconds
        Requirement(("FS_THR_ENABLE",), 1),  # without sticks and receiver: no thrust, and the action
        Requirement(("FS_GCS_ENABLE",), 1),  # without our heartbeat: the action
        Requirement(("FS_GCS_TIMEOUT",), 2),  # seconds, the least it takes
        Requirement(("FS_TIMEOUT",), 1),  # seconds from a loss to the action, the least it takes
        Requirement(("FS_ACTION",), 2),  # HOLD: no thrust
        Requirement(("PILOT_STEER_TYPE",), 3),  # the sticks are ahead and starboard, and not the two sides
        Requirement(("MOT_THR_MIN",), 0),  # nothing is added to what the thrust adapter decided
    )


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


class Sticks(NamedTuple):
    """MANUAL_CONTROL: `ahead` and `starboard` from -1000 to 1000."""

    ahead: int
    starboard: int


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


Order = Beat | Sticks | Command | ReadParameter | WriteParameter
STILL = Sticks(0, 0)


def sticks_of(left: float, right: float) -> Sticks:
    """The sticks that the autopilot mixes to no more than this thrust of either side.

    Both sides are rounded towards zero, to even thousandths, so that their mean and half their difference are whole.
    """
    port, starboard = 2 * math.trunc(left * 500), 2 * math.trunc(right * 500)
    return Sticks((port + starboard) // 2, (port - starboard) // 2)


def thrust_of(sticks: Sticks) -> tuple[float, float]:
    """Left and right, as ArduPilot's skid steering mixes them."""
    return (sticks.ahead + sticks.starboard) / 1000, (sticks.ahead - sticks.starboard) / 1000


class Autopilot:
    """Every method takes a monotonic clock, `now_ms`. `problem` says in one line why there is no thrust.

    Arming takes, in this order: the operator's word that the boat is not armed, heard since the start and since
    anything ended the last drive; his word that it is; every parameter read back as required; MANUAL; and the
    autopilot's own consent.
    """

    def __init__(self, own_system: int) -> None:
        self._requirements = required_parameters(own_system)
        self._read: dict[str, float] = {}
        self._heartbeat: Heartbeat | None = None
        self._heard_ms = self._beat_ms = self._asked_ms = self._armed_ms = -math.inf
        self._phase, self._phase_ms = Phase.IDLE, 0.0
        self._has_been_disarmed = self._has_armed = False
        self._cause_text = self._autopilot_text = ""
        self.sticks = STILL

    def receive_heartbeat(self, heartbeat: Heartbeat, now_ms: float) -> None:
        """Take the newest heartbeat of the autopilot."""
        self._heartbeat, self._heard_ms = heartbeat, now_ms

    def receive_parameter(self, name: str, value: float) -> None:
        """Take a parameter that was read; one that is not asked for now counts for nothing."""
        if self._phase is Phase.CHECKING:
            self._read[name] = value

    def receive_text(self, text: str) -> None:
        """Take what the autopilot says, which tells why it does not arm."""
        if self._phase is Phase.ARMING:
            self._autopilot_text = text

    def receive_refusal(self, command: int) -> None:
        """The autopilot does not do what it was told."""
        if self._phase is Phase.ARMING and command == ARM:
            self._latch(f"does not arm: {self._autopilot_text or 'without a reason'}")

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
        self.sticks = STILL
        if self._phase is Phase.DRIVING and decided.zero_cause is m.ZeroCause.NONE:
            self.sticks = sticks_of(decided.left, decided.right)
        heartbeat = self._heartbeat
        if not self._is_alive(now_ms):
            if self._has_armed:
                orders += self._let_go(asks)
        elif self._phase is Phase.CHECKING and heartbeat is not None and heartbeat.is_armed:
            orders += self._let_go(asks)  # the operator has disarmed since
        elif self._phase is Phase.CHECKING:
            orders += [STILL, *(self._check(now_ms) if asks else ())]
        elif self._phase is Phase.ARMING:
            self._has_armed = True
            orders.append(STILL)
            if asks:
                self._armed_ms = now_ms
                orders.append(Command(ARM, 1.0))
        elif self._phase is Phase.DRIVING:
            orders.append(self.sticks)
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
        return self._differing() if self._phase is Phase.CHECKING else ""

    def _follow_operator(self, is_armed: bool | None, now_ms: float) -> None:
        if is_armed is False:
            self._has_been_disarmed = True
            self._enter(Phase.IDLE, now_ms)
        elif is_armed is None and self._phase not in {Phase.IDLE, Phase.LATCHED}:
            self._latch("the operator's word is not known")
        elif is_armed and self._has_been_disarmed and self._phase is Phase.IDLE:
            self._read.clear()
            self._autopilot_text = ""
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
            self._latch(self._differing() or f"its mode is {_mode_name(heartbeat.mode)}, not MANUAL")
        elif self._phase in {Phase.ARMING, Phase.DRIVING} and heartbeat.mode != MANUAL:
            self._latch(f"its mode was changed to {_mode_name(heartbeat.mode)}, not from here")
        elif self._phase is Phase.ARMING and heartbeat.is_armed:
            self._enter(Phase.DRIVING, now_ms)
        elif self._phase is Phase.ARMING and waited_ms > PATIENCE_MS:
            self._latch(f"does not arm: {self._autopilot_text or 'no answer'}")
        elif self._phase is Phase.DRIVING and not heartbeat.is_armed:
            self._latch("it was disarmed, not from here")

    def _check(self, now_ms: float) -> list[Order]:
        """Read what is not known, write what differs and read it again; then arm."""
        heartbeat = self._heartbeat
        orders: list[Order] = []
        for requirement in self._requirements:
            known = [name for name in requirement.names if name in self._read]
            for name in known:
                if not abs(self._read[name] - requirement.value) <= TOLERANCE:
                    orders += [WriteParameter(name, requirement.value), ReadParameter(name)]
            orders += [ReadParameter(name) for name in requirement.names] if not known else []
        is_manual = heartbeat is not None and heartbeat.mode == MANUAL
        if not orders and is_manual:
            self._enter(Phase.ARMING, now_ms)
        return orders if is_manual else [*orders, Command(SET_MODE, 1.0, MANUAL)]

    def _differing(self) -> str:
        """The first parameter that is not known to be as required."""
        for requirement in self._requirements:
            name = next((name for name in requirement.names if name in self._read), requirement.names[0])
            value = self._read.get(name)
            if value is None or not abs(value - requirement.value) <= TOLERANCE:
                read = "is not answered" if value is None else f"reads {value:g}"
                return f"parameter {name} {read}, expected {requirement.value:g}"
        return ""

    def _let_go(self, asks: bool) -> list[Order]:
        """No thrust, and disarmed: whether or not it is heard."""
        return [STILL, *([Command(ARM, 0.0)] if asks else ())]

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
