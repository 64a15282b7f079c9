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


@pytest.mark.slow
def test_the_core_has_no_undefined_symbols(tmp_path: Path) -> None:
    """No heap, no library, no exceptions: linked by itself, the core asks for nothing."""
    if not shutil.which("g++"):
        pytest.skip("needs g++")
    sources = sorted(CORE.glob("*.cpp"))
    subprocess.run(["g++", *FLAGS, "-c", *sources], cwd=tmp_path, check=True)
    subprocess.run(["ld", "-r", "-o", "core.o", *(f"{path.stem}.o" for path in sources)], cwd=tmp_path, check=True)
    assert subprocess.run(["nm", "-u", "core.o"], cwd=tmp_path, check=True, capture_output=True).stdout == b""


@pytest.mark.slow
def test_the_sketch_compiles_against_stubs_of_its_libraries() -> None:
    """Syntax and types alone: that it runs needs the board."""
    if not shutil.which("g++"):
        pytest.skip("needs g++")
    command = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{ROOT / 'mcu/stubs'}"]
    checked = subprocess.run([*command, "-x", "c++", SKETCH], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr


def test_the_sketch_makes_its_outputs_safe_and_starts_the_watchdog_before_the_bridge() -> None:
    """Only what was made safe before may wait: the bridge's library blocks without a router."""
    setup = SKETCH.read_text(encoding="utf-8").partition("void setup() {")[2].partition("\n}\n")[0]
    steps = ["digitalWrite(ENABLE_PIN, LOW)", "set_pins(", "device().start(", "watchdog::start()", "Bridge.begin()"]
    places = [setup.index(step) for step in steps]
    assert places == sorted(places)


def test_a4_the_microcontroller_serves_four_calls_and_no_other() -> None:
    """A4 on its side of the wire: what crosses is one of these, of fixed size. The board's router needs the board."""
    source = (CORE / "scanner.cpp").read_text(encoding="utf-8")
    served = dict(re.findall(r'\{"\\x[a-f0-9]{2}(\w+)", \d+, (\w+)\}', source))
    assert served == {
        "paani_guide": "GUIDE_BYTES",
        "paani_thrust": "THRUST_BYTES",
        "paani_esc": "ESC_BYTES",
        "paani_status": "0",
    }
    sketch = SKETCH.read_text(encoding="utf-8")
    provided = re.findall(r'Bridge\.(\w+)\("(\w+)"', sketch)
    assert sorted(provided) == sorted([("notify", "paani_mcu"), *(("provide_safe", name) for name in served)])


def test_w9_an_open_stop_loop_is_what_the_sketch_reads_as_a_stop() -> None:
    """W9 as far as its text says it: pulled up, so that a button that opens the loop or a broken wire reads high."""
    sketch = SKETCH.read_text(encoding="utf-8")
    assert re.findall(r"pinMode\(STOP_LOOP_PIN, (\w+)\);", sketch) == ["INPUT_PULLUP"]
    assert re.findall(r"inputs\.estop = (.*);", sketch) == ["digitalRead(STOP_LOOP_PIN) == HIGH"]


@pytest.mark.slow
def test_static_analysis_finds_nothing() -> None:
    if not shutil.which("cppcheck"):
        pytest.skip("needs cppcheck")
    command = ["cppcheck", "--quiet", "--std=c++17", "--language=c++", "--error-exitcode=1", "--inline-suppr"]
    command += ["--enable=warning,performance,portability", f"-I{CORE}"]
    command += ["--suppress=comparePointers"]  # the startup compares borders that the linker script names
    command += ["--suppress=passedByValue:*sketch.ino"]  # the bridge's library makes what it hands in from these types
    folders = [CORE, ROOT / "mcu/qemu", ROOT / "mcu/native"]
    checked = subprocess.run([*command, *folders], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
