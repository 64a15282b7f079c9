"""A shore and its vessels, each with a router of its own: what it hears, what it may ask, and what it is kept from."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.authority import ensure_credentials
from paani.bus import Bus
from paani.clock import WallClock
from paani.config import Config, load_config
from paani_services.operator import service as operator
from paani_tools.fleet.fleet_file import read_fleet
from paani_tools.fleet.page import serve_page
from paani_tools.fleet.shore import Vessel, stop_vessels, watch_fleet
from paani_tools.fleet.vessel_state import Contact
from tests.at_work import at_work
from tests.bus_peers import joined, routing, until
from tests.conftest import find_free_port, put_raw

pytestmark = [pytest.mark.integration, pytest.mark.timeout(90)]
CLOCK = WallClock()


def vessel_config(folder: Path, name: str) -> Config:
    """A vessel's own settings, with its credentials made."""
    (folder / name).mkdir(mode=0o700)
    config = load_config(
        sets=(
            f"bus.vessel={name}",
            f"bus.router=tcp/127.0.0.1:{find_free_port()}",
            f"bus.shore=tcp/127.0.0.1:{find_free_port()}",
            f"bus.runtime_dir={folder / name}",
        )
    )
    ensure_credentials(config.bus)
    return config


def make_vessels(folder: Path, *names: str) -> list[Config]:
    return [vessel_config(folder, name) for name in names]


def fleet_file(folder: Path, *vessels: Config) -> Path:
    """The shore's file; of each vessel's credentials it has the shore's alone."""
    text = ""
    for config in vessels:
        name = config.bus.vessel
        kept = folder / "ashore" / name / "credentials"
        kept.mkdir(parents=True, mode=0o700)
        (kept / "shore").write_bytes((folder / name / "credentials" / "shore").read_bytes())
        text += f'[[vessels]]\nname = "{name}"\nrouter = "{config.bus.shore}"\ncredentials = "{name}"\n'
    (folder / "ashore" / "fleet.toml").write_text(text)
    return folder / "ashore" / "fleet.toml"


@contextlib.asynccontextmanager
async def afloat(config: Config, latitude_deg: float = 50.1) -> AsyncIterator[None]:
    """A router, the operator's process, and somebody who knows where the vessel is."""
    async with (
        routing(config.bus),
        joined(config.bus, "operator") as desk,
        joined(config.bus, "localization") as estimator,
        at_work(operator.run(desk, CLOCK, config), tell_position(estimator, latitude_deg)),
    ):
        yield


async def tell_position(bus: Bus, latitude_deg: float) -> None:
    poses = bus.publisher(keys.ODOMETRY)
    with bus.alive():
        while True:
            poses.put(
                m.Odometry(
                    source_us=CLOCK.now_us(), x_m=1.0, y_m=2.0, yaw_rad=0.0, surge_mps=0.5, healthy=True,
                    latitude_deg=latitude_deg, longitude_deg=8.6,
                )
            )  # fmt: skip
            await asyncio.sleep(0.05)


def is_known(vessel: Vessel) -> bool:
    state = vessel.state
    return state.contact is Contact.LIVE and state.x_m is not None and state.stopped is not None


class AheadClock:
    """An hour ahead of the vessels' clock, or behind."""

    def __init__(self, ahead_s: float) -> None:
        self._ahead_us = round(ahead_s * 1e6)

    def now_us(self) -> int:
        return CLOCK.now_us() + self._ahead_us


@pytest.mark.parametrize("ahead_s", [-3600.0, 3600.0])
async def test_shore_and_vessel_need_no_common_time(tmp_path: Path, ahead_s: float) -> None:
    """News is as old as its arrival, and a STOP is one whatever the time is ashore."""
    (otter,) = await asyncio.to_thread(make_vessels, tmp_path, "otter")
    file = await asyncio.to_thread(fleet_file, tmp_path, otter)
    fleet = await asyncio.to_thread(read_fleet, file)
    async with afloat(otter), watch_fleet(fleet, AheadClock(ahead_s)) as (vessel,):
        await until(lambda: is_known(vessel))
        state = await vessel.stop()
        assert state is not None
        assert (state.stopped, state.by) == (True, "shore")


async def test_one_vessel_that_is_away_delays_neither_news_nor_stop_of_the_others(tmp_path: Path) -> None:
    """Two vessels under way, one that never came, one that goes: each has a row and a STOP of its own."""
    otter, beaver, swan = await asyncio.to_thread(make_vessels, tmp_path, "otter", "beaver", "swan")
    file = await asyncio.to_thread(fleet_file, tmp_path, swan, otter, beaver)
    fleet = await asyncio.to_thread(read_fleet, file)
    async with afloat(otter), contextlib.AsyncExitStack() as second, watch_fleet(fleet, CLOCK) as vessels:
        await second.enter_async_context(afloat(beaver))
        by_name = {vessel.name: vessel for vessel in vessels}
        await until(lambda: is_known(by_name["otter"]) and is_known(by_name["beaver"]))
        assert by_name["swan"].state.contact is Contact.AWAY
        state = by_name["otter"].state
        assert (state.x_m, state.y_m, state.speed_mps, state.pose_healthy) == (1.0, 2.0, 0.5, True)
        answers = await stop_vessels((by_name["otter"], by_name["swan"]))
        assert answers["swan"] is None
        assert answers["otter"] is not None
        assert (answers["otter"].stopped, answers["otter"].by, answers["otter"].latch_kept) == (True, "shore", True)
        assert by_name["beaver"].state.changed_by == ""
        await second.aclose()
        await until(lambda: by_name["beaver"].state.contact is Contact.STALE)
        assert by_name["beaver"].state.x_m == 1.0
        assert by_name["otter"].state.contact is Contact.LIVE
        async with afloat(beaver):
            await until(lambda: by_name["beaver"].state.contact is Contact.LIVE)


async def test_the_shore_hears_what_it_may_and_can_do_nothing_but_stop(tmp_path: Path) -> None:
    """No pictures, no instruments; no thrust, no arming, nobody else's request, and nothing by wildcards."""
    (config,) = await asyncio.to_thread(make_vessels, tmp_path, "otter")
    bus = replace(config.bus, router=config.bus.shore)
    async with (
        routing(config.bus),
        joined(bus, keys.SHORE) as shore,
        joined(config.bus, "observer") as on_board,
        contextlib.AsyncExitStack() as stack,
    ):
        ashore = {row.name for row in keys.topics_ashore(bus.graph)}
        written = [row for row in keys.topics_in(bus.graph) if row.stance is not keys.Stance.PICTURE]
        seen = {row.name: on_board.latest(row) for row in written}
        heard = {row.name: shore.latest(row) for row in written}
        wide: list[str] = []
        shore._session.declare_subscriber("paani/**", lambda sample: wide.append(str(sample.key_expr)))
        writers = {row.producer: await stack.enter_async_context(joined(config.bus, row.producer)) for row in written}
        own = writers["controller"].publisher(keys.THRUST)
        await until(
            lambda: seen[keys.THRUST.name].received > 0,
            lambda: own.put(m.Thrust(source_us=CLOCK.now_us(), left=0.1, right=0.1, enabled=True)),
        )
        poses = writers["localization"].publisher(keys.ODOMETRY)
        pose = m.Odometry(source_us=CLOCK.now_us(), x_m=1.0, y_m=2.0, yaw_rad=0.0, surge_mps=0.5)
        await until(lambda: heard[keys.ODOMETRY.name].received > 0, lambda: poses.put(pose))
        assert keys.THRUST.name not in ashore
        assert heard[keys.THRUST.name].received == 0
        assert set(wide) <= {f"{shore.prefix}/{name}" for name in ashore}
        before = {name: inbox.received for name, inbox in seen.items()}
        drops = sum(on_board.drops.values())
        for name in (
            *(row.name for row in written if row.producer != keys.SHORE),
            "**",
            "operator/*",
            "operator/request/*",
        ):
            put_raw(shore, name, b"{}")
        asked = shore.publisher(keys.REQUESTS[keys.SHORE])
        request = m.OperatorRequest(source_us=CLOCK.now_us(), act=m.RequestAct.STOP)
        mine = keys.REQUESTS[keys.SHORE].name
        await until(lambda: seen[mine].received > 0, lambda: asked.put(request))
        assert {name: inbox.received for name, inbox in seen.items() if name != mine} == {
            name: count for name, count in before.items() if name != mine
        }
        assert sum(on_board.drops.values()) == drops


async def test_the_page_shows_the_vessels_and_stops_them(tmp_path: Path) -> None:
    """Only to whom it belongs, with a policy that lets nothing else in; a STOP that is not latched is an error."""
    otter, swan = await asyncio.to_thread(make_vessels, tmp_path, "otter", "swan")
    file = await asyncio.to_thread(fleet_file, tmp_path, otter, swan)
    fleet = await asyncio.to_thread(read_fleet, file)
    port = asyncio.get_running_loop().create_future()
    async with (
        afloat(otter),
        watch_fleet(fleet, CLOCK) as vessels,
        at_work(serve_page(vessels, 0, port.set_result)),
    ):
        await until(lambda: is_known(vessels[0]))
        async with aiohttp.ClientSession(f"http://127.0.0.1:{await port}") as client:
            for path in ("/", "/static/fleet.js", "/static/fleet.css", "/api/fleet"):
                async with client.get(path) as response:
                    assert response.status == 200
                    assert "default-src 'self'" in response.headers["Content-Security-Policy"]
            async with client.get("/api/fleet") as response:
                rows = await response.json()
            assert [(row["name"], row["contact"], row["x_m"]) for row in rows] == [
                ("otter", "live", 1.0),
                ("swan", "away", None),
            ]
            async with client.get("/api/fleet", headers={"Host": "evil.example"}) as response:
                assert response.status == 403
            for path, status, latched in (
                ("/api/stop/beaver", 404, None),
                ("/api/stop/otter", 200, {"otter": True}),
                ("/api/stop", 503, {"otter": True, "swan": False}),
            ):
                async with client.post(path) as response:
                    assert (response.status, (await response.json()).get("latched")) == (status, latched)
            assert vessels[0].state.mode == "STOPPED"
            assert vessels[0].state.changed_by == "shore"


async def test_the_command_lists_and_stops(tmp_path: Path) -> None:
    """`paani fleet`: a line for each vessel, and an exit code that says whether all is as asked."""
    otter, swan = await asyncio.to_thread(make_vessels, tmp_path, "otter", "swan")
    file = await asyncio.to_thread(fleet_file, tmp_path, otter, swan)

    async def fleet(*words: str) -> tuple[int | None, list[str]]:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "paani", "fleet", str(file), *words), stdout=asyncio.subprocess.PIPE
        )
        output, _ = await process.communicate()
        return process.returncode, output.decode().splitlines()

    async with afloat(otter):
        (code, lines), (stop_code, stopped) = await asyncio.gather(fleet("--list"), fleet("--stop-all"))
    assert (code, [line.split()[:2] for line in lines[1:]]) == (1, [["otter", "live"], ["swan", "away"]])
    assert (stop_code, stopped) == (
        1,
        ["otter: stopped, by shore", "swan: NOT LATCHED (away): nobody there answers"],
    )
