"""A scenario file states depth and shoals, and one that is wrong is refused with its field."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani.errors import UserError
from paani_sim.worlds.bathymetry import depth_at_m
from paani_sim.worlds.command import main
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.scenario_file import MAX_ACTORS

WORLD = '[world]\nkind = "lake"\n\n[route]\nfrom_m = 40.0\nlength_m = 40.0\n'
SHOAL = '[[depth.shoals]]\nframe = "route"\nat_m = [20.0, 0.5]\nradius_m = 5.0\ntop_m = 0.1\n'


def written(folder: Path, text: str) -> Path:
    file = folder / "mine.toml"
    file.write_text(WORLD + text, encoding="utf-8")
    return file


def test_a_file_states_the_bottom_and_its_shoals(tmp_path: Path) -> None:
    world = load_scenario(written(tmp_path, f"[depth]\nbottom_m = 2.5\n{SHOAL}")).world
    [shoal] = world.shoals
    assert (shoal.radius_m, shoal.top_m, world.bottom_m) == (5.0, 0.1, 2.5)
    assert depth_at_m(world, shoal.x_m, shoal.y_m) == pytest.approx(0.1)
    assert depth_at_m(world, *world.start[:2]) == 2.5


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (SHOAL.replace("5.0", "-5.0"), "depth.shoals[0].radius_m"),
        (SHOAL.replace("0.1", "-0.1"), "depth.shoals[0].top_m"),
        (SHOAL.replace("0.1", "nan"), "depth.shoals[0].top_m"),
        (SHOAL.replace("0.1", "3.0"), "depth.shoals[0].top_m"),
        (SHOAL.replace("20.0", "1.5"), "depth.shoals[0]: the boat starts aground"),
        (SHOAL.replace("route", "channel"), "depth.shoals[0].frame"),
        ("[depth]\nbottom_m = 0.0\n", "depth.bottom_m"),
        (SHOAL * (MAX_ACTORS + 1), "depth.shoals"),
    ],
    ids=["radius", "dry", "no number", "below the bottom", "start", "frame", "bottom", "too many"],
)
def test_a_wrong_file_is_refused_with_its_field(
    tmp_path: Path, text: str, field: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, text)
    with pytest.raises(UserError) as error:
        load_scenario(file)
    assert str(file) in str(error.value)
    assert field in str(error.value)
    assert main(["check", str(file)]) != 0
    assert field in "".join(capsys.readouterr())
