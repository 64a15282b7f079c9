"""Dashboard process: messages of the bus to the page, and what the page asks to the bus."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest
from paani.clock import Clock, patience_us
from paani.config import Config
from paani.mission_client import MissionClient
from paani.operator_client import OperatorClient
from paani_services.dashboard.gatekeeper import open_gate
from paani_services.dashboard.history import SAMPLE_KEY, History
from paani_services.dashboard.hub import FRAME_KEYS, Hub
from paani_services.dashboard.operator_events import describe_operator_change
from paani_services.dashboard.page_state import ServiceLiveness, page_settings
from paani_services.dashboard.pages import load_static_files
from paani_services.dashboard.process_lives import STATE_PERIOD_S, forward_health, track_services
from paani_services.dashboard.server import Server, serving
from paani_services.dashboard.time_series import SAMPLE_PERIOD_US
from paani_services.dashboard.tuning import Tuner

APPLIED_PERIOD_S = 0.5 / keys.THRUST_APPLIED.rate_hz  # every report: a zero is seen at once


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish tuning requests; serve the page unless `dashboard.serve` is false."""
    tuner = Tuner(bus.publisher(keys.TUNING), clock)
    page = serve_page(bus, tuner, clock, config) if config.dashboard.serve else contextlib.nullcontext()
    async with page:
        with bus.alive():
            await tuner.publish_forever()


@contextlib.asynccontextmanager
async def serve_page(bus: Bus, tuner: Tuner, clock: Clock, config: Config) -> AsyncIterator[None]:
    """Run the web server and the tasks that feed it while the context lasts."""
    hub, history = Hub(), History(config.services)
    hub.put("dashboard/settings", page_settings(config), clock.now_us(), clock.now_us())
    liveness = ServiceLiveness()
    operator = OperatorClient(bus, clock)
    missions = MissionClient(bus, clock)
    async with web_server(hub, history, operator, missions, tuner, clock, config), asyncio.TaskGroup() as tasks:
        picture_period_s = patience_us(config.dashboard.picture_rate_hz) * 1e-6
        feeds = [
            forward(hub, row, inbox, clock, picture_period_s if row.name in FRAME_KEYS else STATE_PERIOD_S)
            for row, inbox in subscribe(bus)
        ]
        feeds.append(forward(hub, keys.PICTURE, bus.latest_picture(keys.PICTURE), clock, picture_period_s))
        feeds.append(forward_masks(hub, bus.pull_picture(keys.MASK), clock, picture_period_s))
        feeds.append(forward(hub, keys.THRUST_APPLIED, bus.latest(keys.THRUST_APPLIED), clock, APPLIED_PERIOD_S))
        feeds.append(forward_operator(hub, operator.states, clock))
        feeds.append(forward_shadow(hub, tuner, bus.latest(keys.SHADOW), clock))
        feeds += [forward_health(hub, liveness, bus, service, clock) for service in keys.services_in(bus.graph)]
        feeds += [tuner.relay_forever(client, bus.queue(row)) for client, row in keys.TUNING_PROPOSALS.items()]
        feeds += [track_services(hub, liveness, bus, clock), keep_history(hub, history, clock)]
        running = [tasks.create_task(feed) for feed in feeds]
        try:
            yield
        finally:
            for task in running:
                task.cancel()


@contextlib.asynccontextmanager
async def web_server(
    hub: Hub,
    history: History,
    operator: OperatorClient,
    missions: MissionClient,
    tuner: Tuner,
    clock: Clock,
    config: Config,
) -> AsyncIterator[None]:
    """Run the web server while the context lasts."""
    pages = await asyncio.to_thread(load_static_files)
    gatekeeper, tls = await asyncio.to_thread(open_gate, config, clock)
    server = Server(hub, history, operator, missions, tuner, clock, config, pages, gatekeeper)
    async with serving(server, config.dashboard, tls):
        yield


def subscribe(bus: Bus) -> list[tuple[keys.Topic[Any], Latest[Any]]]:
    """Subscribe to every JSON topic, except those that answer the operator."""
    answers = (keys.THRUST_APPLIED, keys.OPERATOR_STATE, keys.SHADOW)
    return [
        (topic, bus.latest(topic))
        for topic in keys.topics_in(bus.graph)
        if topic.stance is not keys.Stance.PICTURE and topic not in answers
    ]


async def forward(hub: Hub, topic: keys.Topic[Any], inbox: Latest[Any], clock: Clock, period_s: float) -> None:
    """Forward each new message at once, but at most one in `period_s`: the newest."""
    while True:
        value = await inbox.next()
        hub.put(topic.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_masks(hub: Hub, inbox: Latest[Any], clock: Clock, period_s: float) -> None:
    """As `forward`, but pull only while there are clients."""
    while True:
        await hub.has_clients.wait()
        value = await inbox.next()
        hub.put(keys.MASK.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(period_s)


async def forward_operator(hub: Hub, inbox: Latest[m.OperatorState], clock: Clock) -> None:
    """Forward the operator's state, at once when it changes, and a line of the log for what the operator did."""
    before: m.OperatorState | None = None
    while True:
        value = await inbox.next()
        for event in describe_operator_change(before, value, clock.now_us()):
            hub.publish_event(event)
        before = value
        hub.put(keys.OPERATOR_STATE.name, value, inbox.received_us, clock.now_us())


async def forward_shadow(hub: Hub, tuner: Tuner, inbox: Latest[m.Shadow], clock: Clock) -> None:
    """Forward the report on tuning to the page, and to the request that waits for an answer."""
    while True:
        value = await inbox.next()
        if (event := tuner.update(value)) is not None:
            hub.publish_event(event)
        hub.put(keys.SHADOW.name, value, inbox.received_us, clock.now_us())
        await asyncio.sleep(STATE_PERIOD_S)


async def keep_history(hub: Hub, history: History, clock: Clock) -> None:
    """Keep what the hub holds once a second, and send the sample of it to the pages."""
    while True:
        await asyncio.sleep(SAMPLE_PERIOD_US * 1e-6)
        now_us = clock.now_us()
        hub.put(SAMPLE_KEY, history.take(hub, now_us), now_us, now_us)
