"""The bus of a boat with thrusters: the words of operator and controller, and what the thrusters make of them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock
from paani.config import Config
from tests.mcu_peer import until

CLOCK = WallClock()
PULSES = 'plant.adapter.require_pulses=["navigator", "localization"]'
USERS = ("operator", "dashboard", "controller", "navigator", "localization", "observer")


class ThrusterBus:
    """`armed` None: the operator is silent; `word_age_us`: how old his word is when it comes.

    `thrust` is ordered of both sides, `turn` more of the left one.
    """

    def __init__(self, config: Config, buses: dict[str, Bus]) -> None:
        self.config, self.buses = config, buses
        self.armed: bool | None = None
        self.word_age_us = 0
        self.thrust, self.turn, self.is_pulsing = 0.2, 0.0, True
        observer = buses["observer"]
        self.time: Latest[m.SimTime] = observer.latest(keys.SIM_TIME)
        self.applied: Latest[m.ThrustApplied] = observer.latest(keys.THRUST_APPLIED)
        self.state: Latest[m.ThrustersState] = observer.latest(keys.THRUSTERS_STATE)

    async def speak(self) -> None:
        """Operator, controller, who echoes the thrusters' own clock, and every pulse that is waited for: at 10 Hz."""
        arming = self.buses["operator"].publisher(keys.ARMING)
        thrust = self.buses["controller"].publisher(keys.THRUST)
        pulses = [self.buses[name].publisher(keys.pulse(name)) for name in self.config.plant.adapter.require_pulses]
        while True:
            now_us = CLOCK.now_us()
            if self.armed is not None:
                arming.put(m.Arming(source_us=now_us - self.word_age_us, armed=self.armed))
            for pulse in pulses if self.is_pulsing else ():
                pulse.put(m.Pulse(source_us=now_us))
            echo_us = self.time.value.stamp_us if self.time.value else 0
            left, right = self.thrust + self.turn, self.thrust - self.turn
            thrust.put(m.Thrust(source_us=now_us, left=left, right=right, enabled=True, echo_us=echo_us))
            await asyncio.sleep(0.1)

    @property
    def cause(self) -> m.ZeroCause | None:
        return self.applied.value.zero_cause if self.applied.value else None

    async def until_cause(self, cause: m.ZeroCause) -> None:
        await until(lambda: self.cause is cause, 8.0)

    async def drive(self) -> None:
        """Disarm, arm, and wait until the boat moves."""
        self.armed = False
        await until(self._is_disarmed, 8.0)
        self.armed = True
        await self.until_cause(m.ZeroCause.NONE)

    def _is_disarmed(self) -> bool:
        state = self.state.value
        return state is not None and not state.armed and state.mcu is m.McuState.FRESH and not state.problem


@contextlib.asynccontextmanager
async def opened(config: Config) -> AsyncIterator[dict[str, Bus]]:
    """A router, and a bus for each that speaks, and for the thrusters."""
    router = await open_router(config.bus)
    buses = {user: await open_bus(config.bus, user, CLOCK) for user in (*USERS, "thrusters")}
    try:
        yield buses
    finally:
        for bus in buses.values():
            await bus.close()
        await asyncio.to_thread(router.close)
