"""Feeds the summary from the bus, as the observer: reads everything, writes nothing."""

from __future__ import annotations

import asyncio
import collections
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.sides import Side, services_on, topics_on
from paani_tools.up.run_summary import Summary

FED: tuple[keys.Topic[Any], ...] = (
    keys.EVIDENCE,
    keys.ADVISORY,
    keys.COMMAND,
    keys.THRUST,
    keys.THRUST_APPLIED,
    keys.TRUE_POSE,
    keys.ODOMETRY,
    keys.ARMING,
    keys.TUNING,
)
PICTURES = (keys.PICTURE, keys.RENDERED)
DRAIN_S = 0.25


class Collector:
    """Subscribes when made; `run` hands over what came until it is cancelled.

    Of a board and its host, each counts what is written on its own side: nothing crosses the link to be counted.
    """

    def __init__(self, bus: Bus, side: Side, summary: Summary) -> None:
        self._summary = summary
        self._arrived: collections.deque[m.Message] = collections.deque()
        written = {topic.name for topic in topics_on(side, bus.graph)}
        for topic in FED:
            if topic.name in written:
                bus.on(topic, self._arrived.append)
        for service in services_on(side, bus.graph):
            bus.on(keys.health(service), self._arrived.append)
        self._pictures = [(topic.producer, bus.latest_picture(topic)) for topic in PICTURES if topic.name in written]
        self._counted: collections.Counter[str] = collections.Counter()

    async def run(self) -> None:
        while True:
            await asyncio.sleep(DRAIN_S)
            self.drain()

    def drain(self) -> None:
        """Feed what has arrived since the last time."""
        for _ in range(len(self._arrived)):
            self._summary.feed(self._arrived.popleft())
        for producer, inbox in self._pictures:
            self._summary.count_output(producer, inbox.received - self._counted[producer])
            self._counted[producer] = inbox.received
