"""`paani trial` with processes of its own."""

import dataclasses
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from paani_sim.trials.drive import Drive
from paani_sim.trials.drive_recorder import DriveRecorder
from paani_sim.trials.fingerprint import FingerprintReader
from paani_sim.trials.ground_truth_evidence import GroundTruthEvidenceSource
from paani_sim.trials.policies import Policy
from paani_sim.trials.run_suite import StoredResult, encode_stored_result, find_stored_results, result_path
from paani_sim.trials.run_trial import load_case_config, run_trial
from paani_sim.trials.trial_cases import TrialCase, build_scenario
from paani_sim.worlds import Task
from paani_tools.replay import command as replay

pytestmark = pytest.mark.integration
SHORT = """
[world]
kind = "lake"
obstacles = false
actors = false
[route]
from_m = 20.0
length_m = 9.0
[task]
time_limit_s = 60.0
"""


def words(folder: Path, *more: str) -> list[str]:
    file = folder / "short.toml"
    file.write_text(SHORT)
    start = [sys.executable, "-m", "paani", "trial", "--scenario", str(file), "--out", str(folder / "run")]
    return [*start, "--policy", "blind", "oracle", "--seeds", "1..2", *more]


@pytest.mark.rotating(cpu_s=10)
def test_drives_in_processes_are_those_in_this_one(tmp_path: Path) -> None:
    """W14: two processes side by side give the bytes that one gives; a second run drives nothing."""
    figures = tmp_path / "figures.json"
    first = subprocess.run(
        words(tmp_path, "--jobs", "2", "--json", str(figures)), capture_output=True, text=True, check=False
    )
    assert first.returncode == 0, first.stderr
    assert json.loads(figures.read_bytes())["policies"]["oracle"]["completed"] == 2
    case, reader = TrialCase(str(tmp_path / "short.toml"), 2, Policy.ORACLE), FingerprintReader(())
    result, _ = run_trial(case)
    file = result_path(tmp_path / "run", case)
    assert file.read_bytes() == encode_stored_result(StoredResult(fingerprint=reader.fingerprint(case), result=result))
    assert find_stored_results(tmp_path / "run", [case], reader).missing == ()
    second = subprocess.run(words(tmp_path), capture_output=True, text=True, check=False)
    assert "4 of 4 drives are there already" in second.stderr
    assert second.stdout == first.stdout


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_an_interrupted_run_is_gone_on_with(tmp_path: Path, number: signal.Signals) -> None:
    """Ctrl-C or a kill: what is done stays and is summed up, the processes end, and the line says how to go on."""
    handler = signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell in the background ignores it, and so would a child
    run = subprocess.Popen(
        words(tmp_path, "--seeds", "1..40", "--jobs", "1"), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    signal.signal(signal.SIGINT, handler)
    done = tmp_path / "run" / "trials"
    while run.poll() is None and len(list(done.glob("*.json"))) < 1:
        pass
    run.send_signal(number)
    output, errors = run.communicate(timeout=60)
    assert run.returncode == 130, errors
    assert "the same command goes on" in errors
    assert "no contact" in output
    assert 1 <= len(list(done.glob("*.json"))) < 80
    assert not list(done.glob(".*"))


def test_nobody_drives_on_for_a_run_that_was_killed(tmp_path: Path) -> None:
    """Killed outright, the run leaves processes that end with the drive they are at."""
    run = subprocess.Popen(
        words(tmp_path, "--seeds", "1..32", "--jobs", "2"), stderr=subprocess.DEVNULL, start_new_session=True
    )
    done = tmp_path / "run" / "trials"
    while run.poll() is None and len(list(done.glob("*.json"))) < 1:
        time.sleep(0.05)
    run.kill()
    run.wait()
    count = len(list(done.glob("*.json")))
    time.sleep(10.0)
    assert len(list(done.glob("*.json"))) <= count + 4


def test_a_recorded_drive_is_decided_again_to_the_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The recording is one of the live topics: every decision in it comes out the same."""
    case = TrialCase("lake", 1, Policy.ORACLE)
    scenario = dataclasses.replace(build_scenario(case), task=Task(distance_m=2.0, time_limit_s=30.0))
    config, file = load_case_config(case), tmp_path / "drive.mcap"
    with DriveRecorder(file, config) as recorder:
        drive = Drive(
            scenario, config, GroundTruthEvidenceSource(scenario.world, (), config), tap=recorder.record_message
        )
        drive.run()
        drive.close()
    assert drive.progress.best_progress_m > 2.0
    assert replay.main([str(file), "--check"]) == 0
    assert "0 differ" in capsys.readouterr().out
