"""`paani world`: what it lists, draws, checks and dumps."""

import re
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from paani.cli import main as paani
from paani_sim.worlds import WORLDS
from paani_sim.worlds.command import main
from paani_sim.worlds.load import SCENARIOS, load_scenario
from paani_sim.worlds.plan_view import KINDS, LAND, ROUTE, WATER, draw_plan_view
from paani_sim.worlds.world import Kind


@pytest.mark.slow
def test_list_names_every_world_and_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == [*WORLDS, *SCENARIOS]


@pytest.mark.slow
def test_check_says_which_files_are_sound(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    good.write_text('[world]\nkind = "lake"\n')
    bad.write_text('[world]\nkind = "lake"\nwater = 1\n')
    assert main(["check", str(good)]) == 0
    assert main(["check", str(good), str(bad)]) == 2
    captured = capsys.readouterr()
    assert captured.out.count("good.toml: sound") == 2
    assert captured.err.count("\n") == 1
    assert "bad.toml" in captured.err
    assert "`water`" in captured.err


@pytest.mark.slow
def test_mjcf_is_a_model_of_the_scenario(tmp_path: Path) -> None:
    out = tmp_path / "model.xml"
    assert main(["mjcf", "canal_head_on", "--out", str(out)]) == 0
    model = mujoco.MjModel.from_xml_path(str(out))
    assert model.body("dinghy_ahead").mocapid[0] >= 0
    assert model.geom("bridge").contype[0] > 0


@pytest.mark.parametrize(
    "argv",
    [
        ["mjcf", "pond", "--out", "x.xml"],
        ["mjcf", "lake", "--out", "no/such/folder/x.xml"],
        ["render", "lake", "--out", "x.jpg"],
        ["render", "lake", "--out", "no/such/folder/x.png"],
        ["check", "absent.toml"],
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    argv: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert paani(["world", *argv]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", ["0x10", "10", "axb", "9999x9999"])
def test_impossible_sizes_are_refused(size: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["render", "lake", "--out", "x.png", "--size", size])
    assert caught.value.code == 2
    assert re.search("argument --size: .* is not (WIDTHxHEIGHT|from 16 to 2048)", capsys.readouterr().err)


@pytest.mark.parametrize("option", ["--n=0", "--n=many", "--seed=-1"])
def test_impossible_numbers_are_refused(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["dataset", "--n=1", "--out", str(tmp_path / "set"), option])
    assert caught.value.code == 2
    assert option.split("=", maxsplit=1)[0] in capsys.readouterr().err


@pytest.mark.parametrize("name", ["lake", "harbour_crossing"])
@pytest.mark.slow
def test_the_plan_shows_water_land_route_and_things(name: str) -> None:
    scenario = load_scenario(name)
    plan = draw_plan_view(scenario, 600, 400)
    assert plan.shape == (400, 600, 3)
    for bgr in (WATER, LAND[scenario.world.bank], ROUTE, KINDS[Kind.VESSEL], KINDS[Kind.BUOY]):
        assert (plan == np.array(bgr, np.uint8)).all(axis=2).sum() > 5


@pytest.mark.gl
def test_render_writes_a_sheet(tmp_path: Path) -> None:
    out = tmp_path / "sheet.png"
    assert main(["render", "river_swimmer", "--out", str(out), "--size", "96x72"]) == 0
    picture = cv2.imread(str(out))
    assert picture is not None
    assert picture.shape[1] == 4 * 96
    views = picture[-2 * (72 + 22) :]
    assert views.std() > 20.0
