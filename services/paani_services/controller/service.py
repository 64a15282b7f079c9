"""Controller process: command and odometry in, thrust out."""

import asyncio
import contextlib

from paani import keys
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani_services.controller.control import ControlState, Heard, control

SILENCE_PERIODS = 1.5  # a command drives each output; the timer only fills silence


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Answer each command at once, and go on at about `rate_hz` when none comes."""
    command, odometry = bus.latest(keys.COMMAND), bus.latest(keys.ODOMETRY)
    thrust = bus.publisher(keys.THRUST)
    state = ControlState()
    silence_s = SILENCE_PERIODS / config.controller.rate_hz
    with bus.alive():
        while True:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(command.next(), silence_s)
            heard = Heard(command.value, command.received_us, odometry.value, odometry.received_us)
            state, message = control(state, heard, clock.now_us(), config.bus.domain, config.controller)
            bus.note(", ".join(message.inhibits))
            thrust.put(message)
