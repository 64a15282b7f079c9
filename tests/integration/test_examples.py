"""Every command of the README's table runs as it is written, and every one in the manual has its arguments right."""

from __future__ import annotations

import argparse
import asyncio
import re
import shlex
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from typing import NoReturn
from unittest import mock

import cv2
import numpy as np
import pytest

from examples.draw_pictures import VIEWS, draw
from paani import cli
from paani.config import Config, load_config
from paani.keys import Graph
from paani_services.navigator.files.mission_file import load_route_and_mission
from paani_sim.worlds.load import load_scenario
from paani_tools.up.command import up_sets
from tests.conftest import Spawn
from tests.places import ROOT
from tests.unit.paani_tools.replay.recorded_drive import drive, write_log

FINISHES = (
    "paper-report",
    "look",
    "scenario",
    "route",
    "world",
    "logs",
    "explain",
    "faults",
    "topics",
    "models check",
    "claims",
)
NEEDS_A_BOAT = ("echo", "hz", "tune", "mission", "replay runs/drive --dashboard")
TELLS_OF_THE_MACHINE = ("doctor",)
TAKES_MINUTES = ("trial", "bench")
README = (ROOT / "README.md").read_text(encoding="utf-8").partition("## What people do next")[2].partition("\n## ")[0]
EXAMPLES = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
ROWS = re.findall(r"`paani ([^`]+)`", README + EXAMPLES)
MANUAL = [
    line.partition("#")[0].strip(" &").removeprefix("paani ")
    for page in sorted((ROOT / "docs").rglob("*.md"))
    for block in re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    for line in block.replace("\\\n", " ").splitlines()
    if line.startswith("paani ")
]
OF_ANOTHER_PACKAGE = ("lookout",)
FIRST_TRIP = (ROOT / "docs" / "how-to" / "first-trip.md").read_text(encoding="utf-8")
BOAT = FIRST_TRIP.partition("```toml\n")[2].partition("```")[0]


class ParsedError(Exception):
    """Carries what a command understood out of it, before it does anything."""


def is_one_of(command: str, beginnings: tuple[str, ...]) -> bool:
    """Whether it begins with all the words of one of these."""
    return any(f"{command} ".startswith(f"{words} ") for words in beginnings)


def parsed(command: str) -> argparse.Namespace:
    """The arguments as the command reads them. SystemExit where it refuses them."""
    words = shlex.split(command)
    points = {point.name: point for point in entry_points(group="paani.commands")}
    read = argparse.ArgumentParser.parse_args

    def caught(parser: argparse.ArgumentParser, *given: list[str]) -> NoReturn:
        raise ParsedError(read(parser, *given))

    with mock.patch.object(argparse.ArgumentParser, "parse_args", caught), pytest.raises(ParsedError) as found:
        points[words[0]].load()(words[1:])
    options = found.value.args[0]
    assert isinstance(options, argparse.Namespace)
    return options


def require_loadable(options: argparse.Namespace) -> Config:
    """What `paani up` would start with: settings that go together, a scenario, a mission and a fence that load."""
    names = ("world", "camera", "headless", "record", "mission", "fence")
    is_simulated = cli.config_from(options).bus.graph is Graph.SIMULATION
    sets = up_sets(simulated=is_simulated, **{name: getattr(options, name) for name in names})
    config = cli.config_from(options, sets)
    world = load_scenario(config.world.name).world
    if config.navigator.mission:
        assert load_route_and_mission(config.navigator, (world.origin_lat_deg, world.origin_lon_deg))[1] is not None
    if config.camera.source not in {"sim", "webcam"}:
        assert Path(config.camera.source).exists()
    return config


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "20270101T000000Z-0.mcap"
    write_log(path, drive(12.0))
    return path


@pytest.fixture
def checkout(tmp_path: Path, recording: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as the reader has it: the examples, drives that were recorded, and files of the reader's own."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for folder in ("runs/drive", "runs/first", "runs/moored", "runs/segmenter", "mine", "FOLDER"):
        (tmp_path / folder).mkdir(parents=True)
    touched = ("mine.toml", "mine-settings.toml", "mount.toml", "thrusters.toml")
    for file in (*touched, "mine/segmenter.onnx", "clip.mp4", "runs/one.mcap", "runs/segmenter/best.pt", "PATH..."):
        (tmp_path / file).touch()
    for mission in ("mission.toml", "calibration.toml"):
        (tmp_path / mission).write_bytes((ROOT / "examples" / "mission.toml").read_bytes())
    (tmp_path / "boat.toml").write_text(BOAT, encoding="utf-8")
    (tmp_path / "runs" / "drive" / recording.name).hardlink_to(recording)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_tables_were_found() -> None:
    assert len(ROWS) >= 30
    assert len(MANUAL) >= 40


@pytest.mark.gl
@pytest.mark.timeout(300)
def test_every_row_runs_as_written(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In their order, as one makes what another reads; those that need a boat or minutes must parse, and load."""
    for row in ROWS:
        if is_one_of(row, FINISHES) or (row.startswith("replay") and "--check" in row):
            assert cli.main(shlex.split(row)) == 0, row
            assert capsys.readouterr().out, row
        elif is_one_of(row, ("up",)):
            require_loadable(parsed(row))
        elif is_one_of(row, OF_ANOTHER_PACKAGE):
            continue
        elif row.endswith("--help"):
            with pytest.raises(SystemExit, match="0"):
                cli.main(shlex.split(row))
        else:
            assert is_one_of(row, NEEDS_A_BOAT + TAKES_MINUTES + TELLS_OF_THE_MACHINE), row
            parsed(row)
    assert (checkout / "runs" / "sheet.png").is_file()


@pytest.mark.parametrize("command", MANUAL)
def test_a_command_of_the_manual_has_its_arguments_right(command: str, checkout: Path) -> None:
    (checkout / "runs" / "rendered").mkdir()  # which another command of the manual makes
    if not is_one_of(command, OF_ANOTHER_PACKAGE):
        parsed(command)


def test_the_boat_of_the_first_trip_is_a_hull(checkout: Path) -> None:
    """The settings on the page go together, with a line for the lights and one for the thrusters."""
    config = load_config(profile="hull", file=checkout / "boat.toml")
    assert config.bus.graph is Graph.HULL
    assert {"bridge", "thrusters", "sensors"} <= set(config.services)
    assert config.bridge.line
    assert config.thrusters.line != config.bridge.line


@pytest.mark.integration
async def test_the_command_of_another_package_listens_to_a_boat(spawn: Spawn, private_sets: tuple[str, ...]) -> None:
    folder = ROOT / "examples" / "lookout"
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["paani.commands"] == {"lookout": "lookout:main"}
    settings = [word for setting in private_sets for word in ("--set", setting)]
    call = f"import lookout; raise SystemExit(lookout.main({['--for', '2', *settings]}))"
    async with spawn("advisor"):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", call, cwd=folder, stdout=asyncio.subprocess.PIPE
        )
        out, _ = await process.communicate()
    assert process.returncode == 0
    assert out.decode().startswith("NO_DATA ")


@pytest.mark.gl
def test_the_pictures_are_drawn() -> None:
    """By the script beside them; another driver's last bits may differ."""
    for name in ("clear_water", "too_dark"):
        ours = cv2.imread(str(ROOT / "examples" / "pictures" / f"{name}.jpg"))
        again = cv2.imdecode(np.frombuffer(draw(VIEWS[name]), np.uint8), cv2.IMREAD_COLOR)
        assert ours is not None
        assert again is not None
        assert np.abs(ours.astype(int) - again.astype(int)).mean() < 4.0


def test_the_pictures_are_small() -> None:
    files = list((ROOT / "examples" / "pictures").iterdir())
    assert sum(file.stat().st_size for file in files) < 600_000
    assert {file.stem for file in files} == set(VIEWS)
