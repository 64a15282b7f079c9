"""Dashboard process: everything on the bus to the page; the operator's word to the bus."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest
from paani.clock import Clock
from paani.config import Config
from paani.runtime import runtime_dir
from paani_services.dashboard.console import Console
from paani_services.dashboard.hub import Event, Hub
from paani_services.dashboard.pages import load_pages
from paani_services.dashboard.server import Server, start_server
from paani_services.dashboard.settings import Lives, page_operator, page_settings
from paani_services.dashboard.tuning import Tuner

STATE_PERIOD_S = 0.1  # the eye wants no more of a number
OPERATOR_PERIOD_S = 0.2


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Speak for the operator always; serve the page unless `dashboard.serve` is false."""
    folder = await asyncio.to_thread(runtime_dir, config.bus)
    console = Console(bus.publisher(keys.ARMING), folder, clock)
    await console.restore(arm_at_start=config.dashboard.arm_at_start)
    tuner = Tuner(bus.publisher(keys.TUNING), clock)
    page = show_page(bus, console, tuner, clock, config) if config.dashboard.serve else contextlib.nullcontext()
    async with page:
        with bus.alive():
            async with asyncio.TaskGroup() as speaking:
                speaking.create_task(console.speak_always())
                speaking.create_task(tuner.speak_always())


@contextlib.asynccontextmanager
async def show_page(bus: Bus, console: Console, tuner: Tuner, clock: Clock, config: Config) -> AsyncIterator[None]:
    """The web server and what feeds it, while the context lasts."""
    hub = Hub()
    hub.put("dashboard/settings", page_settings(config), clock.now_us(), clock.now_us())
    async with serving(hub, console, tuner, clock, config), asyncio.TaskGroup() as tasks:
        picture_period_s = 1.0 / config.dashboard.picture_rate_hz
        feeds = [forward(hub, topic, inbox, clock, STATE_PERIOD_S) for topic, inbox in subscribe(bus)]
        feeds.append(forward(hub, keys.PICTURE, bus.latest_picture(keys.PICTURE), clock, picture_period_s))
        feeds.append(forward_while_watched(hub, keys.MASK, bus.pull_picture(keys.MASK), clock, picture_period_s))
        feeds.append(forward_applied(hub, console, bus.latest(keys.THRUST_APPLIED), clock))
        feeds.append(forward_shadow(hub, tuner, bus.latest(keys.SHADOW), clock))
        feeds += [show_operator(hub, console, clock), show_lives(hub, bus, clock)]
        running = [tasks.create_task(feed) for feed in feeds]
        try:
            yield
        finally:
            for task in running:
                task.cancel()


@contextlib.asynccontextmanager
async def serving(hub: Hub, console: Console, tuner: Tuner, clock: Clock, config: Config) -> AsyncIterator[None]:
    """The web server, while the context lasts."""
    token = secrets.token_urlsafe(24)
    pages = await asyncio.to_thread(load_pages, token)
    server = Server(hub, console, tuner, clock, config.dashboard, pages, token)
    runner = await start_server(server.app(), config.dashboard)
    try:
        yield
    finally:
        await runner.cleanup()


def subscribe(bus: Bus) -> list[tuple[keys.Topic[Any], Latest[Any]]]:
    """Every topic that is plain JSON, but those that answer the operator, and every health report."""
    answers = (keys.THRUST_APPLIED, keys.SHADOW)
    topics: list[keys.Topic[Any]] = [
        topic for topic in keys.TOPICS if topic.stance is not keys.Stance.PICTURE and topic not in answers
    ]
    topics += [keys.health(service) for service in keys.SERVICES]
    return [(topic, bus.latest(topic)) for topic in topics]


async def forward(hub: Hub, topic: keys.Topic[Any], inbox: Latest[Any], clock: Clock, period_s: float) -> None:
    """Each new message at once, then at most one in `period_s`, the newest."""
    while True:
        value = await inbox.next()
        hub.put(topic.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_while_watched(
    hub: Hub, topic: keys.Topic[Any], inbox: Latest[Any], clock: Clock, period_s: float
) -> None:
    """Pull only while somebody watches."""
    while True:
        await hub.watched.wait()
        value = await inbox.next()
        hub.put(topic.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_applied(hub: Hub, console: Console, inbox: Latest[m.ThrustApplied], clock: Clock) -> None:
    """What the plant applies: to the page, and to the STOP that waits for it."""
    while True:
        value = await inbox.next()
        console.hear_applied(value)
        hub.put(keys.THRUST_APPLIED.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(0.5 / keys.THRUST_APPLIED.rate_hz)


async def forward_shadow(hub: Hub, tuner: Tuner, inbox: Latest[m.Shadow], clock: Clock) -> None:
    """What is tried beside the policy: to the page, and to the request that waits for it."""
    while True:
        value = await inbox.next()
        if (event := tuner.hear(value)) is not None:
            hub.tell(event)
        hub.put(keys.SHADOW.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(STATE_PERIOD_S)


async def show_operator(hub: Hub, console: Console, clock: Clock) -> None:
    """The operator's word on every page, at once when it changes."""
    while True:
        now_us = clock.now_us()
        hub.put("dashboard/operator", page_operator(console.state), now_us, now_us)
        await console.changed(OPERATOR_PERIOD_S)


async def show_lives(hub: Hub, bus: Bus, clock: Clock) -> None:
    """Who is alive, and a line when that changes."""
    lives = Lives()
    async for service, alive in bus.alive_events():
        now_us = clock.now_us()
        hub.put("dashboard/services", lives.hear(service, alive), now_us, now_us)
        if service != bus.user:
            level, text = ("info", "is ready") if alive else ("warn", "is gone")
            hub.tell(Event(now_us, level, f"{service} {text}"))
