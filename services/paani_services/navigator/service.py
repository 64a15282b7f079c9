"""Navigator process: advisory, odometry, clock and arming in; one order out."""

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest
from paani.clock import Clock
from paani.config import Config
from paani_services.navigator.navigate import Heard, NavState, navigate
from paani_services.navigator.route import load_route

EARLY_US = 5_000  # a wake-up this much before the period is over is on time


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Order at `rate_hz`, and at once when the evidence, the advice or a gate changes."""
    file = config.navigator.route
    route = await asyncio.to_thread(load_route, Path(file)) if file else None
    advisory, odometry = bus.latest(keys.ADVISORY), bus.latest(keys.ODOMETRY)
    sim_time, arming = bus.latest(keys.SIM_TIME), bus.latest(keys.ARMING)
    command, route_out = bus.publisher(keys.COMMAND), bus.publisher(keys.ROUTE)
    period_s = 1.0 / config.navigator.rate_hz
    wake = asyncio.Event()
    state, sent, sent_us, route_us = NavState(), None, 0, 0
    with bus.alive():
        async with asyncio.TaskGroup() as group:
            for inbox in (advisory, odometry, arming):
                group.create_task(_wake_on(inbox, wake))
            while True:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(wake.wait(), period_s)
                wake.clear()
                heard = Heard(
                    advisory=advisory.value,
                    advisory_us=advisory.received_us,
                    odometry=odometry.value,
                    odometry_us=odometry.received_us,
                    clock=sim_time.value,
                    clock_us=sim_time.received_us,
                    arming=arming.value,
                    arming_us=arming.received_us,
                )
                now_us = clock.now_us()
                state, order = navigate(state, heard, route, now_us, config.bus.domain, config.navigator)
                if now_us - sent_us >= period_s * 1e6 - EARLY_US or _differs(order, sent):
                    sent, sent_us = command.put(order), now_us
                    bus.note(", ".join(order.inhibits))
                if route is not None and now_us - route_us >= 1e6 / keys.ROUTE.rate_hz:
                    route_out.put(msgspec.structs.replace(route, source_us=now_us))
                    route_us = now_us


async def _wake_on(inbox: Latest[Any], wake: asyncio.Event) -> None:
    while True:
        await inbox.next()
        wake.set()


def _differs(order: m.NavCommand, sent: m.NavCommand | None) -> bool:
    """New evidence, other advice or another gate goes out at once; the rest waits for the period."""
    if sent is None:
        return True
    return (order.source_us, order.direction, order.inhibits) != (sent.source_us, sent.direction, sent.inhibits)
