"""Republishes a recorded drive in time, on a router of its own."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import math
import os
import sys
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus, PicturePublisher, Publisher, open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock
from paani.config import Config, encode_config
from paani.errors import UserError
from paani.logs.pictures import RecordedPicture, paired_pictures
from paani.logs.reader import Log, Record
from paani.topic_names import present_name
from paani.undecodable import UNDECODABLE
from paani_tools.replay.shift import TimeShift

# Whoever hears these may move a boat or change how it is guided.
COMMANDS = frozenset(
    {keys.COMMAND.name, keys.THRUST.name, keys.ARMING.name, keys.TUNING.name, keys.ORDERED_MISSION.name}
    | {topic.name for topic in keys.ASKED}
)
MOVERS = ("plant", "thrusters", "bridge")  # services that turn thrust into motion, or advice into a light
DASHBOARD = "dashboard"
BATCH = 256
AHEAD_US = 300_000  # between the start and the first message

OnProgress = Callable[[float], None]
Item = Record | RecordedPicture


class RepublishOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What to republish: seconds since the log's start, how fast, which topics (None: all), whether commands too."""

    from_s: float = 0.0
    to_s: float = math.inf
    speed: float = 1.0
    loop: bool = False
    only: tuple[str, ...] | None = None
    commands: bool = False
    dashboard: bool = False


class RepublishResult(msgspec.Struct, frozen=True, kw_only=True):
    """What was republished. late_ms: how late messages were, median and 95th percentile."""

    messages: int
    passes: int
    late_ms: tuple[float, float]


OnEnd = Callable[[RepublishResult], None]


def topics_of(log: Log, what: RepublishOptions, graph: keys.Graph) -> list[keys.Topic[Any]]:
    """The topics of the log that will be republished, in its graph. Raises UserError for one that is not there."""
    known: dict[str, keys.Topic[Any]] = {topic.name: topic for topic in keys.topics_in(graph)}
    for service in keys.services_in(graph):
        known |= {topic.name: topic for topic in (keys.pulse(service), keys.health(service))}
    recorded = {name for name in log.topics if name in known}
    chosen = recorded if what.only is None else {present_name(name) for name in what.only}
    for name in sorted(chosen - recorded):
        raise UserError(f"--only {name}: not in {log.path}")
    if not what.commands:
        if what.only is not None and chosen & COMMANDS:
            raise UserError(f"--only {min(chosen & COMMANDS)}: commands are republished with --commands alone")
        chosen -= COMMANDS
        chosen = {name for name in chosen if not name.startswith("pulse/")}
    chosen.discard(keys.RECORDER_STATE.name)
    if what.dashboard:  # it speaks for itself
        chosen = {name for name in chosen if known[name].producer != DASHBOARD}
    return [known[name] for name in sorted(chosen)]


def replay_config(config: Config, log: Log) -> Config:
    """The recorded settings for whoever listens: another vessel's name marks every key as a replay."""
    bus = msgspec.structs.replace(config.bus, vessel=f"{config.bus.vessel[:25]}{keys.REPLAY_SUFFIX}")
    return msgspec.structs.replace(
        config,
        bus=bus,
        camera=msgspec.structs.replace(config.camera, source=str(log.path)),
        dashboard=msgspec.structs.replace(config.dashboard, serve=True, replayed=str(log.path.resolve())),
    )


async def republish(log: Log, config: Config, what: RepublishOptions, on_progress: OnProgress, on_end: OnEnd) -> None:
    """Run the router and republish until the end, or until cancelled; with a dashboard, which goes on, until cancelled.

    Raises UserError when the router's address is taken, or a service that could move a boat joins the bus.
    """
    topics = topics_of(log, what, config.bus.graph)
    router = await open_router(config.bus)
    try:
        async with contextlib.AsyncExitStack() as stack:
            observer = await _opened(stack, config, OBSERVER)
            buses = {user: await _opened(stack, config, user) for user in sorted({t.producer for t in topics})}
            if what.dashboard:
                await stack.enter_async_context(_dashboard(config, observer))
            player = Player(log, topics, buses, what, on_progress)
            on_end(await _unless_moving(observer, player.play()))
            if what.dashboard:
                await asyncio.Event().wait()
    finally:
        await asyncio.to_thread(router.close)


class Player:
    """Publishes every record when it is due."""

    def __init__(
        self,
        log: Log,
        topics: list[keys.Topic[Any]],
        buses: dict[str, Bus],
        what: RepublishOptions,
        on_progress: OnProgress,
    ) -> None:
        self._log, self._what, self._on_progress = log, what, on_progress
        self._clock = WallClock()
        self._publishers: dict[str, Publisher[Any]] = {
            topic.name: buses[topic.producer].picture_publisher(topic)
            if topic.stance is keys.Stance.PICTURE
            else buses[topic.producer].publisher(topic)
            for topic in topics
        }
        self._pictures = [topic.name for topic in topics if topic.stance is keys.Stance.PICTURE]
        self._header = msgspec.json.Decoder(m.PictureHeader)
        self._late_ms: list[float] = []
        self._messages = 0

    async def play(self) -> RepublishResult:
        """All passes, the first a moment from now."""
        what, log = self._what, self._log
        from_us = log.start_us + round(what.from_s * 1e6)
        to_us = log.end_us if math.isinf(what.to_s) else min(log.end_us, log.start_us + round(what.to_s * 1e6))
        span_us = max(0, to_us - from_us)
        begin_us = self._clock.now_us() + AHEAD_US
        passes = 0
        while passes == 0 or what.loop:
            await self._pass(TimeShift(from_us, begin_us, what.speed), from_us, to_us)
            passes += 1
            begin_us = max(begin_us + round(span_us / what.speed), self._clock.now_us())
        late = sorted(self._late_ms) or [0.0]
        return RepublishResult(
            messages=self._messages, passes=passes, late_ms=(late[len(late) // 2], late[int(len(late) * 0.95)])
        )

    async def _pass(self, shift: TimeShift, from_us: int, to_us: int) -> None:
        names = [*self._publishers, *(f"{name}/header" for name in self._pictures)]
        items = paired_pictures(self._log.records(names, from_us, to_us), self._pictures)
        async for item in _read_ahead(items):
            due_us = shift.shift_us(item.log_us)
            wait_us = due_us - self._clock.now_us()
            if wait_us > 0:
                await asyncio.sleep(wait_us * 1e-6)
            self._publish(item, shift)
            self._late_ms.append((self._clock.now_us() - due_us) * 1e-3)
            self._on_progress((item.log_us - from_us) / max(1, to_us - from_us))
        del self._late_ms[:-100_000]

    def _publish(self, item: Item, shift: TimeShift) -> None:
        publisher = self._publishers[item.topic]
        if isinstance(item, Record):
            publisher.forward(shift.shift_message(item.data))
        elif isinstance(publisher, PicturePublisher):
            with contextlib.suppress(*UNDECODABLE):  # of another version
                publisher.forward_picture(self._header.decode(shift.shift_message(item.header)), item.data)
        self._messages += 1


async def _read_ahead(items: Iterator[Item]) -> AsyncIterator[Item]:
    """Items read off the event loop, the next batch while this one is used."""
    reading = asyncio.create_task(asyncio.to_thread(_batch, items))
    try:
        while batch := await reading:
            reading = asyncio.create_task(asyncio.to_thread(_batch, items))
            for item in batch:
                yield item
    finally:
        reading.cancel()


def _batch(items: Iterator[Item]) -> list[Item]:
    return list(itertools.islice(items, BATCH))


async def _opened(stack: contextlib.AsyncExitStack, config: Config, user: str) -> Bus:
    bus = await open_bus(config.bus, user, WallClock())
    stack.push_async_callback(bus.close)
    return bus


async def _unless_moving(observer: Bus, work: Coroutine[Any, Any, RepublishResult]) -> RepublishResult:
    """Await the work; stop it when something that can move a boat joins this bus."""

    async def first_motion() -> str:
        async for service, alive in observer.alive_events():
            if alive and service in MOVERS:
                return service
        raise AssertionError("alive events never end")

    playing, watching = asyncio.create_task(work), asyncio.create_task(first_motion())
    try:
        await asyncio.wait({playing, watching}, return_when=asyncio.FIRST_COMPLETED)
        if watching.done() and not playing.done():
            raise UserError(f"{watching.result()} has joined the bus of this replay: it would act on what was long ago")
        return await playing
    finally:
        for task in (playing, watching):
            task.cancel()
        await asyncio.gather(playing, watching, return_exceptions=True)


@contextlib.asynccontextmanager
async def _dashboard(config: Config, observer: Bus) -> AsyncIterator[None]:
    """The dashboard process beside the replay; dies with it."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani_tools.up.child", str(os.getpid()), DASHBOARD,
        env={**os.environ, "PAANI_CONFIG_JSON": encode_config(config).decode()},
        stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stderr is not None
    last = asyncio.create_task(_last_line(process.stderr))
    alive = asyncio.create_task(_until_alive(observer, DASHBOARD))
    try:
        await asyncio.wait({last, alive}, return_when=asyncio.FIRST_COMPLETED)
        if last.done():
            raise UserError(last.result().removeprefix("paani dashboard: "))
        yield
    finally:
        alive.cancel()
        if process.returncode is None:
            process.terminate()
        await last
        await process.wait()


async def _last_line(stream: asyncio.StreamReader) -> str:
    """Read to the end, so that the writer never waits."""
    line = "the dashboard ended"
    async for raw in stream:
        line = raw.decode(errors="replace").strip() or line
    return line


async def _until_alive(observer: Bus, wanted: str) -> None:
    async for service, alive in observer.alive_events():
        if alive and service == wanted:
            return
