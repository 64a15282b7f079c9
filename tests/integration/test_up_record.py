"""`paani up --record DIR`: the first word of everybody is in it, and the boat needs no recorder."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.cli import main as paani
from paani.config import load_config
from paani.logs.folder import recordings
from paani.logs.reader import Log, open_log
from tests.integration.test_up import READY_S, Up, children_of, words_of
from tests.unit.paani.logs.small_logs import recorded

DRIVEN_S = 60.0
pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


def first(log: Log, topic: str) -> bytes:
    return next(log.records([topic])).data


def has_driven(folder: Path, files: int) -> bool:
    """Whether the newest of that many files shows thrust in force; it is still written to."""
    found = recordings(folder)
    if len(found) < files or not found[-1].size_bytes:
        return False
    return any(one.zero_cause is m.ZeroCause.NONE for one in recorded(open_log(found[-1].path), keys.THRUST_APPLIED))


@pytest.mark.rotating(cpu_s=20)
def test_a_drive_is_recorded_and_a_dead_recorder_stops_nothing(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """The recorder is killed on the way: thrust goes on, a new file begins, the old one is mended."""
    folder, file = tmp_path / "drive", tmp_path / "s.json"
    up = Up(tmp_path, *words_of(private_sets, "--headless", "--record", str(folder), "--summary", str(file)))
    up.until(lambda: "processes alive after" in up.out, READY_S)
    up.until(lambda: has_driven(folder, files=1), DRIVEN_S)
    os.kill(up.children()["recorder"], signal.SIGKILL)
    up.until(lambda: "recorder is back" in up.out, 30.0)
    up.until(lambda: has_driven(folder, files=2), DRIVEN_S)
    up.process.send_signal(signal.SIGINT)
    assert up.process.wait(60) == 0, (up.out, up.errors)
    assert up.children() == {}
    services = json.loads(file.read_text())["services"]
    assert {name: figures["restarts"] for name, figures in services.items() if figures["restarts"]} == {"recorder": 1}
    before, after = (open_log(found.path) for found in recordings(folder))
    assert (before.problems, after.problems) == ([], [])
    for service in keys.DECIDING_SERVICES:
        step = msgspec.json.decode(first(before, f"{service}/step"), type=m.Step)
        assert (step.seq, bool(step.state)) == (0, True), "from its first step everything can be computed again"
    applied = [one for log in (before, after) for one in recorded(log, keys.THRUST_APPLIED)]
    driven = [one for one in applied if one.zero_cause is m.ZeroCause.NONE]
    assert driven[0].sent_us < before.end_us < after.start_us < driven[-1].sent_us
    assert all(one.lost_pulse != "recorder" for one in applied)
    assert before.config().recorder.folder == str(folder)
    assert before.topics["camera/picture"] > 0
    assert "eye/picture" not in before.topics, "the camera relays the same bytes"


@pytest.mark.rotating(cpu_s=30)
def test_a_folder_that_goes_away_stops_nothing_and_is_told_at_the_end(
    tmp_path: Path, private_sets: tuple[str, ...]
) -> None:
    """The recorder can no longer be started; the drive goes on to its end and says so."""
    folder, file = tmp_path / "drive", tmp_path / "s.json"
    words = ("--headless", "--record", str(folder), "--for", "6", "--summary", str(file))
    up = Up(tmp_path, *words_of(private_sets, *words))
    up.until(lambda: "processes alive after" in up.out, READY_S)
    folder.rename(tmp_path / "elsewhere")
    folder.touch()
    os.kill(up.children()["recorder"], signal.SIGKILL)
    assert up.process.wait(60) == 1, (up.out, up.errors)
    assert [line.partition(" (")[0] for line in up.errors] == ["paani: not alive at the end: recorder"]
    summary = json.loads(file.read_text())
    assert summary["duration_s"] > 5.0
    assert {name for name, figures in summary["services"].items() if figures["restarts"]} == {"recorder"}


@pytest.mark.parametrize(("words", "name"), [(("--record",), "--record "), (("--set",), "recorder.folder")])
def test_a_folder_that_cannot_be_written_is_named(
    words: tuple[str, ...], name: str, tmp_path: Path, private_sets: tuple[str, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    """By the option that was given, or by the setting that the recorder reads."""
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "x"
    given = str(folder) if words == ("--record",) else f"recorder.folder={folder}"
    assert paani(["up", *words_of(private_sets, "--headless", *words, given)]) == 2
    printed = capfd.readouterr()
    [line] = printed.err.splitlines()
    assert f"{name.strip()} {folder}" in line
    assert printed.out == ""
    assert children_of(os.getpid()) == {}


def test_without_a_folder_there_is_no_recorder(tmp_path: Path) -> None:
    assert "recorder" not in load_config().services
    assert "recorder" in load_config(sets=(f"recorder.folder={tmp_path}",)).services
