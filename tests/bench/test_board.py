"""`paani bench board` on a real run: every row is measured here, or says why it is not."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani.cli import main as paani
from paani.clock import stopwatch_ms
from paani.config import Config
from paani.logs.reader import open_log
from paani.messages import UnusableCause
from paani_tools.bench.board.figures import is_stale
from paani_tools.bench.board.host_counters import HostCounters
from paani_tools.bench.board.poll import Poll

pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]

ROWS_NOT_EVERYWHERE = {
    "memory of the control group median [MiB]": "memory",
    "temperature median / max [C]": "temperature",
    "OOM kills": "oom_kills",
    "CPU quota throttling": "throttling",
}


def bench(private_sets: tuple[str, ...], *words: str) -> list[str]:
    sets = [word for setting in private_sets for word in ("--set", setting)]
    return [sys.executable, "-m", "paani", "bench", "board", *words, *sets]


def test_twelve_polls_of_the_papers_loop(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """U6, U10, V17-V22: the instrument, on this machine, as fast as it may be while it has other work.

    The figures are those of the polls, and there is a result every two seconds and no more. A picture that waited for
    a processor until it was too old is no evidence, and nothing else is wrong with one.
    """
    folder = tmp_path / "kept"
    result = subprocess.run(
        bench(private_sets, "--polls", "12", "--profile", "paper", "--out", str(folder)),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    record = json.loads((folder / "board.json").read_text())
    run, figures = record["run"], record["run"]["figures"]
    polls = msgspec.convert(record["polls"], list[Poll])
    answers = [poll.status for poll in polls if poll.status is not None]
    seen = [status.evidence for status in answers if status.evidence is not None]
    results = {(evidence.frame_epoch, evidence.frame_seq): evidence for evidence in seen}
    assert len(polls) == figures["polls"] == figures["answered"] + sum(figures["failures"].values()) == 12
    assert len(answers) == figures["answered"] >= 6
    assert figures["learned"] == sum(evidence.cause is not UnusableCause.STALE for evidence in seen) > 0
    assert figures["unusable"] == sum(evidence.cause is UnusableCause.STALE for evidence in results.values())
    span_s = (polls[-1].at_us - polls[0].at_us) * 1e-6
    assert span_s > 10.9
    assert 3 <= len(results) == figures["distinct_results"] <= 0.5 * span_s + 2.0
    assert 0.2 < figures["cadence_hz"] < 0.7
    assert 0.2 < figures["captured_hz"] < 0.7
    assert figures["stale"] == sum(is_stale(status) for status in answers)
    assert run["profile"] == "paper"
    for name in ("pipeline_ms", "detector_ms", "segmenter_run_ms", "frame_age_s"):
        assert 0 < figures[name]["median"] <= figures[name]["p95"] <= figures[name]["maximum"]
    assert figures["segmenter_run_ms"]["median"] < figures["segmenter_ms"]["median"]
    assert figures["frame_age_s"]["median"] * 1e3 > figures["pipeline_ms"]["median"]
    assert 0 < figures["cpu_percent"]["median"] <= 100
    assert run["absent"] == HostCounters().absent
    lines = {line.split("  ")[0]: line for line in result.stdout.splitlines()}
    for name, key in ROWS_NOT_EVERYWHERE.items():
        assert (run["absent"].get(key) or "") in lines[name]
    assert {"467.842", "254.408", "165.593", "0.500", "2.58", "0.6838", "46.32", "1665.7", "45.3"} <= set(
        result.stdout.split()
    )
    assert "measured on" in result.stdout
    # The recorder has heard as much, but for what came before it listened and after it was told to end.
    assert open_log(folder).topics[keys.EVIDENCE.name] >= len(results) - 2


@pytest.mark.rotating(cpu_s=10)
def test_a_loop_on_pictures_needs_no_simulator_can_be_attached_to_and_keeps_what_an_interrupt_leaves(
    tmp_path: Path, private_sets: tuple[str, ...]
) -> None:
    folder, out = tmp_path / "kept", tmp_path / "err.txt"
    pictures = Path(__file__).parents[2] / "examples" / "pictures"
    with out.open("w") as errors:
        words = bench(private_sets, "--polls", "600", "--camera", str(pictures), "--out", str(folder))
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True)
    deadline_ms = stopwatch_ms() + 90e3
    while "open http" not in out.read_text():
        assert process.poll() is None and stopwatch_ms() < deadline_ms, out.read_text()  # noqa: PT018
        threading.Event().wait(0.1)
    assert "plant" not in out.read_text()
    attached = tmp_path / "attached"
    port = next(setting.partition("=")[2] for setting in private_sets if setting.startswith("dashboard.port"))
    words = ["--attach", f"http://127.0.0.1:{port}", "--cgroup-of", str(process.pid), "--polls", "3"]
    assert paani(["bench", "board", *words, "--out", str(attached)]) == 0
    run = json.loads((attached / "board.json").read_text())["run"]
    assert (run["profile"], run["figures"]["answered"]) == ("paani", 3)
    assert "Attached to" in run["conditions"][0]
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=30)
    assert process.returncode == 1, out.read_text()
    made = json.loads((folder / "board.json").read_text())["run"]["figures"]["polls"]
    assert 1 <= made < 30
    assert f"interrupted after {made} of 600 polls" in out.read_text()
    assert "600 were wanted" in printed


@pytest.mark.parametrize(
    ("words", "field"),
    [
        (("--polls", "0"), "--polls"),
        (("--attach", "ftp://x"), "--attach"),
        (("--attach", "http://127.0.0.1:1", "--camera", "sim"), "--attach"),
        (("--cgroup-of", "1"), "--cgroup-of"),
        (("--attach", "http://127.0.0.1:1", "--cgroup-of", "0"), "--cgroup-of"),
    ],
)
def test_a_mistake_is_told_before_anything_starts(
    words: tuple[str, ...], field: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = 0
    try:
        code = paani(["bench", "board", *words])
    except SystemExit as exit_:
        code = int(str(exit_.code))
    assert code == 2
    assert field in capsys.readouterr().err


def test_a_folder_that_keeps_a_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "board.json").write_text("{}")
    assert paani(["bench", "board", "--out", str(tmp_path)]) == 2
    assert "not empty" in capsys.readouterr().err
    assert Config().up.arm_at_start is False
