"""Boats that are routers and telemetry alone: what a shore hears of a boat, at the rates of the table of keys."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
from collections.abc import Callable, Sequence
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

from paani import keys
from paani import messages as m
from paani.authority import ensure_credentials
from paani.bus import Bus, Publisher
from paani.bus.routing import open_router
from paani.clock import Clock, WallClock
from paani.config import BusConfig
from paani.sides import ROUTER

EXPLANATION = (
    "The way ahead is blocked by one boat at the centre; the left is free and nearer to the route than the right."
)


def prepare_boats(folder: Path, ports: Sequence[int]) -> tuple[BusConfig, ...]:
    """The bus of each boat on this machine, with its credentials made below the folder. ports: two for each."""
    configs = []
    for number, (router, shore) in enumerate(zip(ports[::2], ports[1::2], strict=True), start=1):
        runtime = folder / f"boat_{number}"
        runtime.mkdir(mode=0o700)
        config = BusConfig(
            vessel=f"boat_{number}",
            router=f"tcp/127.0.0.1:{router}",
            shore=f"tcp/127.0.0.1:{shore}",
            runtime_dir=str(runtime),
        )
        ensure_credentials(config)
        configs.append(config)
    return tuple(configs)


def run_boats(configs: Sequence[BusConfig], ready: Event) -> None:
    """In a process of its own, until it is terminated. ready: set when all routers listen."""
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_sail_all(configs, ready))


async def _sail_all(configs: Sequence[BusConfig], ready: Event) -> None:
    clock = WallClock()
    buses = [(config, Bus(await open_router(config), config, ROUTER, clock)) for config in configs]
    ready.set()
    async with asyncio.TaskGroup() as tasks:
        for number, (config, bus) in enumerate(buses):
            tasks.create_task(_sail(config, bus, number, clock))


async def _sail(config: BusConfig, bus: Bus, number: int, clock: Clock) -> None:
    """The router, and what its boat would publish, put by the router itself: its rules of what goes out hold."""
    messages = _messages(clock, number, clock.now_us())
    async with asyncio.TaskGroup() as tasks:
        for row in keys.topics_ashore(config.graph):
            make = functools.partial(messages[row.type], row)
            tasks.create_task(_publish(bus.publisher(row), make, row.rate_hz))


async def _publish(publisher: Publisher[Any], make: Callable[[], m.Message], rate_hz: float) -> None:
    while True:
        publisher.put(make())
        await asyncio.sleep(1.0 / rate_hz)


def _messages(
    clock: Clock, number: int, begun_us: int
) -> dict[type[m.Message], Callable[[keys.Topic[Any]], m.Message]]:
    """A boat on a circle of 20 m, beside the others."""

    def phase_rad() -> float:
        return (clock.now_us() - begun_us) * 1e-6 * 0.03 + number

    return {
        m.Odometry: lambda _: m.Odometry(
            source_us=clock.now_us(), x_m=60.0 * number + 20.0 * math.cos(phase_rad()),
            y_m=20.0 * math.sin(phase_rad()), yaw_rad=math.remainder(phase_rad() + 0.5 * math.pi, math.tau),
            surge_mps=0.6, position_std_m=0.4, yaw_std_rad=0.02, healthy=True, latitude_deg=52.01, longitude_deg=4.35,
        ),
        m.Advisory: lambda _: m.Advisory(
            source_us=clock.now_us(), direction=m.Direction.LEFT, reason=next(iter(m.Reason)), explanation=EXPLANATION
        ),
        m.NavCommand: lambda _: m.NavCommand(
            source_us=clock.now_us(), enable=True, heading_rad=0.3, speed_mps=0.6, leg="to waypoint 3 of 8"
        ),
        m.OperatorState: lambda _: m.OperatorState(source_us=clock.now_us(), armed=True, stopped=False, by="dashboard"),
        m.ThrustApplied: lambda _: m.ThrustApplied(
            source_us=clock.now_us(), left=0.4, right=0.5, left_n=2.0, right_n=2.5, zero_cause=m.ZeroCause.NONE
        ),
        m.Health: lambda row: m.Health(
            source_us=clock.now_us(), service=row.producer, ready=True, uptime_s=1.0, cpu_cores=0.1, rss_mib=60.0,
            inputs=tuple(
                m.InputHealth(
                    topic=name, alive=True, fresh=True, rate_ok=True, rate_hz=10.0, age_s=0.05, received=1000,
                    superseded=3,
                )
                for name in (keys.ODOMETRY.name, keys.ADVISORY.name, keys.ARMING.name)
            ),
        ),
    }  # fmt: skip
