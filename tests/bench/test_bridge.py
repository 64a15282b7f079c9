"""`paani bench bridge` prints what it promises; the figures are for reading."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from paani.errors import UserError
from paani_tools.bench.bridge.measure import measure_image
from tests.firmware.emulator import build_image

pytestmark = [pytest.mark.integration, pytest.mark.timeout(150)]


def run_bench(*words: str, path: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PATH": path} if path is not None else None
    command = [sys.executable, "-m", "paani", "bench", "bridge", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_bench_bridge() -> None:
    image = build_image()
    result = run_bench("--image", str(image), "--count", "3", "--json")
    assert result.returncode == 0, result.stderr
    [part] = json.loads(result.stdout)["parts"]
    figures = {row[0]: dict(zip(part["columns"], row, strict=True)) for row in part["rows"]}
    for name in ("round trip over pty [ms]", "round trip over tcp [ms]"):
        assert figures[name]["n"] == 3
        assert 0 < figures[name]["median"] < 250
    assert -1 <= figures["STOP after the lease's end, by the microcontroller's clock [ms]"]["most"] <= 100
    assert figures["advisory on the bus to its arrow reported back on the bus [ms]"]["median"] > 0
    assert figures["CPU of the bridge [% of a core]"]["median"] > 0
    assert figures["memory of the bridge [MiB]"]["median"] > 10
    text, data, bss = measure_image(image)
    assert [figures[f"firmware, {name} [bytes]"]["median"] for name in ("text", "data", "bss")] == [text, data, bss]
    size = subprocess.run(["arm-none-eabi-size", image], capture_output=True, text=True, check=True).stdout
    assert size.splitlines()[1].split()[:3] == [str(text), str(data), str(bss)]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--image", "/nowhere/paani.elf"], "--image /nowhere/paani.elf: no such file (make -C mcu/qemu builds it"),
        (["--count", "1"], "is not from 2 to 100000"),
    ],
)
def test_what_is_missing_is_named_in_one_line(words: list[str], complaint: str, tmp_path: Path) -> None:
    qemu = tmp_path / "qemu-system-arm"
    qemu.write_text("#!/bin/sh\n")
    qemu.chmod(0o755)
    result = run_bench(*words, path=f"{tmp_path}:{os.environ['PATH']}")
    assert result.returncode == 2
    assert complaint in result.stderr.splitlines()[-1]


def test_an_emulator_that_is_not_installed_is_named_with_its_package(tmp_path: Path) -> None:
    result = run_bench(path=str(tmp_path))
    assert result.returncode == 2
    assert result.stderr.splitlines() == [
        "paani: qemu-system-arm: not installed (Debian and Ubuntu: apt install qemu-system-arm)"
    ]


@pytest.mark.parametrize("data", [b"", b"\x7fELF\x02\x01" + bytes(100), struct.pack("<6s", b"MZ")])
def test_what_is_no_image_is_refused(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "image").write_bytes(data)
    with pytest.raises(UserError, match="is no 32-bit ELF file"):
        measure_image(tmp_path / "image")
