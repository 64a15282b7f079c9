"""Publishes what guides the boat beside the frames of `Boat`: position, order, thrust, route."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.bus.publish import Publisher
from paani.clock import WallClock
from tests.at_work import at_work

PERIOD_S = 0.1
ROUTE = m.Route(
    source_us=0,
    name="survey",
    waypoints=tuple(m.Waypoint(x_m=x, y_m=y) for x, y in ((0.0, 0.0), (12.0, 2.0), (16.0, 10.0), (4.0, 14.0))),
)
ORDER = m.NavCommand(
    source_us=0, enable=True, heading_rad=0.3, speed_mps=0.5, direction=m.Direction.STRAIGHT, waypoint_index=1,
    leg="follow route, lap 2",
)  # fmt: skip


class Guidance:
    """`order`, `odometry` and `route` are published until they are changed; None: nothing is said."""

    def __init__(self, navigator: Bus, localization: Bus, controller: Bus) -> None:
        self.navigator, self._clock = navigator, WallClock()
        self._orders, self._routes = navigator.publisher(keys.COMMAND), navigator.publisher(keys.ROUTE)
        self._odometry, self._thrust = localization.publisher(keys.ODOMETRY), controller.publisher(keys.THRUST)
        self.order: m.NavCommand | None = ORDER
        self.route: m.Route | None = ROUTE
        self.odometry: m.Odometry | None = m.Odometry(
            source_us=0, x_m=5.0, y_m=1.0, yaw_rad=0.3, surge_mps=0.5, position_std_m=0.4, healthy=True
        )

    def publish(self) -> None:
        now_us = self._clock.now_us()
        if self.odometry is not None:
            self._odometry.put(replace(self.odometry, source_us=now_us))
        if self.route is not None:
            self._routes.put(replace(self.route, source_us=now_us))
        if self.order is not None:
            self._orders.put(replace(self.order, source_us=now_us))
            thrust = 0.2 if self.order.enable else 0.0
            self._thrust.put(
                m.Thrust(
                    source_us=now_us, left=thrust, right=thrust, enabled=self.order.enable, inhibits=self.order.inhibits
                )
            )


async def repeat(publisher: Publisher[Any], message: m.Message, period_s: float) -> None:
    """Say the message again and again, each time as of now."""
    while True:
        publisher.put(replace(message, source_us=WallClock().now_us()))
        await asyncio.sleep(period_s)


@contextlib.asynccontextmanager
async def guiding(open_as: Callable[[str], Awaitable[Bus]]) -> AsyncIterator[Guidance]:
    """Publish while the context lasts."""
    guidance = Guidance(await open_as("navigator"), await open_as("localization"), await open_as("controller"))

    async def publish_forever() -> None:
        while True:
            guidance.publish()
            await asyncio.sleep(PERIOD_S)

    async with at_work(publish_forever()):
        yield guidance
