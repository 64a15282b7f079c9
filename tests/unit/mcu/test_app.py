"""The App Lab app: what it asks of the board, and what its Linux half does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import ROOT

APP = ROOT / "mcu/app"
MAIN = APP / "python/main.py"


def run_main(*, paths: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": paths, "PAANI_BRIDGE__RATE_HZ": "1e9"}
    command = [sys.executable, *([] if paths else ["-S"]), str(MAIN)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a2_the_nets_run_on_the_cpu_alone_and_the_app_asks_for_no_brick() -> None:
    """A2 as far as files say it: that the board's processor bears the load needs the board."""
    sessions = []
    for folder in ("services", "models"):
        for path in (ROOT / folder).rglob("*.py"):
            sessions += re.findall(r"InferenceSession\((.*)\)", path.read_text(encoding="utf-8"))
    assert sessions
    assert all('providers=["CPUExecutionProvider"]' in session for session in sessions), sessions
    ncnn = (ROOT / "models/paani_models/engines/ncnn_runner.py").read_text(encoding="utf-8")
    assert re.findall(r"use_vulkan_compute = (.*)", ncnn) == ["False"]
    assert re.findall(r"^bricks:.*", (APP / "app.yaml").read_text(encoding="utf-8"), re.M) == ["bricks: []"]


def test_the_app_has_what_app_lab_looks_for() -> None:
    for name in ("app.yaml", "python/main.py", "python/requirements.txt", "sketch/sketch.ino", "sketch/sketch.yaml"):
        assert (APP / name).is_file(), name
    assert "platform: arduino:zephyr\n" in (APP / "sketch/sketch.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_linux_half_is_the_bridge_with_its_settings() -> None:
    """It gets as far as the bridge's own checks, which refuse the rate that the environment asks for."""
    finished = run_main(paths=os.pathsep.join(path for path in sys.path if path and Path(path).is_dir()))
    assert finished.returncode == 2
    assert "rate_hz" in finished.stderr
    assert "Traceback" not in finished.stderr


def test_without_paanis_wheel_the_linux_half_says_so() -> None:
    finished = run_main(paths="")
    assert finished.returncode == 2
    assert finished.stderr == (
        "paani is not installed: put its wheel beside main.py and its name into requirements.txt\n"
    )
