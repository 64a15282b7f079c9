"""Which machine a figure was measured on."""

from __future__ import annotations

import contextlib
import os
import platform
from pathlib import Path

import msgspec

BOARD = "arduino,imola"  # `compatible` in the device tree of an Arduino UNO Q
KIB_PER_MIB = 1024


class MachineIdentity(msgspec.Struct, frozen=True, kw_only=True):
    """`is_board`: it says of itself that it is an Arduino UNO Q. Loads are one-minute averages of runnable tasks."""

    name: str
    is_board: bool
    cores: int
    memory_mib: int
    kernel: str
    load_before: float
    load_after: float = 0.0


def identify_machine(root: Path = Path("/")) -> MachineIdentity:
    """This machine as its kernel describes it."""
    tree = root / "proc/device-tree"
    compatible = _text(tree / "compatible").split("\0")
    model = _text(tree / "model").strip("\0") or _value_of(root / "proc/cpuinfo", "model name") or platform.machine()
    total_kib = _value_of(root / "proc/meminfo", "MemTotal").removesuffix(" kB")
    return MachineIdentity(
        name=model,
        is_board=BOARD in compatible,
        cores=os.cpu_count() or 1,
        memory_mib=int(total_kib) // KIB_PER_MIB if total_kib.isdecimal() else 0,
        kernel=f"{platform.system()} {platform.release()} {platform.machine()}",
        load_before=round(os.getloadavg()[0], 2),
    )


def machine_text(machine: MachineIdentity) -> str:
    """One line that names it."""
    return (
        f"{machine.name}, {machine.cores} cores, {machine.memory_mib} MiB, {machine.kernel}; "
        f"load {machine.load_before:.2f} before and {machine.load_after:.2f} after"
    )


def _text(file: Path) -> str:
    with contextlib.suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace")
    return ""


def _value_of(file: Path, name: str) -> str:
    """The value of the first `name : value` line."""
    for line in _text(file).splitlines():
        key, _, value = line.partition(":")
        if key.strip() == name:
            return value.strip()
    return ""
