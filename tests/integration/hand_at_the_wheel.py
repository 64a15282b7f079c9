"""A client of the operator's process that takes the wheel and drives ahead until it is killed.

`python -m tests.integration.hand_at_the_wheel SETTING...` prints how each of its requests was answered.
"""

from __future__ import annotations

import asyncio
import sys

from paani.bus import open_bus
from paani.clock import WallClock
from paani.config import load_config
from paani.messages import DriveMode
from paani.operator_client import OperatorClient

SURGE = 0.8


async def drive(sets: tuple[str, ...]) -> None:
    bus = await open_bus(load_config(sets=sets).bus, "arm", WallClock())
    client = OperatorClient(bus, WallClock())
    print(await client.set_mode(DriveMode.MANUAL, 5.0), flush=True)
    print(await client.take_wheel(5.0), flush=True)
    print(await client.set_mode(DriveMode.MANUAL, 5.0), flush=True)
    while True:
        client.drive(SURGE, 0.0)
        await asyncio.sleep(0.1)


if __name__ == "__main__":
    asyncio.run(drive(tuple(sys.argv[1:])))
