"""What the paper leaves open, on small drives of what `paani trial` measures on hundreds."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from paani import messages as m
from paani.arrays import I64
from paani_sim import vessels
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import pose_message
from paani_sim.trials import command
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.evidence_source import CameraEvidenceSource
from paani_sim.trials.policies import Policy, load_policy_config
from paani_sim.trials.result import TrialResult
from paani_sim.trials.run_trial import load_case_config, run_trial
from paani_sim.trials.trial_cases import SUITES, TrialCase, build_scenario, list_cases
from paani_sim.worlds import WORLDS, load_world

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

PAPER = Path(vessels.__file__).with_name("paper.toml")
OPEN_WATER = 'seed = 5\n[world]\nkind = "lake"\nobstacles = false\nactors = false\n'
LAP = OPEN_WATER + (
    "[weather]\nwind_mps = 1.0\n"
    "[route]\nclosed = true\n"
    "waypoints_m = [[0.0, 0.0], [2.9, -2.0], [6.9, -2.4], [10.3, -1.5], [11.8, 1.5], [10.3, 4.4], [6.9, 5.4],"
    " [2.9, 4.9], [0.0, 2.9]]\n"
    "[task]\ntime_limit_s = 200.0\n"
    '[[actors]]\nlook = "can"\nat_m = [6.9, -2.2]\n'
    '[[actors]]\nlook = "rowboat"\nat_m = [6.9, 5.8]\nheading_deg = 10.0\n'
)
ROUTE_AHEAD = OPEN_WATER + "[route]\nwaypoints_m = [[0.0, 0.0], [16.0, 0.0]]\n[task]\ntime_limit_s = 90.0\n"
AHEAD = ROUTE_AHEAD + '[[actors]]\nlook = "can"\nat_m = [8.0, 0.2]\n'
LOW_LIGHT = '[light]\nsky = "dusk"\nsun_elevation_deg = 4.0\n'
REFLECTIONS = '[light]\nsky = "clear"\nsun_elevation_deg = 9.0\nsun_azimuth_deg = 0.0\n'  # sun ahead
SUN_BEHIND = REFLECTIONS.replace("azimuth_deg = 0.0", "azimuth_deg = 180.0")
RAIN = '[light]\nsky = "overcast"\n[weather]\nrain_mmph = 10.0\nwind_mps = 3.0\nvisibility_m = 150.0\n'
OCCLUSION = '[[actors]]\nlook = "can"\nat_m = [11.0, 0.3]\n'  # hidden by the one before it


def driven(folder: Path, text: str, policy: Policy, *sets: str) -> TrialResult:
    file = folder / "given.toml"
    file.write_text(text)
    return run_trial(TrialCase(str(file), 5, policy), sets)[0]


@pytest.mark.gl
def test_w14_a_whole_lap_by_camera_round_what_lies_on_it(tmp_path: Path) -> None:
    """W14, W6: rendered pictures and the nets alone lead a boat once round; who does not look runs into the buoy."""
    seeing, blind = (driven(tmp_path, LAP, policy, "profile=paani") for policy in (Policy.PAANI, Policy.BLIND))
    assert blind.collisions > 0
    assert (seeing.why, seeing.collisions) == (DriveOutcome.COMPLETED, 0)
    assert seeing.progress_m >= seeing.goal_m > 30.0
    assert seeing.frames > 250
    assert {encounter.what for encounter in seeing.encounters} == {"actor_0", "actor_1"}
    from_middle = np.array([(x_m - 6.0) + 1j * (y_m - 1.5) for _, x_m, y_m in seeing.track])
    turned_rad = float(np.angle(from_middle[1:] / from_middle[:-1]).sum())
    assert 0.85 < turned_rad / (2.0 * np.pi) < 1.15, "once round, whatever counts the progress"


@pytest.mark.gl
@pytest.mark.parametrize(
    "condition", [LOW_LIGHT, REFLECTIONS, RAIN, OCCLUSION], ids=["low light", "reflections", "rain", "occlusion"]
)
def test_w4_what_lies_ahead_is_not_touched_in_any_condition(tmp_path: Path, condition: str) -> None:
    """W4: it is met and passed, or stopped before where the picture is not fit to be evidence."""
    result = driven(tmp_path, AHEAD + condition, Policy.PAANI_WIDE)
    assert result.collisions == 0
    assert result.frames > 50
    things = {"actor_0", "actor_1"} if condition is OCCLUSION else {"actor_0"}
    is_passed = result.completed and {encounter.what for encounter in result.encounters} == things
    assert is_passed or result.unusable


def picture_at_start(folder: Path, text: str) -> I64:
    file = folder / "given.toml"
    file.write_text(text)
    case = TrialCase(str(file), 5, Policy.PAANI_WIDE)
    given, config = build_scenario(case), load_case_config(case)
    plant, source = Plant.from_scenario(given, config.plant), CameraEvidenceSource(given.world, given.faults, config)
    header = m.PictureHeader(source_us=1, frame_seq=0, frame_epoch=0, width_px=320, height_px=180)
    try:
        frame = source.observe(pose_message(plant, 1), header, 0.0)
    finally:
        source.close()
        plant.close()
    assert frame is not None
    assert frame.bgr is not None
    return frame.bgr.astype(np.int64)


@pytest.mark.gl
def test_w4_each_condition_is_in_the_pictures_of_its_drive(tmp_path: Path) -> None:
    """W4: light and rain change the picture throughout, and a sun ahead glitters on the water; what is hidden does not
    change the picture, and does where nothing hides it.
    """

    def pixels_changed(one: I64, other: I64) -> float:
        return float((np.abs(one - other).max(axis=2) > 10).mean())

    fair = picture_at_start(tmp_path, AHEAD)
    for condition in (LOW_LIGHT, REFLECTIONS, RAIN):
        assert pixels_changed(picture_at_start(tmp_path, AHEAD + condition), fair) > 0.7
    assert picture_at_start(tmp_path, AHEAD + LOW_LIGHT).mean() < 0.85 * fair.mean()
    ahead, behind = (picture_at_start(tmp_path, AHEAD + light) for light in (REFLECTIONS, SUN_BEHIND))
    assert (behind[110:] >= 230).mean() < 0.0005 < (ahead[110:] >= 230).mean()
    dry = RAIN.replace("rain_mmph = 10.0\n", "")
    wet, without = picture_at_start(tmp_path, AHEAD + RAIN), picture_at_start(tmp_path, AHEAD + dry)
    assert pixels_changed(wet, without) > 0.015, "streaks and drops"
    nothing = picture_at_start(tmp_path, ROUTE_AHEAD)
    assert pixels_changed(picture_at_start(tmp_path, ROUTE_AHEAD + OCCLUSION), nothing) > 0.005
    assert pixels_changed(picture_at_start(tmp_path, AHEAD + OCCLUSION), fair) < 0.002


def test_w4_the_suite_has_these_conditions() -> None:
    """Low light, low sun, rain and fog, among the first six seeds of one world; and a lost link."""
    assert "link_loss" in {case.fault for case in list_cases(SUITES["standard"], tuple(WORLDS), Policy)}
    lights = [build_scenario(TrialCase("lake", seed, Policy.PAANI)).world.light for seed in range(1, 7)]
    assert any(light.sky == "dusk" for light in lights)
    assert any(light.sun_elevation_rad < 0.3 for light in lights)
    assert any(light.rain_mmph > 1.0 for light in lights)
    assert any(light.visibility_m < 300.0 for light in lights)


@pytest.mark.parametrize("fault", ["camera_black", "camera_dropped", "gps_outage", "link_loss"])
def test_w6_a_failure_that_passes_does_not_end_the_task(tmp_path: Path, fault: str) -> None:
    """W6: the boat stops or not, touches nothing, and arrives all the same."""
    failing = f'[[faults]]\nkind = "{fault}"\nstart_s = 8.0\nduration_s = 5.0\n'
    result = driven(tmp_path, AHEAD + failing, Policy.ORACLE)
    assert (result.why, result.collisions) == (DriveOutcome.COMPLETED, 0)
    if fault != "gps_outage":
        assert sum(stop.seconds for stop in result.stops) > 3.0


def test_w7_policies_differ_in_nothing_but_themselves(tmp_path: Path) -> None:
    """W7: the same water, things, weather, faults and seed for every policy; one setting is one ablation."""
    for world in WORLDS:
        assert len({pickle.dumps(build_scenario(TrialCase(world, 7, policy, "gps_jump"))) for policy in Policy}) == 1
    case = TrialCase("lake", 7, Policy.ORACLE)
    assert load_case_config(case, ["navigator.planner.use=true"]) == load_case_config(case)
    whole = driven(tmp_path, AHEAD, Policy.ORACLE)
    without = driven(tmp_path, AHEAD, Policy.ORACLE, "navigator.planner.use=false")
    assert whole != without
    assert (whole.goal_m, whole.limit_s, whole.seed) == (without.goal_m, without.limit_s, without.seed)


@pytest.mark.parametrize("world", WORLDS)
def test_w12_other_waters_ask_for_other_files_alone(world: str, tmp_path: Path) -> None:
    """W12: canal, harbour and lake are driven by the same processes; what differs is a scenario in a file."""
    text = f'seed = 2\n[world]\nkind = "{world}"\nactors = false\n[task]\ndistance_m = 12.0\ntime_limit_s = 60.0\n'
    result = driven(tmp_path, text, Policy.ORACLE)
    assert (result.why, result.collisions) == (DriveOutcome.COMPLETED, 0)
    case = TrialCase(str(tmp_path / "given.toml"), 5, Policy.ORACLE)
    assert np.array_equal(build_scenario(case).world.shore_m, load_world(world).shore_m)
    assert load_case_config(case) == load_policy_config(Policy.ORACLE), "no setting knows which water it is"


def test_w12_other_rules_are_settings(tmp_path: Path) -> None:
    """W12: a task that asks for slow driving on one side of a line; the thing in the way is passed on the other."""
    fence = "[fence]\nkeep_in = [[[-5.0, -1.4], [30.0, -1.4], [30.0, 10.0], [-5.0, 10.0]]]\n"
    plain = driven(tmp_path, AHEAD, Policy.ORACLE, "profile=paani")
    bound = driven(tmp_path, AHEAD + fence, Policy.ORACLE, "profile=paani", "navigator.cruise_mps=0.3")
    assert plain.completed
    assert bound.completed
    assert bound.seconds > 1.5 * plain.seconds
    assert min(y_m for _, _, y_m in plain.track) < -1.4 < min(y_m for _, _, y_m in bound.track)
    assert max(y_m for _, _, y_m in bound.track) > 1.0


@pytest.mark.rotating(cpu_s=3)
def test_a_drive_that_diverges_is_no_success_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Alone or in a suite: exit 1, one line, and not among the completed."""
    vessel = tmp_path / "stiff.toml"
    vessel.write_text(PAPER.read_text().replace("surge_linear = 4.0", "surge_linear = 9e8"))
    words = ["--set", f'plant.vessel="{vessel}"']
    assert command.main(["--one", "lake:1:blind", *words]) == 1
    assert '"why": "diverged"' in capsys.readouterr().out
    figures, out = tmp_path / "figures.json", str(tmp_path / "out")
    suite = ["--policy", "blind", "--worlds", "lake", "--seeds", "1", "--jobs", "1", "--out", out]
    assert command.main([*suite, "--json", str(figures), *words]) == 1
    assert "lake:1:blind: plant: state is not finite" in capsys.readouterr().err
    blind = json.loads(figures.read_bytes())["policies"]["blind"]
    assert (blind["trials"], blind["completed"]) == (1, 0)
