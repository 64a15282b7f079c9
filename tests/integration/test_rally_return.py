"""RTL on the simulated river, by MAVSDK: the boat sails to a rally point that is nearer than home, and stays there.

The recording of it is decided again to the byte. The water is said to be clear, as there are no pictures; the plant,
localization and all that decides are real.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.geometry import geodetic_from_enu
from paani_services.operator.latch import LATCH_FILE
from paani_services.operator.state import CLEAR
from paani_sim.worlds.river import build_river
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.integration.mavlink_river import until
from tests.integration.test_modes import SERVICES, SETS, Lookout
from tests.paani_command import paani
from tests.transcript import Transcript

pytest.importorskip("mavsdk", reason="needs mavsdk")
from mavsdk.plugins.mission_raw import MissionItem

from tests.integration.test_mavlink import ground_station

pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]
RIVER = build_river()
ORIGIN_DEG = (RIVER.origin_lat_deg, RIVER.origin_lon_deg)
PROCESSES = (*SERVICES, "mavlink", "recorder")
HOME, RALLY = (2.0, 16.0), (24.9, 8.1)  # 19 m off the port quarter of where the boat begins, and 10 m ahead of it
REACHED_M = 4.0  # 1.5 m (`navigator.acceptance_m`), the receiver's error, and the way to stop
HELD_M, HELD_US = 5.5, 5_000_000  # the station's radius is 4 m (`navigator.hold_radius_m`), by the same receiver
LIMIT_S = 90.0  # for 10 m at 0.6 m/s, on a machine that does other things too


@pytest.mark.rotating(cpu_s=20)
async def test_rtl_leads_to_the_rally_point_that_is_nearer_than_home(
    spawn: Spawn, open_as: OpenAs, config: Config, tmp_path: Path, transcript: Transcript
) -> None:
    mission, drive, udp = tmp_path / "mission.toml", tmp_path / "drive", find_free_port()
    mission.write_text(f'name = "rest"\n[home]\nx_m = {HOME[0]}\ny_m = {HOME[1]}\n[[legs]]\ndo = "stop"\n')
    sets = (
        *SETS, f"navigator.mission={mission}", f"localization.origin_lat_lon_deg={list(ORIGIN_DEG)}",
        f"mavlink.udp=127.0.0.1:{udp}", f"recorder.folder={drive}",
    )  # fmt: skip
    page = await open_as(keys.STATION)
    (Path(config.bus.runtime_dir) / LATCH_FILE).write_text(CLEAR)
    lookout = Lookout(await open_as("advisor"), await open_as("observer"))
    async with at_work(lookout.advise_forever()), contextlib.AsyncExitStack() as stack:
        stack.enter_context(page.alive())
        await asyncio.gather(*(stack.enter_async_context(spawn(name, *sets)) for name in PROCESSES))
        station = await stack.enter_async_context(ground_station(f"udpin://127.0.0.1:{udp}", transcript))
        x, y = (round(degrees * 1e7) for degrees in geodetic_from_enu(*RALLY, *ORIGIN_DEG))
        rally = [MissionItem(0, 3, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, x, y, 0.0, 2)]
        for words, attempt in (
            ("upload a rally point", lambda: station.mission.upload_rally_points(rally)),
            ("hold, by which the wheel is its own", station.action.hold),
            ("arm", station.action.arm),
            ("return", station.action.return_to_launch),
        ):
            await station.ask_until_taken(words, attempt, LIMIT_S)
        transcript.note("boat", f"is {away_m(await lookout.pose.next(), RALLY):.1f} m from the rally point")
        await until(lookout.pose.next, lambda pose: away_m(pose, RALLY) < REACHED_M, LIMIT_S)
        await until(lookout.command.next, lambda command: command.inhibits == (m.Inhibit.HOLDING,), LIMIT_S)
        pose = await lookout.pose.next()
        transcript.note("boat", f"keeps its station, {away_m(pose, RALLY):.1f} m from the rally point")
        end_us = pose.sim_us + HELD_US
        while pose.sim_us < end_us:
            assert away_m(pose, RALLY) < HELD_M < away_m(pose, HOME)
            pose = await lookout.pose.next()
    code, text, _ = await paani((), "replay", str(drive), "--check")
    assert (code, text.splitlines()[-1].partition(", ")[2]) == (0, "0 differ"), text


def away_m(pose: m.TruePose, place: tuple[float, float]) -> float:
    """How far the boat truly is from a place."""
    return math.dist((pose.x_m, pose.y_m), place)
