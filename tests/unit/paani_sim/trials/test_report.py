"""The page about drives, its plans, and recordings that the replay reads."""

import re
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest

from paani_sim.trials.drive_recorder import DriveRecorder
from paani_sim.trials.imazu_sheet import draw_imazu_sheet
from paani_sim.trials.policies import Policy
from paani_sim.trials.report import render_page
from paani_sim.trials.result import Contact, TrialResult
from paani_sim.trials.run_trial import load_case_config
from paani_sim.trials.suite_summary import summarise_suite
from paani_sim.trials.track_chart import draw_track_chart, find_worst_moment_s
from paani_sim.trials.trial_cases import TrialCase, build_scenario
from paani_sim.trials.worst_drives import RepeatedDrive, select_worst_drives
from tests.unit.paani_sim.trials.trial_results import RESULT

CASES = [TrialCase("lake", seed, Policy.PAANI) for seed in (1, 2, 3)]
TOUCH = Contact(what="<met_1>", kind="buoy", at_s=7.0, x_m=0.0, y_m=0.0, speed_mps=0.5, visible=True)


def touched(result: TrialResult) -> TrialResult:
    return msgspec.structs.replace(result, contacts=(TOUCH,), collisions=1, collisions_visible=1)


def test_the_worst_come_first() -> None:
    late = msgspec.structs.replace(RESULT, completed=False)
    results = {CASES[0]: RESULT, CASES[1]: late, CASES[2]: touched(RESULT)}
    assert select_worst_drives(results, 2) == [CASES[2], CASES[1]]
    assert select_worst_drives({TrialCase("lake", 1, Policy.BLIND): RESULT}, 2) == [TrialCase("lake", 1, Policy.BLIND)]


def test_the_worst_moment() -> None:
    """The touch, else the closest point, else where the drive ended."""
    assert find_worst_moment_s(touched(RESULT)) == 7.0
    assert find_worst_moment_s(RESULT) == 9.0
    ended = msgspec.structs.replace(RESULT, completed=False, track=((3.0, 0.0, 0.0), (44.0, 9.0, 0.0)))
    assert find_worst_moment_s(ended) == 44.0


@pytest.mark.parametrize("world", ["lake", "canal"])
@pytest.mark.slow
def test_a_plan_is_well_formed_and_shows_the_track(world: str) -> None:
    scenario = build_scenario(TrialCase(world, 1, Policy.BLIND))
    start = scenario.world.start
    track = tuple((2.0 * k, start.x_m + k, start.y_m) for k in range(9))
    plan = draw_track_chart(scenario.world, touched(msgspec.structs.replace(RESULT, track=track)))
    drawn = ElementTree.fromstring(plan)
    kinds = [element.get("class") for element in drawn]
    assert {"water", "route", "track", "start", "hit", "scale"} <= set(kinds)
    numbers = [float(n) for n in re.findall(r"-?\d+\.\d+", drawn.find("*[@class='track']").get("points"))]  # type: ignore[union-attr, arg-type]
    assert 0.0 < min(numbers) < max(numbers) < 520.0


@pytest.mark.slow
def test_the_page_stands_alone() -> None:
    """Names are escaped, nothing is fetched, and the recording is linked."""
    results = {CASES[0]: touched(RESULT), CASES[1]: RESULT, TrialCase("lake", 1, Policy.BLIND): RESULT}
    again = [RepeatedDrive(case=CASES[0], is_equal=False, log="lake-1-paani.mcap", strip=b"png")]
    text = render_page(summarise_suite("quick", results), results, again, "all-drives")
    assert "&lt;met_1&gt;" in text
    assert "<met_1>" not in text
    assert 'href="all-drives/lake-1-paani.mcap"' in text
    assert "data:image/png;base64,cG5n" in text
    assert "driven again it went otherwise" in text
    assert not re.search(r"(src|href)=.(https?:)?//", text)
    assert "NaN" not in text


@pytest.mark.slow
def test_the_page_has_a_sheet_of_the_imazu_cases() -> None:
    """Each driven case once, with its vessels, the boat's track and contacts; worlds are not on it."""
    track = tuple((2.0 * k, 1.2 * k, 0.0) for k in range(40))
    hit = touched(msgspec.structs.replace(RESULT, track=track))
    results = {TrialCase(name, 1, Policy.PAANI): hit for name in ("imazu-05", "imazu-fair-18", "lake")}
    sheet = draw_imazu_sheet(results, Policy.PAANI)
    drawn = ElementTree.fromstring(sheet)
    kinds = [element.get("class") for element in drawn]
    assert [kinds.count(kind) for kind in ("sea", "track", "target", "hit", "bad")] == [2, 2, 5, 2, 2]
    captions = [element.text for element in drawn.iter("text")]
    assert captions == ["5 plain: H A, 0.0 m", "18 camera-fair: F D C, 0.0 m"]
    assert draw_imazu_sheet(results, Policy.ORACLE) == ""
    page = render_page(summarise_suite("imazu", results), results, [], "all-drives")
    assert sheet in page
    assert "camera-fair, all seen" in page


@pytest.mark.slow
def test_a_recording_that_failed_is_not_there(tmp_path: Path) -> None:
    file = tmp_path / "drive.mcap"
    with pytest.raises(RuntimeError), DriveRecorder(file, load_case_config(CASES[0])):
        raise RuntimeError
    assert not list(tmp_path.iterdir())
