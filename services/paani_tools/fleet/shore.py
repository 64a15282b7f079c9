"""The shore's session at each vessel's router: a vessel that is away delays no other.

There is no router that joins all of them. A Zenoh router signs in everywhere by the same password, while each vessel
has made its own; and what no router joins, none can pass on from one vessel to another.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, open_bus
from paani.clock import Clock
from paani.config import BusConfig
from paani.operator_client import OperatorClient
from paani_tools.fleet.vessel_state import TOPICS, Telemetry, VesselState, describe_vessel

STOP_S = 2.0


class Vessel:
    """One vessel as the shore hears it."""

    def __init__(self, config: BusConfig, clock: Clock) -> None:
        self.name = config.vessel
        self._config, self._clock = config, clock
        self._bus: Bus | None = None
        self._client: OperatorClient | None = None
        self._latest: dict[str, Latest[Any]] = {}

    async def join(self) -> None:
        """Sign in at its router, for as long as that takes, and listen."""
        bus = await open_bus(self._config, keys.SHORE, self._clock)
        self._bus = bus
        self._latest = {row.name: bus.latest(row) for row in keys.topics_ashore(bus.graph)}
        self._client = OperatorClient(bus, self._clock)

    async def leave(self) -> None:
        """Close the session."""
        if self._bus is not None:
            await self._bus.close()

    @property
    def received(self) -> int:
        """Messages so far."""
        return sum(inbox.received for inbox in self._latest.values())

    @property
    def state(self) -> VesselState:
        """The row of this moment."""
        health = keys.health("").name

        heard = {name: self._latest[topic.name] for name, topic in TOPICS.items() if topic.name in self._latest}
        return describe_vessel(
            self.name,
            Telemetry(
                age_s=min((inbox.receipt_age_s() for inbox in self._latest.values()), default=math.inf),
                ages_s={name: inbox.receipt_age_s() for name, inbox in heard.items()},
                **{name: inbox.value for name, inbox in heard.items()},
                health={
                    name.removeprefix(health): (inbox.value, inbox.receipt_age_s())
                    for name, inbox in self._latest.items()
                    if name.startswith(health) and inbox.value is not None
                },
            ),
        )

    async def stop(self, timeout_s: float = STOP_S) -> m.OperatorState | None:
        """Ask for STOP; the state in which it is latched, or None where nobody has answered in time."""
        return None if self._client is None else await self._client.stop(timeout_s)


@contextlib.asynccontextmanager
async def watch_fleet(fleet: Sequence[BusConfig], clock: Clock) -> AsyncIterator[tuple[Vessel, ...]]:
    """All vessels, each joined as soon as its router lets the shore in."""
    # Zenoh's open() holds a thread for two seconds where nobody answers: there is one for each vessel.
    asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(2 * len(fleet) + 4))
    vessels = tuple(Vessel(config, clock) for config in fleet)
    tasks = [asyncio.create_task(vessel.join(), name=vessel.name) for vessel in vessels]
    try:
        yield vessels
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.gather(*(vessel.leave() for vessel in vessels))


async def stop_vessels(vessels: Iterable[Vessel]) -> dict[str, m.OperatorState | None]:
    """Ask all of these at the same time; by name, as `Vessel.stop`."""
    asked = tuple(vessels)
    states = await asyncio.gather(*(vessel.stop() for vessel in asked))
    return {vessel.name: state for vessel, state in zip(asked, states, strict=True)}
