"""`paani bench water`: its table and plot, and what it says to mistakes."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from paani.errors import UserError
from paani_sim.trials import bench_water as bench
from paani_sim.trials.bench_water import ACTORS, DEFAULT_CASE, SIZES_PX, Cost, plot_costs, tabulate_costs, time_drive
from paani_sim.trials.policies import Policy

COSTS = [
    Cost(policy=policy, actors=count, width_px=size[0], height_px=size[1], cpu_s=0.1 + 0.01 * count)
    for policy, count, size in [(p, n, DEFAULT_CASE[1]) for p in (Policy.PAANI, Policy.ORACLE) for n in ACTORS]
    + [(Policy.PAANI, DEFAULT_CASE[0], size) for size in SIZES_PX]
]


def test_the_plot_is_well_formed_and_names_both_policies() -> None:
    drawn = ElementTree.fromstring(plot_costs(COSTS))
    text = " ".join(drawn.itertext())
    assert "paani" in text
    assert "oracle" in text
    assert "thousand pixels" in text
    assert sum(element.tag.endswith("polyline") for element in drawn.iter()) == 3


def test_the_table_has_a_row_for_each_measurement() -> None:
    part = tabulate_costs(COSTS)
    assert len(part.rows) == len(COSTS)
    assert all(len(row) == len(part.columns) for row in part.rows)


@pytest.mark.slow
def test_a_drive_is_timed_after_its_warm_up() -> None:
    simulated_s, wall_s, cpu_s = time_drive(Policy.BLIND, 2, DEFAULT_CASE[1], 0.5, threads=False)
    assert simulated_s == pytest.approx(0.5)
    assert wall_s > 0.0
    assert cpu_s > 0.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--json", "/nowhere/a.json"], "no such folder"),
        (["--only", "lockstep", "--svg", "a.svg"], "needs the part cost"),
    ],
)
def test_mistakes_are_named(words: list[str], says: str) -> None:
    with pytest.raises(UserError, match=says):
        bench.main(words)
    assert not Path("a.svg").exists()
