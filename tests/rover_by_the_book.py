"""The conversation with an autopilot, and at its far end one by the book, without a line between them."""

from __future__ import annotations

from paani import messages as m
from paani.thrust_adapter import AppliedThrust
from paani_services.thrusters.autopilot import (
    ARM,
    MANUAL,
    SET_MODE,
    Autopilot,
    Command,
    Heartbeat,
    Order,
    ReadParameter,
    WriteParameter,
)
from paani_services.thrusters.autopilot_parameters import required_parameters
from paani_services.thrusters.autopilot_sticks import Channel, StickMixer, Sticks

AHEAD = AppliedThrust(0.4, 0.2, 30.0, 15.0, m.ZeroCause.NONE)
PERIOD_MS = 50
STILL = Sticks(0, 0)
CHANNEL = {"MIN": 1000.0, "MAX": 2000.0, "TRIM": 1500.0, "DZ": 0.0, "REVERSED": 0.0}
STICKS = {
    "RCMAP_ROLL": 1.0, "RCMAP_THROTTLE": 3.0, "RC_OPTIONS": 32.0, "MOT_THR_MAX": 100.0,
    "SERVO2_FUNCTION": 73.0, "SERVO16_FUNCTION": 74.0,
    **{f"RC{number}_{field}": value for number in (1, 3) for field, value in CHANNEL.items()},
}  # fmt: skip
ROUND = Channel(1000, 2000, 1500, 0, False)
MIXER = StickMixer(ROUND, ROUND)


class RoverByTheBook:
    """The far end by the book: what it is told it does, once a second it says how it is. `silent`: it says nothing."""

    def __init__(self) -> None:
        self.autopilot = Autopilot(254)
        self.parameters = STICKS | {requirement.names[0]: 9.0 for requirement in required_parameters(254)}
        self.stuck: dict[str, float] = {}
        self.mode, self.is_armed, self.is_silent = MANUAL, False, False
        self.vehicle, self.refuses_mode = (11, 3), False
        self.now_ms = 0.0
        self.sent: list[Order] = []

    def run(self, is_armed: bool | None, seconds: float = 2.0, decided: AppliedThrust = AHEAD) -> list[Order]:
        """Go on for so long; what was sent meanwhile."""
        self.sent = []
        for _ in range(round(seconds * 1000 / PERIOD_MS)):
            self.now_ms += PERIOD_MS
            if self.now_ms % 1000 == 0 and not self.is_silent:
                self.autopilot.receive_heartbeat(Heartbeat(*self.vehicle, self.mode, self.is_armed), self.now_ms)
            orders = self.autopilot.advance(decided, is_armed, self.now_ms)
            self.sent += orders
            for order in orders:
                self.obey(order)
        return self.sent

    def obey(self, order: Order) -> None:
        match order:
            case Command(number, first, _) if number == ARM and not self.is_silent:
                self.is_armed = first == 1.0
            case Command(number, _, second) if number == SET_MODE and not self.refuses_mode:
                self.mode = int(second)
            case WriteParameter(name, value) if name in self.parameters:
                self.parameters[name] = value
            case ReadParameter(name) if name in self.parameters:
                self.autopilot.receive_parameter(name, self.stuck.get(name, self.parameters[name]))
            case _:
                pass

    def drive(self) -> None:
        self.run(is_armed=False)
        self.run(is_armed=True, seconds=4.0)
        assert self.autopilot.is_driving

    @property
    def sticks(self) -> list[Sticks]:
        return [order for order in self.sent if isinstance(order, Sticks)]

    @property
    def arming(self) -> list[float]:
        return [order.first for order in self.sent if isinstance(order, Command) and order.number == ARM]

    @property
    def problem(self) -> str:
        return self.autopilot.problem(self.now_ms)
