"""Button process: looks at a hardware button, and asks the operator's process for STOP."""

from __future__ import annotations

import asyncio
import contextlib
import logging

from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani.errors import UserError
from paani.operator_client import OperatorClient
from paani_services.button.device import open_button
from paani_services.button.request import Asking, answered, has_to_ask, look

LOG = logging.getLogger(__name__)
PERIOD_S = 0.02
LOOK_S = 0.2  # a device that takes longer does not answer
ANSWER_S = 0.3


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Until told to stop. Raises UserError without a line."""
    if not config.button.line:
        raise UserError("button.line: not set (where the button is, such as input:/dev/input/by-id/NAME)")
    client, button = OperatorClient(bus, clock), open_button(config.button.line)
    asking, looking = Asking(), asyncio.create_task(asyncio.to_thread(button.look))
    with contextlib.closing(button), bus.alive():
        while True:
            done, _ = await asyncio.wait({looking}, timeout=LOOK_S)
            why = looking.result() if done else f"{config.button.line}: does not answer"
            if why != asking.why:
                LOG.warning("%s", why or "up again")
                bus.note(why or "up")
            asking = look(asking, why)
            if has_to_ask(asking, client.state) and await client.stop(ANSWER_S) is not None:
                asking = answered(asking)
            if done:
                await asyncio.sleep(PERIOD_S)
                looking = asyncio.create_task(asyncio.to_thread(button.look))
