"""The core is one source for board and emulator: it stands on nothing."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.places import ROOT

CORE = ROOT / "mcu/app/sketch/src/paani"
SKETCH = ROOT / "mcu/app/sketch/sketch.ino"
FLAGS = ["-std=c++17", "-Os", "-ffreestanding", "-fno-exceptions", "-fno-rtti", "-Wall", "-Wextra", "-Werror"]


def test_the_core_includes_nothing_but_itself_and_fixed_width_integers() -> None:
    for path in CORE.iterdir():
        included = re.findall(r"#include\s+(\S+)", path.read_text(encoding="utf-8"))
        assert {name for name in included if name.startswith("<")} <= {"<stdint.h>"}, path


def test_no_source_of_the_firmware_is_over_400_lines() -> None:
    for path in (ROOT / "mcu").rglob("*"):
        if path.suffix in {".h", ".cpp", ".ino", ".ld", ".md", ".py"}:
            assert len(path.read_text(encoding="utf-8").splitlines()) <= 400, path


def test_the_core_has_no_undefined_symbols(tmp_path: Path) -> None:
    """No heap, no library, no exceptions: linked by itself, the core asks for nothing."""
    if not shutil.which("g++"):
        pytest.skip("needs g++")
    sources = sorted(CORE.glob("*.cpp"))
    subprocess.run(["g++", *FLAGS, "-c", *sources], cwd=tmp_path, check=True)
    subprocess.run(["ld", "-r", "-o", "core.o", *(f"{path.stem}.o" for path in sources)], cwd=tmp_path, check=True)
    assert subprocess.run(["nm", "-u", "core.o"], cwd=tmp_path, check=True, capture_output=True).stdout == b""
