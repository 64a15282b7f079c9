"""Operator process: requests of its clients in; arming, the mode and the mission in force, and its state out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, Queue
from paani.clock import Clock
from paani.config import Config
from paani.map_origin import map_place_of
from paani.missions import mission_of_route
from paani.runtime import own_runtime_dir
from paani_services.operator.console import Console
from paani_services.operator.missions import NO_MISSION
from paani_services.operator.wheel import Facts

STATION_PERIOD_S = 0.2
MISSIONS_WAITING = 2  # of one client; each may be half a megabyte
LISTENS_S = 5.0  # after which a navigator that publishes no mission has none: it says one twice in this time


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish the operator's state and answer each client, until told to stop; at the end nobody arms.

    Raises UserError where another boat's operator has the runtime folder.
    """
    with ExitStack() as owned:
        folder = await asyncio.to_thread(owned.enter_context, own_runtime_dir(config.bus))
        await _serve(bus, clock, config, folder)


async def _serve(bus: Bus, clock: Clock, config: Config, folder: Path) -> None:
    console = Console(
        bus.publisher(keys.ARMING),
        bus.publisher(keys.OPERATOR_STATE),
        bus.publisher(keys.OPERATOR_ORDER),
        bus.publisher(keys.ORDERED_MISSION),
        folder,
        clock,
        facts_reader(bus, clock),
        config.navigator.fence_margin_m,
    )
    await console.restore()
    station = bus.latest(keys.pulse(keys.STATION))
    applied = bus.latest(keys.THRUST_APPLIED)
    clients = (keys.STATION, keys.BUTTON, *keys.ASKING_PORTS, *keys.command_line_clients_in(bus.graph))
    requests = {client: bus.queue(keys.REQUESTS[client]) for client in clients if client in keys.REQUESTS}
    sent = {client: bus.queue(topic, MISSIONS_WAITING) for client, topic in keys.MISSION_REQUESTS.items()}
    try:
        with bus.alive():
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(console.publish_forever())
                tasks.create_task(console.publish_mission_forever())
                tasks.create_task(console.watch_wheel())
                for client, inbox in requests.items():
                    tasks.create_task(answer_forever(console, client, inbox, station))
                for client, missions in sent.items():
                    tasks.create_task(answer_missions_forever(console, client, missions))
                tasks.create_task(follow_station(console, station))
                tasks.create_task(confirm_stops(console, applied))
    finally:
        await console.end()


def facts_reader(bus: Bus, clock: Clock) -> Callable[[], Facts]:
    """Reads what the modes need from the newest messages of localization and navigator; what is stale is unknown."""
    begun_us = clock.now_us()
    odometry, prediction = bus.latest(keys.ODOMETRY), bus.latest(keys.PREDICTION)
    missions, routes = bus.latest(keys.MISSION), bus.latest(keys.ROUTE)
    grids = bus.latest(keys.OCCUPANCY)

    def read() -> Facts:
        pose = odometry.fresh(keys.ODOMETRY.fresh_s)
        ahead = prediction.fresh(keys.PREDICTION.fresh_s)
        mission, route = missions.fresh(keys.MISSION.fresh_s), routes.fresh(keys.ROUTE.fresh_s)
        if mission is None and route is not None:
            mission = mission_of_route(route)
        has_listened = clock.now_us() - begun_us >= LISTENS_S * 1e6
        if mission is None and ahead is not None and has_listened:
            mission = NO_MISSION
        return Facts(
            position=m.Waypoint(x_m=pose.x_m, y_m=pose.y_m) if pose is not None and pose.healthy else None,
            home=ahead.home[0] if ahead is not None and ahead.home else None,
            has_mission=mission is not None and bool(mission.legs),
            mission=mission,
            occupancy=grids.fresh(keys.OCCUPANCY.fresh_s),
            map_place=map_place_of(pose),
        )

    return read


async def answer_forever(
    console: Console, client: str, inbox: Queue[m.OperatorRequest], station: Latest[m.Pulse]
) -> None:
    """Answer one client, in the order it asks. No client waits for another, and no STOP for a disk that is to arm."""
    arming: asyncio.Task[None] | None = None
    async with asyncio.TaskGroup() as tasks:
        while True:
            request = await inbox.get()
            if request.act is not m.RequestAct.RELEASE:
                await console.answer(client, request, living_epoch(station))
            elif arming is None or arming.done():  # else it is said again
                arming = tasks.create_task(console.answer(client, request, living_epoch(station)))


async def answer_missions_forever(console: Console, client: str, inbox: Queue[m.MissionRequest]) -> None:
    """Answer the missions of one client, in the order it sends them."""
    while True:
        await console.answer_mission(client, await inbox.get())


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
