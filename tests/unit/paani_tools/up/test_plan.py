"""What one start runs, and the settings it hands over."""

from __future__ import annotations

import asyncio
import io
import socket
import sys
from importlib.metadata import entry_points
from pathlib import Path

import cv2
import numpy as np
import pytest

from paani import keys
from paani.config import Config, decode_config, encode_config, load_config
from paani.errors import UserError
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.route_file import load_route
from paani_sim.worlds import WORLDS, load_world
from paani_sim.worlds.load import load_scenario
from paani_tools.up.command import up_sets
from paani_tools.up.plan import make_plan
from paani_tools.up.terminal import Display
from tests.pictures import river

pytestmark = pytest.mark.slow
SIMULATED = [name for name in keys.services_in(keys.Graph.SIMULATION) if name not in keys.PORTS]


@pytest.mark.parametrize("name", sorted(WORLDS))
async def test_the_world_s_route_and_origin_are_handed_over(name: str, private_sets: tuple[str, ...]) -> None:
    plan = await make_plan(load_config(sets=(*private_sets, f"world.name={name}")))
    world = load_world(name)
    route = await asyncio.to_thread(load_route, Path(plan.config.navigator.route))
    assert plan.config.localization.origin_lat_lon_deg == (world.origin_lat_deg, world.origin_lon_deg)
    np.testing.assert_allclose([(p.x_m, p.y_m) for p in route.waypoints], world.route_m, atol=1e-4)
    assert plan.services == tuple(name for name in SIMULATED if name not in {"recorder", "bridge", "button"})
    assert decode_config(encode_config(plan.config)) == plan.config


async def test_a_scenario_s_open_route_and_fence_are_handed_over(private_sets: tuple[str, ...]) -> None:
    plan = await make_plan(load_config(sets=(*private_sets, "world.name=harbour_crossing")))
    scenario = await asyncio.to_thread(load_scenario, "harbour_crossing")
    route = await asyncio.to_thread(load_route, Path(plan.config.navigator.route))
    fence = await asyncio.to_thread(load_fence, Path(plan.config.navigator.fence), None)
    assert not route.repeat
    np.testing.assert_allclose([(p.x_m, p.y_m) for p in route.waypoints], scenario.world.route_m, atol=1e-4)
    assert fence == scenario.fence
    plain = await make_plan(load_config(sets=(*private_sets, "world.name=harbour")))
    assert not plain.config.navigator.fence


async def test_the_simulator_s_camera_is_calibrated_and_no_other(private_sets: tuple[str, ...], tmp_path: Path) -> None:
    """B16: a real camera's calibration is not established until somebody gives one."""
    plan = await make_plan(load_config(sets=(*private_sets, "eye.pitch_down_deg=9.0")))
    assert plan.config.calibration.valid
    assert plan.config.calibration.pitch_down_deg == 9.0
    own = ("calibration.hfov_deg=62", "calibration.height_m=0.8", "calibration.valid=true")
    assert (await make_plan(load_config(sets=(*private_sets, *own)))).config.calibration.hfov_deg == 62.0
    cv2.imwrite(str(tmp_path / "river.png"), river())
    real = await make_plan(load_config(sets=(*private_sets, f"camera.source={tmp_path}")))
    assert not real.config.calibration.valid


async def test_own_route_and_origin_are_kept(private_sets: tuple[str, ...], tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'name = "mine"\nwaypoints = [{ x_m = 0.0, y_m = 0.0 }, { x_m = 9.0, y_m = 0.0 }]\n', encoding="utf-8"
    )
    own = (f"navigator.route={mine}", "localization.origin_lat_lon_deg=[10.0, 20.0]")
    plan = await make_plan(load_config(sets=(*private_sets, *own)))
    assert plan.config.navigator.route == str(mine)
    assert plan.config.localization.origin_lat_lon_deg == (10.0, 20.0)


@pytest.mark.parametrize("profile", ["paani", "paper"])
async def test_p4_a_start_runs_no_survey_benchmark_or_recorder(profile: str, private_sets: tuple[str, ...]) -> None:
    """P4: they are commands, or run only when asked for."""
    commands = {point.name for point in entry_points(group="paani.commands")}
    plan = await make_plan(load_config(profile=profile, sets=private_sets))
    assert {"bench", "scenario", "logs"} <= commands
    assert not commands & set(plan.services)
    assert "recorder" not in plan.services


async def test_a_real_camera_needs_no_eye(private_sets: tuple[str, ...], tmp_path: Path) -> None:
    """The plant and everything else still run; the thrust adapter waits for no pulse of the eye."""
    cv2.imwrite(str(tmp_path / "river.png"), river())
    plan = await make_plan(load_config(sets=(*private_sets, f"camera.source={tmp_path}")))
    assert set(SIMULATED) - set(plan.services) == {"eye", "recorder", "bridge", "button"}
    assert set(keys.VITAL_SERVICES) - set(plan.config.plant.adapter.require_pulses) == {"eye"}
    with pytest.raises(UserError, match=r"camera\.source absent: no such file or folder"):
        await make_plan(load_config(sets=(*private_sets, "camera.source=absent")))


@pytest.mark.parametrize(
    ("field", "named"),
    [("navigator.mission", "legs"), ("navigator.fence", "areas"), ("navigator.route", "waypoints")],
)
async def test_a_file_that_no_boat_can_follow_is_refused_before_anything_starts(
    field: str, named: str, private_sets: tuple[str, ...], tmp_path: Path
) -> None:
    file = tmp_path / "file.toml"
    file.write_text(f"{named} = 3\n", encoding="utf-8")
    with pytest.raises(UserError, match=rf"{field} {file}: .*{named}"):
        await make_plan(load_config(sets=(*private_sets, f"{field}={file}")))


async def test_a_folder_without_pictures_is_refused_before_anything_starts(
    private_sets: tuple[str, ...], tmp_path: Path
) -> None:
    with pytest.raises(UserError, match=rf"camera\.source {tmp_path}: holds no pictures"):
        await make_plan(load_config(sets=(*private_sets, f"camera.source={tmp_path}")))


async def test_a_busy_page_port_is_no_mistake_without_the_page(config: Config, private_sets: tuple[str, ...]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", config.dashboard.port))
        taken.listen()
        with pytest.raises(UserError, match=r"dashboard\.port .* in use .*--set dashboard\.port="):
            await make_plan(config)
        await make_plan(load_config(sets=(*private_sets, "dashboard.serve=false")))


def test_options_stand_for_settings(private_sets: tuple[str, ...]) -> None:
    mission, fence = Path("/a/m.toml"), Path("/a/f.toml")
    sets = up_sets(world="lake", camera="/some where/x.mp4", headless=True, mission=mission, fence=fence)
    config = load_config(sets=(*sets, *private_sets))
    assert (config.world.name, config.camera.source) == ("lake", "/some where/x.mp4")
    assert (config.navigator.mission, config.navigator.fence) == ("/a/m.toml", "/a/f.toml")
    assert config.up.arm_at_start
    assert not config.dashboard.serve


def test_a_plain_stream_gets_a_line_only_when_something_changes() -> None:
    stream = io.StringIO()
    display = Display(stream)
    for elapsed_s in (0.0, 0.2, 0.4):
        display.waiting(1, 2, ["eye"], elapsed_s)
    display.print_line("all 2 processes alive after 0.6 s")
    assert stream.getvalue().splitlines() == [
        "starting  1/2   0.0 s  waiting for eye",
        "all 2 processes alive after 0.6 s",
    ]


def test_a_terminal_has_one_line_that_is_updated() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    display = Display(stream)
    display.waiting(0, 2, ["router", "eye"], 0.0)
    display.waiting(1, 2, ["eye"], 0.2)
    display.print_line("alive")
    assert stream.getvalue().count("\n") == 1
    assert stream.getvalue().endswith("\x1b[Kalive\n")


async def test_a_port_runs_where_it_is_asked_for(private_sets: tuple[str, ...]) -> None:
    plan = await make_plan(
        load_config(sets=(*private_sets, *up_sets(world=None, camera=None, headless=True, ports=("nmea",))))
    )
    assert set(plan.services) & {*keys.PORTS} == {"nmea"}
    with pytest.raises(UserError, match="ports"):
        load_config(sets=(*private_sets, 'up.ports=["telex"]'))


async def test_the_ros_port_is_ready_or_nothing_begins(
    private_sets: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        listen = f"ros2.listen=tcp/127.0.0.1:{busy.getsockname()[1]}"
        sets = (*private_sets, listen, *up_sets(world=None, camera=None, headless=True, ports=("ros2",)))
        with pytest.raises(UserError, match=r"ros2\.listen .* in use .*--set ros2\.listen="):
            await make_plan(load_config(sets=sets))
    assert "ros2" in (await make_plan(load_config(sets=sets))).services
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(UserError, match=r"pip install 'paani\[ros2\]'"):
        await make_plan(load_config(sets=sets))
