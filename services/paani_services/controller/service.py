"""Controller process: order and odometry in, thrust out."""

import asyncio
import contextlib

from paani import keys
from paani.bus import Bus, Stepper
from paani.clock import Clock
from paani.config import Config
from paani.messages import Thrust
from paani_services.controller.decide import DECIDER

SILENCE_PERIODS = 1.5  # without an order for so many periods, the controller steps by itself


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Answer each order at once, and go on at about `rate_hz` when none comes."""
    stepper = Stepper(bus, clock, config, DECIDER)
    command = stepper.inboxes[keys.COMMAND.name]
    silence_s = SILENCE_PERIODS / config.controller.rate_hz
    with bus.alive():
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(silence_s):
                    await command.next()
            _, outputs = stepper.decide()
            thrust = stepper.conclude(outputs)[keys.THRUST.name]
            assert isinstance(thrust, Thrust)
            bus.note(", ".join(thrust.inhibits))
