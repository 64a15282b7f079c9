"""Operator process: requests of its clients in; arming, the mode in force and its state out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, Queue
from paani.clock import Clock
from paani.config import Config
from paani.runtime import runtime_dir
from paani_services.operator.console import Console
from paani_services.operator.wheel import Facts

STATION_PERIOD_S = 0.2


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish the operator's state and answer each client, until told to stop; at the end nobody arms."""
    folder = await asyncio.to_thread(runtime_dir, config.bus)
    console = Console(
        bus.publisher(keys.ARMING),
        bus.publisher(keys.OPERATOR_STATE),
        bus.publisher(keys.OPERATOR_ORDER),
        folder,
        clock,
        facts_reader(bus),
    )
    await console.restore()
    station = bus.latest(keys.pulse(keys.STATION))
    applied = bus.latest(keys.THRUST_APPLIED)
    clients = (keys.STATION, *keys.ASKING_PORTS, *keys.command_line_clients_in(bus.graph))
    requests = {client: bus.queue(keys.REQUESTS[client]) for client in clients}
    try:
        with bus.alive():
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(console.publish_forever())
                tasks.create_task(console.watch_wheel())
                for client, inbox in requests.items():
                    tasks.create_task(answer_forever(console, client, inbox, station))
                tasks.create_task(follow_station(console, station))
                tasks.create_task(confirm_stops(console, applied))
    finally:
        await console.end()


def facts_reader(bus: Bus) -> Callable[[], Facts]:
    """Reads what the modes need from the newest messages of localization and navigator; what is stale is unknown."""
    odometry, prediction = bus.latest(keys.ODOMETRY), bus.latest(keys.PREDICTION)
    missions = {topic: bus.latest(topic) for topic in (keys.MISSION, keys.ROUTE)}

    def read() -> Facts:
        pose = odometry.fresh(keys.ODOMETRY.fresh_s)
        ahead = prediction.fresh(keys.PREDICTION.fresh_s)
        return Facts(
            position=m.Waypoint(x_m=pose.x_m, y_m=pose.y_m) if pose is not None and pose.healthy else None,
            home=ahead.home[0] if ahead is not None and ahead.home else None,
            has_mission=any(inbox.receipt_age_s() <= topic.fresh_s for topic, inbox in missions.items()),
        )

    return read


async def answer_forever(
    console: Console, client: str, inbox: Queue[m.OperatorRequest], station: Latest[m.Pulse]
) -> None:
    """Answer one client, in the order it asks. No client waits for another."""
    while True:
        request = await inbox.get()
        await console.answer(client, request, living_epoch(station))


async def follow_station(console: Console, station: Latest[m.Pulse]) -> None:
    """Whoever armed at the page has armed for as long as that process lives."""
    while True:
        await asyncio.sleep(STATION_PERIOD_S)
        if station.value is not None:
            await console.follow_station(station.value.epoch, station.receipt_age_s())


async def confirm_stops(console: Console, applied: Latest[m.ThrustApplied]) -> None:
    """Confirm each STOP by what the thrust adapter says."""
    while True:
        console.confirm_stop(await applied.next())


def living_epoch(station: Latest[m.Pulse]) -> int | None:
    """The epoch of the page's process, None where its pulse is not fresh."""
    is_alive = station.receipt_age_s() <= keys.pulse(keys.STATION).fresh_s
    return station.value.epoch if station.value is not None and is_alive else None
