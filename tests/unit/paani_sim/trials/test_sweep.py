"""Sweeps: the cases, the worlds that they are driven in, and the figures."""

import dataclasses
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani_sim.trials import command
from paani_sim.trials.conditions import CONDITIONS, MOST_VALUES, parse_sweep
from paani_sim.trials.conditions import SWEPT as SWEPT_CONDITIONS
from paani_sim.trials.policies import Policy
from paani_sim.trials.run_trial import require_swept_effect
from paani_sim.trials.sweep import plot_sweep, tabulate_sweep
from paani_sim.trials.trial_cases import SUITES, TrialCase, build_scenario, list_cases, parse_case
from paani_sim.worlds.generate import MAX_ENCOUNTERS
from tests.unit.paani_sim.trials.trial_results import RESULT

SWEPT = parse_sweep("current_mps=0,0.30,3")


def test_a_sweep_drives_every_case_at_every_value_and_none_with_a_fault() -> None:
    plain = list_cases(SUITES["standard"], ("lake", "river"), (Policy.PAANI, Policy.ORACLE))
    cases = list_cases(SUITES["standard"], ("lake", "river"), (Policy.PAANI, Policy.ORACLE), swept=SWEPT)
    assert SWEPT == ("current_mps=0", "current_mps=0.3", "current_mps=3")
    assert len(cases) == 3 * sum(not case.fault for case in plain)
    assert len({case.stem for case in cases} | {case.stem for case in plain}) == len(cases) + len(plain)
    assert all(parse_case(case.name) == case for case in cases)


@pytest.mark.slow
def test_w7_only_the_condition_of_a_world_changes() -> None:
    plain = build_scenario(TrialCase("river", 3, Policy.BLIND))
    for name, condition in CONDITIONS.items():
        swept = build_scenario(TrialCase("river", 3, Policy.BLIND, swept=f"{name}={condition.most:g}")).world
        assert [each.id for each in swept.obstacles] == [each.id for each in plain.world.obstacles]
        assert np.array_equal(swept.route_m, plain.world.route_m)
        parts = [
            part for part in ("current", "wind", "light", "waves") if getattr(swept, part) != getattr(plain.world, part)
        ]
        assert len(parts) == 1, name
        before, after = (dataclasses.asdict(getattr(world, parts[0])) for world in (plain.world, swept))
        assert sum(after[field] != value for field, value in before.items()) == 1, name
        assert condition.most == pytest.approx(
            {
                "current_mps": swept.current.speed_mps,
                "wind_mps": swept.wind.speed_mps,
                "visibility_m": swept.light.visibility_m,
                "rain_mmph": swept.light.rain_mmph,
                "sun_elevation_deg": np.degrees(swept.light.sun_elevation_rad),
            }[name]
        )


@pytest.mark.rotating(cpu_s=7)
@pytest.mark.slow
@pytest.mark.parametrize("world", ["canal", "waterway"])
def test_more_people_are_met_where_the_sweep_says_so(world: str) -> None:
    """Nothing else about the traffic changes: a factor of one draws what the seed draws."""

    def count(swept: str) -> Counter[bool]:
        cases = [TrialCase(world, seed, Policy.BLIND, swept=swept) for seed in range(8)]
        met = [each for case in cases for each in build_scenario(case).world.actors]
        return Counter(each.look in {"swimming", "kayak", "paddleboard"} for each in met)

    plain, many = count(""), count("people_factor=4")
    assert count("people_factor=1") == plain
    assert many[True] / many.total() > 1.3 * plain[True] / plain.total()


@pytest.mark.slow
def test_as_many_encounters_are_met_as_the_sweep_says() -> None:
    def met(seed: int, wanted: int) -> set[str]:
        world = build_scenario(TrialCase("lake", seed, Policy.BLIND, swept=f"encounters={wanted}")).world
        names = [each.id for each in world.obstacles] + [each.id for each in world.actors]
        return {name for name in names if name.startswith("met_")}

    assert all(len(met(seed, 1)) == 1 for seed in range(4))
    assert max(len(met(seed, 6)) for seed in range(4)) > MAX_ENCOUNTERS


def test_the_figures_of_a_sweep_are_by_policy_and_value() -> None:
    """Rows in order of the values, with Wilson intervals; and a chart of each share with both bars."""
    touched = msgspec.structs.replace(RESULT, collisions=1, completed=False)
    results = {
        TrialCase("lake", seed, Policy.ORACLE, swept=swept): touched if (swept, seed) == (SWEPT[2], 1) else RESULT
        for swept in reversed(SWEPT)
        for seed in (1, 2)
    }
    table = tabulate_sweep(results)
    assert [row[:4] for row in table.rows] == [
        ("oracle", 0.0, 2, 100.0), ("oracle", 0.3, 2, 100.0), ("oracle", 3.0, 2, 50.0)
    ]  # fmt: skip
    assert [row[6] for row in table.rows] == [0.0, 0.0, 50.0]
    assert table.rows[0][4] == pytest.approx(34.24, abs=0.01)
    assert table.rows[0][5] == 100.0
    drawn = "".join(ET.fromstring(plot_sweep(results)).itertext())
    assert all(name in drawn for name in ("completed", "touched something", "current_mps", "95%", "1%", "oracle low"))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sweep", "tide=1"), "no condition 'tide'"),
        (("--sweep", "current_mps"), "'' is no number"),
        (("--sweep", "current_mps=1,x"), "'x' is no number"),
        (("--sweep", "current_mps=nan"), "current_mps is 0 to 3"),
        (("--sweep", "wind_mps=0,31"), "wind_mps is 0 to 30"),
        (("--sweep", "wind_mps=1,1.0"), "the same value twice"),
        (("--sweep", "wind_mps=" + ",".join(map(str, range(MOST_VALUES + 1)))), f"at most {MOST_VALUES}"),
        (("--sweep", "wind_mps=1", "--report", "a.html"), "--report is not for --sweep"),
        (("--svg", "a.svg"), "--svg needs --sweep"),
        (("--sweep", "wind_mps=1"), "plant.vessel paper has no windage"),
        (("--one", "lake@wind_mps=1:1:oracle"), "plant.vessel paper has no windage"),
        (("--one", "lake@tide=1:1:paani"), "no condition 'tide'"),
        (("--sweep", "people_factor=1.5"), "people_factor is a whole number"),
        (("--one", "imazu-01@encounters=2:1:paani"), "imazu-01 says itself what is met"),
        (("--scenario", "imazu-01", "--sweep", "people_factor=2"), "imazu-01 says itself what is met"),
        (("--scenario", "imazu-01", "--sweep", "people_factor=1"), "imazu-01 says itself what is met"),
    ],
)
@pytest.mark.slow
def test_a_sweep_that_is_none_is_refused(
    words: tuple[str, ...], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=says):
        command.main([*words])
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_wind_is_swept_for_a_hull_that_it_moves_and_everything_else_for_any() -> None:
    require_swept_effect(TrialCase("lake", 1, Policy.ORACLE, swept="wind_mps=3"), ("plant.vessel=otter",))
    for name in SWEPT_CONDITIONS.keys() - {"wind_mps"}:
        require_swept_effect(TrialCase("lake", 1, Policy.ORACLE, swept=f"{name}={SWEPT_CONDITIONS[name].most:g}"))
