"""The lives of the processes as the page is told them: what each reports, its starts, and who comes and goes."""

from __future__ import annotations

import asyncio

from paani import keys
from paani.bus import Bus
from paani.clock import Clock
from paani_services.dashboard.hub import Event, Hub
from paani_services.dashboard.page_state import ServiceLiveness

STATE_PERIOD_S = 0.1  # people read numbers no faster


async def forward_health(hub: Hub, liveness: ServiceLiveness, bus: Bus, service: str, clock: Clock) -> None:
    """Forward what a service reports of itself, and count its starts."""
    topic = keys.health(service)
    inbox = bus.latest(topic)
    while True:
        value = await inbox.next()
        now_us = clock.now_us()
        hub.put(topic.name, value, inbox.received_us, now_us)
        if (services := liveness.report(service, value.epoch)) is not None:
            hub.put("dashboard/services", services, now_us, now_us)
        await asyncio.sleep(STATE_PERIOD_S)


async def track_services(hub: Hub, liveness: ServiceLiveness, bus: Bus, clock: Clock) -> None:
    """Publish which services are alive, and a line of the log when that changes."""
    async for service, alive in bus.alive_events():
        now_us = clock.now_us()
        hub.put("dashboard/services", liveness.update(service, alive), now_us, now_us)
        if service != bus.user:
            level, text = ("info", "is ready") if alive else ("warn", "is gone")
            hub.publish_event(Event(now_us, level, f"{service} {text}"))
