"""ROS 2 port: what is on the bus, as a node of a ROS graph; and what its nodes may ask of the boat."""

from __future__ import annotations

import asyncio
import functools
import logging

from paani import keys
from paani import messages as m
from paani.bus import Bus, Queue
from paani.bus.ros_graph import RosGraph, open_ros_graph
from paani.clock import Clock
from paani.config import Config
from paani.config.ros2 import require_ros_name
from paani.errors import UserError
from paani_services.ros2 import topics
from paani_services.ros2.commands import Commands
from paani_services.ros2.diagnostics import Diagnostics
from paani_services.ros2.frames import Frames
from paani_services.ros2.translation import RosMessage, Translator

LOG = logging.getLogger(__name__)
NODE = "paani"
INBOX_DEPTH = 64
WATCH_PERIOD_S = 0.5  # a new subscriber waits at most so long for its first picture


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Be the node `/<vessel>/paani` until told to stop. Raises UserError for a name or an address that cannot be."""
    settings, vessel = config.ros2, config.bus.vessel
    try:
        require_ros_name(vessel)
    except ValueError as error:
        raise UserError(str(error)) from error
    graph = await open_ros_graph(settings.listen, settings.domain_id, vessel, NODE, clock)
    try:
        port = Port(bus, clock, config, graph)
        with bus.alive():
            LOG.info("ROS 2 nodes of domain %d connect to %s", settings.domain_id, settings.listen)
            await port.serve()
    finally:
        await graph.close()


class Port:
    """The two sides of the port: the bus, and the graph."""

    def __init__(self, bus: Bus, clock: Clock, config: Config, graph: RosGraph) -> None:
        vessel = config.bus.vessel
        self._bus, self._clock = bus, clock
        self._translator = Translator(Frames(config.ros2.frame_prefix), config.calibration)
        self._diagnostics = Diagnostics(vessel, bus.graph)
        self._publishers = {topic.name: graph.publisher(topic.endpoint(vessel)) for topic in topics.SENT}
        self._commands = Commands(bus, clock, config, graph)
        self._pictures = bus.pull_picture(keys.PICTURE)
        rows = {topic.name: topic for topic in keys.every_topic(bus.graph)}
        self._inboxes = {name: bus.queue(rows[name], INBOX_DEPTH) for name in self._translator.sources}
        for name in self._diagnostics.sources:
            if name not in self._inboxes:
                bus.on(rows[name], functools.partial(self._note, name))

    async def serve(self) -> None:
        """Carry messages, each topic by a task of its own, so that none waits for another."""
        async with asyncio.TaskGroup() as group:
            for name, inbox in self._inboxes.items():
                group.create_task(self._carry(name, inbox), name=name)
            group.create_task(self._carry_pictures(), name="pictures")
            group.create_task(self._report(), name="diagnostics")
            self._commands.serve(group)

    def _note(self, name: str, message: m.Message) -> None:
        self._diagnostics.note(name, message, self._clock.now_us())

    async def _carry(self, name: str, inbox: Queue[m.Message]) -> None:
        noted = name in self._diagnostics.sources
        while True:
            message = await inbox.get()
            if noted:
                self._note(name, message)
            try:
                self._send(*self._translator.translate(name, message))
            except ValueError:
                self._bus.count_drop("out_of_range")

    async def _carry_pictures(self) -> None:
        """While a node watches: they are pulled, and nothing travels for nobody."""
        publisher = self._publishers[topics.IMAGE.name]
        while True:
            if publisher.is_watched():
                picture = await self._pictures.next()
                self._send(self._translator.picture(picture.header, picture.data))
            else:
                await asyncio.sleep(WATCH_PERIOD_S)

    async def _report(self) -> None:
        while True:
            self._send(self._diagnostics.report(self._clock.now_us()))
            await asyncio.sleep(1.0 / topics.DIAGNOSTICS.rate_hz)

    def _send(self, *messages: RosMessage) -> None:
        for topic, source_us, data in messages:
            self._publishers[topic.name].put(data, source_us)
