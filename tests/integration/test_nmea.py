"""The NMEA 0183 port as a process: plotters hear the estimate, and what they say changes nothing."""

from __future__ import annotations

import asyncio
import socket

import pytest
from pynmeagps import NMEAReader

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration
CLOCK = WallClock()


async def test_plotters_hear_where_the_boat_is(spawn: Spawn, open_as: OpenAs) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    estimate = (await open_as("localization")).publisher(keys.ODOMETRY)
    listen = f'nmea.listen="127.0.0.1:{port}"'

    async def publish() -> None:
        while True:
            estimate.put(
                m.Odometry(
                    source_us=CLOCK.now_us(), x_m=1.0, y_m=2.0, yaw_rad=0.0, surge_mps=0.5, healthy=True,
                    latitude_deg=50.1, longitude_deg=8.6,
                )
            )  # fmt: skip
            await asyncio.sleep(0.05)

    async with spawn("nmea", listen, "nmea.rate_hz=10", "nmea.max_clients=2"), asyncio.timeout(10.0):
        async with at_work(publish()):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            _, deaf = await asyncio.open_connection("127.0.0.1", port)
            for plotter in (writer, deaf):
                plotter.write(b"$GPRTE,1,1,c,go*00\r\n" * 2000)  # what a plotter says is nobody's command
            kinds = set[str]()
            while kinds != {"RMC", "GGA", "HDT"}:
                message = NMEAReader.parse(await reader.readline(), validate=1)
                if getattr(message, "status", "A") == "A" and getattr(message, "lat", 50.1) == 50.1:
                    kinds.add(message.msgID)
            third, third_writer = await asyncio.open_connection("127.0.0.1", port)
            assert await third.read() == b""  # one more than may connect
        while b"RMC,,V" not in await reader.readline():
            pass
        for end in (writer, deaf, third_writer):
            end.close()
