"""Nothing that runs here tells anybody about it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.parametrize(
    "module",
    ["paani_services.perception.engine", "paani_models.engines.onnx_runner", "paani_models.quantisation.quantise"],
)
def test_onnxruntime_neither_makes_a_devices_identity_nor_a_queue_of_events(tmp_path: Path, module: str) -> None:
    pytest.importorskip("onnx") if "models" in module else None
    signs_of_a_ci = {name for name in os.environ if name == "CI" or name.startswith(("GITHUB_", "GITLAB_", "ORT_"))}
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    environment = {name: value for name, value in os.environ.items() if name not in signs_of_a_ci} | home
    code = f"import {module}, onnxruntime; onnxruntime.SessionOptions()"
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=60)
    assert not list(tmp_path.rglob("*"))
