"""Dashboard process: messages of the bus to the page, the operator's state and requests to the bus."""

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
from paani_services.dashboard.page_state import ServiceLiveness, page_operator, page_settings
from paani_services.dashboard.pages import load_static_files
from paani_services.dashboard.server import Server, serving
from paani_services.dashboard.tuning import Tuner

STATE_PERIOD_S = 0.1  # people read numbers no faster
OPERATOR_PERIOD_S = 0.2


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish the operator's state and requests; serve the page unless `dashboard.serve` is false."""
    folder = await asyncio.to_thread(runtime_dir, config.bus)
    console = Console(bus.publisher(keys.ARMING), folder, clock)
    await console.restore(arm_at_start=config.dashboard.arm_at_start)
    tuner = Tuner(bus.publisher(keys.TUNING), clock)
    page = serve_page(bus, console, tuner, clock, config) if config.dashboard.serve else contextlib.nullcontext()
    async with page:
        with bus.alive():
            async with asyncio.TaskGroup() as publishing:
                publishing.create_task(console.publish_forever())
                publishing.create_task(tuner.publish_forever())


@contextlib.asynccontextmanager
async def serve_page(bus: Bus, console: Console, tuner: Tuner, clock: Clock, config: Config) -> AsyncIterator[None]:
    """Run the web server and the tasks that feed it while the context lasts."""
    hub = Hub()
    hub.put("dashboard/settings", page_settings(config), clock.now_us(), clock.now_us())
    async with web_server(hub, console, tuner, clock, config), asyncio.TaskGroup() as tasks:
        picture_period_s = 1.0 / config.dashboard.picture_rate_hz
        feeds = [forward(hub, topic, inbox, clock, STATE_PERIOD_S) for topic, inbox in subscribe(bus)]
        feeds.append(forward(hub, keys.PICTURE, bus.latest_picture(keys.PICTURE), clock, picture_period_s))
        feeds.append(forward_while_clients(hub, keys.MASK, bus.pull_picture(keys.MASK), clock, picture_period_s))
        feeds.append(forward_applied(hub, console, bus.latest(keys.THRUST_APPLIED), clock))
        feeds.append(forward_shadow(hub, tuner, bus.latest(keys.SHADOW), clock))
        feeds += [publish_operator_state(hub, console, clock), track_services(hub, bus, clock)]
        running = [tasks.create_task(feed) for feed in feeds]
        try:
            yield
        finally:
            for task in running:
                task.cancel()


@contextlib.asynccontextmanager
async def web_server(hub: Hub, console: Console, tuner: Tuner, clock: Clock, config: Config) -> AsyncIterator[None]:
    """Run the web server while the context lasts."""
    token = secrets.token_urlsafe(24)
    pages = await asyncio.to_thread(load_static_files, token)
    server = Server(hub, console, tuner, clock, config, pages, token)
    async with serving(server, config.dashboard):
        yield


def subscribe(bus: Bus) -> list[tuple[keys.Topic[Any], Latest[Any]]]:
    """Subscribe to every JSON topic and health report, except the two topics that answer the operator."""
    answers = (keys.THRUST_APPLIED, keys.SHADOW)
    topics: list[keys.Topic[Any]] = [
        topic for topic in keys.topics_in(bus.graph) if topic.stance is not keys.Stance.PICTURE and topic not in answers
    ]
    topics += [keys.health(service) for service in keys.services_in(bus.graph)]
    return [(topic, bus.latest(topic)) for topic in topics]


async def forward(hub: Hub, topic: keys.Topic[Any], inbox: Latest[Any], clock: Clock, period_s: float) -> None:
    """Forward each new message at once, but at most one in `period_s`: the newest."""
    while True:
        value = await inbox.next()
        hub.put(topic.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_while_clients(
    hub: Hub, topic: keys.Topic[Any], inbox: Latest[Any], clock: Clock, period_s: float
) -> None:
    """As `forward`, but pull only while there are clients."""
    while True:
        await hub.has_clients.wait()
        value = await inbox.next()
        hub.put(topic.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_applied(hub: Hub, console: Console, inbox: Latest[m.ThrustApplied], clock: Clock) -> None:
    """Forward what the plant applies to the page, and to the STOP that waits for its confirmation."""
    while True:
        value = await inbox.next()
        console.confirm_stop(value)
        hub.put(keys.THRUST_APPLIED.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(0.5 / keys.THRUST_APPLIED.rate_hz)


async def forward_shadow(hub: Hub, tuner: Tuner, inbox: Latest[m.Shadow], clock: Clock) -> None:
    """Forward the report on tuning to the page, and to the request that waits for an answer."""
    while True:
        value = await inbox.next()
        if (event := tuner.update(value)) is not None:
            hub.publish_event(event)
        hub.put(keys.SHADOW.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(STATE_PERIOD_S)


async def publish_operator_state(hub: Hub, console: Console, clock: Clock) -> None:
    """Publish the operator's state to the pages, at once when it changes."""
    while True:
        now_us = clock.now_us()
        hub.put("dashboard/operator", page_operator(console.state), now_us, now_us)
        await console.wait_for_change(OPERATOR_PERIOD_S)


async def track_services(hub: Hub, bus: Bus, clock: Clock) -> None:
    """Publish which services are alive, and a line of the log when that changes."""
    liveness = ServiceLiveness()
    async for service, alive in bus.alive_events():
        now_us = clock.now_us()
        hub.put("dashboard/services", liveness.update(service, alive), now_us, now_us)
        if service != bus.user:
            level, text = ("info", "is ready") if alive else ("warn", "has stopped")
            hub.publish_event(Event(now_us, level, f"{service} {text}"))
