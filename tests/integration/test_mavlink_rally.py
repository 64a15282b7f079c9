"""Rally points of ground stations that others wrote, MAVSDK and MAVProxy: checked, read back, returned to, cleared.

The operator's process and the navigator are real; the boat lies still at the map's origin.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import os
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest
from paani.clock import WallClock
from paani.geometry import geodetic_from_enu
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.integration.mavlink_river import until
from tests.integration.test_mavproxy import LIMIT_S, Console
from tests.transcript import Transcript

pytest.importorskip("mavsdk", reason="needs mavsdk")
from mavsdk.plugins.mission_raw import MissionItem

from tests.integration.test_mavlink import ground_station

pytestmark = [pytest.mark.integration, pytest.mark.timeout(200)]
ORIGIN_DEG = (50.1072, 8.6928)
STILL = m.Odometry(
    source_us=0, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, position_std_m=0.4, healthy=True,
    latitude_deg=ORIGIN_DEG[0], longitude_deg=ORIGIN_DEG[1],
)  # fmt: skip
HOME, NEAR, FAR, ASHORE = (60.0, 0.0), (20.0, 5.0), (-30.0, 0.0), (200.0, 0.0)
BASIN = ((-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0))
WAYPOINT, HOMEWARD, CORNER, RALLY_POINT = 16, 20, 5001, 5100


class Mooring:
    """What is heard of the operator's process and of the navigator."""

    def __init__(self, observer: Bus, udp: int, tcp: int) -> None:
        self.orders: Latest[m.OperatorOrder] = observer.latest(keys.OPERATOR_ORDER)
        self.missions: Latest[m.Mission] = observer.latest(keys.MISSION)
        self.udp, self.tcp = udp, tcp

    async def until_rally(self, *places: tuple[float, float]) -> None:
        """Until these are the navigator's rally points."""
        await until(self.missions.next, lambda mission: is_at(mission.rally, *places), LIMIT_S)

    async def until_return(self, place: tuple[float, float]) -> None:
        """Until the boat is ordered to return to this place."""
        await until(
            self.orders.next, lambda order: order.mode is m.DriveMode.RETURN and is_at(order.target, place), LIMIT_S
        )


def is_at(points: tuple[m.Waypoint, ...], *places: tuple[float, float]) -> bool:
    """Whether these are the same, to what the protocol has digits for."""
    return len(points) == len(places) and all(
        (point.x_m, point.y_m) == pytest.approx(place, abs=0.05) for point, place in zip(points, places, strict=True)
    )


def item(seq: int, command: int, place: tuple[float, float], kind: int = 0) -> MissionItem:
    """An item of MAVSDK; corners say how many there are."""
    x, y = (round(degrees * 1e7) for degrees in geodetic_from_enu(*place, *ORIGIN_DEG))
    first = float(len(BASIN)) if command == CORNER else 0.0
    return MissionItem(seq, 3, command, int(seq == 0 and kind == 0), 1, first, 0.0, 0.0, 0.0, x, y, 0.0, kind)


@pytest.fixture
async def mooring(spawn: Spawn, open_as: OpenAs) -> AsyncIterator[Mooring]:
    udp, tcp = find_free_port(), find_free_port()
    poses = (await open_as("localization")).publisher(keys.ODOMETRY)

    async def publish_forever() -> None:
        while True:
            poses.put(replace(STILL, source_us=WallClock().now_us()))
            await asyncio.sleep(0.1)

    links = (f"mavlink.udp=127.0.0.1:{udp}", f"mavlink.tcp=127.0.0.1:{tcp}")
    async with at_work(publish_forever()), contextlib.AsyncExitStack() as stack:
        services = (spawn("operator"), spawn("navigator"), spawn("mavlink", *links))
        await asyncio.gather(*(stack.enter_async_context(service) for service in services))
        yield Mooring(await open_as("observer"), udp, tcp)


async def test_mavsdk_gives_places_to_return_to(mooring: Mooring, transcript: Transcript) -> None:
    async with ground_station(f"udpin://127.0.0.1:{mooring.udp}", transcript) as station:
        route = [item(0, WAYPOINT, (5.0, 0.0)), item(1, WAYPOINT, (15.0, 0.0)), item(2, HOMEWARD, HOME)]
        await station.ask_until_taken(
            "upload a mission that ends at home", lambda: station.mission.upload_mission(route)
        )
        fence = [item(seq, CORNER, place, 1) for seq, place in enumerate(BASIN)]
        await station.ask_until_taken("upload a fence", lambda: station.mission.upload_geofence(fence))
        rally = [item(seq, RALLY_POINT, place, 2) for seq, place in enumerate((FAR, NEAR))]
        await station.ask_until_taken("upload 2 rally points", lambda: station.mission.upload_rally_points(rally))
        await mooring.until_rally(FAR, NEAR)
        for places in ((NEAR,), (FAR, NEAR), (FAR,), (NEAR, FAR), (FAR, NEAR)):  # what was taken is downloaded at once
            rally = [item(seq, RALLY_POINT, place, 2) for seq, place in enumerate(places)]
            await station.ask_until_taken("upload others", lambda: station.mission.upload_rally_points(rally))  # noqa: B023
            found = await station.mission.download_rallypoints()
            assert [(each.command, each.x, each.y) for each in found] == [
                (RALLY_POINT, each.x, each.y) for each in rally
            ]
        ashore = [rally[0], item(1, RALLY_POINT, ASHORE, 2)]
        assert "INVALID_ARGUMENT" in await station.ask(
            "upload a rally point outside the fence", station.mission.upload_rally_points(ashore)
        )
        await station.until_heard("rally[1]: is outside the fence")
        await station.ask_until_taken("return", station.action.return_to_launch)
        await mooring.until_return(NEAR)
        transcript.note("boat", "is to return to the nearer rally point, and the refused ones have changed nothing")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("MAVProxy") is None, reason="MAVProxy is not installed")
async def test_mavproxy_loads_lists_and_clears_rally_points(
    mooring: Mooring, tmp_path: Path, transcript: Transcript
) -> None:
    def save(name: str, command: int, *places: tuple[float, float], first: int = 0) -> None:
        rows = (
            f"{seq}\t0\t3\t{command}\t{first}\t0\t0\t0\t{latitude:.7f}\t{longitude:.7f}\t0\t1"
            for seq, (latitude, longitude) in enumerate(geodetic_from_enu(*place, *ORIGIN_DEG) for place in places)
        )
        (tmp_path / name).write_text("\n".join(("QGC WPL 110", *rows, "")))

    save("fence.txt", CORNER, *BASIN, first=len(BASIN))
    save("rally.txt", RALLY_POINT, FAR, NEAR)
    save("ashore.txt", RALLY_POINT, NEAR, ASHORE)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-W", "ignore", "-m", "MAVProxy.mavproxy", "--master", f"tcp:127.0.0.1:{mooring.tcp}",
        "--nowait", f"--state-basedir={tmp_path}", "--default-modules=param,wp,fence,rally,mode", cwd=tmp_path,
        env={**os.environ, "HOME": str(tmp_path)}, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    console = Console(process, transcript)
    try:
        await console.expect("Received")
        await console.expect("TYPE_FENCE: ACCEPTED", "fence load fence.txt", "TYPE_FENCE: DENIED")
        await console.expect("TYPE_RALLY: ACCEPTED", "rally load rally.txt", "TYPE_RALLY: DENIED")
        await mooring.until_rally(FAR, NEAR)
        await console.expect("TYPE_RALLY: INVALID", "rally load ashore.txt", "TYPE_RALLY: DENIED")
        assert "rally[1]: is outside the fence" in console.printed
        await console.expect("Saved 2 rally items", "rally list")
        await console.expect("TYPE_RALLY: ACCEPTED", "rally clear", "TYPE_RALLY: DENIED")
        await mooring.until_rally()
    finally:
        process.kill()
        await process.wait()
