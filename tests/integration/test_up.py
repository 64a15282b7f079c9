"""`paani up`: the whole loop with one command, and nothing left behind."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.clock import stopwatch_ms
from paani.config import Config, load_config
from paani.operator_key import KEY_FILE
from paani_tools.up.log_files import MAX_BYTES
from paani_tools.up.run_summary import STAGES
from tests.integration.exposure import listening, places_of, readable_by_others

pytestmark = [pytest.mark.integration, pytest.mark.timeout(150)]

READY_S = 90.0


class Up:
    """One `paani up` as a user starts it."""

    def __init__(self, folder: Path, *words: str) -> None:
        self._out, self._err = folder / "out.txt", folder / "err.txt"
        with self._out.open("w") as out, self._err.open("w") as err:
            self.process = subprocess.Popen([sys.executable, "-m", "paani", "up", *words], stdout=out, stderr=err)

    @property
    def out(self) -> str:
        return self._out.read_text()

    @property
    def errors(self) -> list[str]:
        return self._err.read_text().splitlines()

    def children(self) -> dict[str, int]:
        return children_of(self.process.pid)

    def until(self, condition: Callable[[], bool], limit_s: float) -> None:
        deadline_ms = stopwatch_ms() + limit_s * 1e3
        while not condition():
            assert self.process.poll() is None, (self.out, self.errors)
            assert stopwatch_ms() < deadline_ms, (self.out, self.errors)
            threading.Event().wait(0.05)


def children_of(pid: int) -> dict[str, int]:
    """The services of a `paani up` that run now, whoever their parent is."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words = (folder / "cmdline").read_text().rstrip("\0").split("\0")
            if words[1:4] == ["-m", "paani_tools.up.child", str(pid)]:
                found[words[-1]] = int(folder.name)
    return found


def words_of(sets: tuple[str, ...], *more: str) -> list[str]:
    return [*more, *(word for setting in sets for word in ("--set", setting))]


def test_a_drive_on_the_river(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """The summary has what it promises, and the boat moves."""
    file = tmp_path / "s.json"
    up = Up(tmp_path, *words_of(private_sets, "--headless", "--for", "12", "--summary", str(file)))
    assert up.process.wait(READY_S + 30) == 0, (up.out, up.errors)
    assert up.children() == {}
    summary = json.loads(file.read_text())
    assert summary["duration_s"] == pytest.approx(12.0, abs=1.0)
    assert (summary["profile"], summary["world"]) == ("paani", "river")
    assert set(summary["services"]) == set(Config().services)
    for service in summary["services"].values():
        assert service["rate_hz"] > 0.5
        assert service["rss_mib"] > 10
        assert service["cpu_cores"] > 0
        assert service["restarts"] == 0
    board = sum(summary["services"][name]["rss_mib"] for name in keys.BOARD_SERVICES if name in summary["services"])
    assert summary["board_rss_mib"] == pytest.approx(board, abs=0.1)
    assert set(summary["latency_ms"]) == set(STAGES)
    for stage in summary["latency_ms"].values():
        assert 0 < stage["p50"] <= stage["p95"] <= stage["p99"]
    assert set(summary["decisions"]) == {d.value for d in m.Direction}
    assert sum(summary["decisions"].values()) == sum(summary["reasons"].values()) > 36
    assert summary["distance_m"] > 2.0
    assert summary["collisions"] == 0
    assert isinstance(summary["drops"], dict)
    assert isinstance(summary["waypoints_reached"], int)


def test_a_hung_process_is_started_again_and_ctrl_c_ends_all(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """Meanwhile a log is kept bounded, only router and page listen, and no secret can be seen."""
    file = tmp_path / "s.json"
    up = Up(tmp_path, *words_of(private_sets, "--summary", str(file)))
    up.until(lambda: "http://127.0.0.1:" in up.out, READY_S)
    require_closed(up, tmp_path / "runtime", private_sets)
    log = tmp_path / "runtime" / "logs" / "advisor.log"
    with log.open("ab") as child:
        child.write(bytes(MAX_BYTES + 1))
    up.until(lambda: log.with_name("advisor.log.1").exists() and log.stat().st_size < MAX_BYTES, 15.0)
    frozen = up.children()["advisor"]
    os.kill(frozen, signal.SIGSTOP)
    up.until(lambda: "advisor is back" in up.out, 15.0)
    assert "advisor hangs" in up.out
    assert up.children()["advisor"] != frozen
    up.process.send_signal(signal.SIGINT)
    assert up.process.wait(3.0) == 0
    assert up.children() == {}
    assert json.loads(file.read_text())["services"]["advisor"]["restarts"] == 1


def require_closed(up: Up, runtime: Path, private_sets: tuple[str, ...]) -> None:
    """Only the router and the page listen, on this machine alone, and nobody else can read a secret."""
    bus = load_config(sets=private_sets)
    places = {"router": {("127.0.0.1", port_of(bus.bus.router))}, "dashboard": {("127.0.0.1", bus.dashboard.port)}}
    children = up.children()
    for name, pid in {**children, "up": up.process.pid}.items():
        assert listening(pid) == places.get(name, set()), name
    assert readable_by_others(runtime) == set()
    secrets = {path: path.read_text().strip() for path in (runtime / "credentials").iterdir() if path.name[0] != "."}
    secrets[runtime / KEY_FILE] = (runtime / KEY_FILE).read_text().strip()
    for path, secret in secrets.items():
        assert len(secret) > 20, path
        assert places_of(secret, [up.process.pid, *children.values()], runtime / "logs") == set(), path


def port_of(endpoint: str) -> int:
    return int(endpoint.rpartition(":")[2])


def test_no_orphan_survives_a_killed_supervisor(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    up = Up(tmp_path, *words_of(private_sets, "--headless"))
    up.until(lambda: len(up.children()) == len(Config().services), READY_S)
    up.process.kill()
    up.process.wait()
    for _ in range(20):
        if not up.children():
            return
        threading.Event().wait(0.1)
    assert up.children() == {}


@pytest.mark.rotating(cpu_s=20)
def test_what_cannot_be_kept_alive_ends_all(
    tmp_path: Path, private_sets: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A broken installation: the process crashes at each start, and the reason is told once."""
    (tmp_path / "onnxruntime.py").write_text("raise ImportError('this installation is broken')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    up = Up(tmp_path, *words_of(private_sets, "--headless"))
    assert up.process.wait(60) == 1, (up.out, up.errors)
    assert len(up.errors) == 1
    assert "perception ended 5 times" in up.errors[0]
    assert "this installation is broken" in up.errors[0]
    assert up.children() == {}


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--set", "advisor.policy.tie=2"), "advisor.policy.tie"),
        (("--world", "ocean"), "ocean"),
        (("--camera", "no/such/folder"), "camera.source no/such/folder"),
        (("--set", "perception.segmenter=CORRUPT"), "corrupt.onnx"),
        (("--summary", "no/such/folder/s.json"), "no/such/folder"),
        (("--profile", "paani", "--config", "no_such.toml"), "no_such.toml"),
    ],
    ids=["setting", "world", "camera", "model", "summary", "file"],
)
def test_a_mistake_is_one_line(
    tmp_path: Path, private_sets: tuple[str, ...], words: tuple[str, ...], named: str
) -> None:
    corrupt = tmp_path / "corrupt.onnx"
    corrupt.write_bytes(b"not a model")
    words = tuple(word.replace("CORRUPT", str(corrupt)) for word in words)
    up = Up(tmp_path, *words_of(private_sets, "--headless", *words))
    assert up.process.wait(60) == 2, (up.out, up.errors)
    assert len(up.errors) == 1
    assert named in up.errors[0]
    assert up.children() == {}


@pytest.mark.parametrize("field", ["bus.router", "dashboard.port"])
def test_a_busy_port_is_named_before_anything_starts(tmp_path: Path, private_sets: tuple[str, ...], field: str) -> None:
    setting = next(setting for setting in private_sets if setting.startswith(field))
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("127.0.0.1", int(setting.rpartition(":" if "router" in field else "=")[2])))
        taken.listen()
        up = Up(tmp_path, *words_of(private_sets))
        assert up.process.wait(20) == 2
    assert len(up.errors) == 1
    assert re.search(rf"{field} .*: in use by another program, .* \(--set {field}=.+\)$", up.errors[0])
    assert up.out == ""
    assert not (tmp_path / "runtime" / "logs").exists(), "no process was started"
