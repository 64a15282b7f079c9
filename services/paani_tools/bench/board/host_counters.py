"""What Linux counts of a whole machine and of one control group: CPU, memory, heat, faults, kills, throttling.

Formats: proc(5), and the kernel's documents of cgroup v1 (memory, cpu) and v2. `root` stands for `/`, so that a copy
of another machine's files can be read.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import msgspec

MIB = 2**20
IDLE_COLUMNS = (3, 4)  # of the line `cpu`: idle, and idle while a disk works
COUNTED_COLUMNS = 7  # user to softirq: what a hypervisor took (steal) is nobody's here, guests are counted in user


class HostSample(msgspec.Struct, frozen=True, kw_only=True):
    """Counters at one moment; None for what this machine does not tell (`HostCounters.absent` says why)."""

    busy_ticks: int
    total_ticks: int
    memory_mib: float | None
    temperature_c: dict[str, float]
    oom_kills: int | None
    throttled_periods: int | None
    major_faults: int | None


class HostCounters:
    """Finds the files once. `absent`: what cannot be read here, by name, and the reason."""

    def __init__(self, root: Path = Path("/"), pid: str = "self") -> None:
        """pid: the process whose control group is read. It may end; its group is remembered."""
        self._proc = root / "proc"
        self.absent: dict[str, str] = {}
        groups = _control_groups(root, pid)
        self._memory = self._find(
            "memory", groups, (("memory", "memory.usage_in_bytes"), ("", "memory.current")), "no memory control group"
        )
        self._oom = self._find(
            "oom_kills", groups, (("memory", "memory.oom_control"), ("", "memory.events")), "no memory control group"
        )
        self._cpu = self._find("throttling", groups, (("cpu", "cpu.stat"), ("", "cpu.stat")), "no CPU control group")
        if self._cpu is not None and _keyed_count(self._cpu, "nr_throttled") is None:
            self.absent["throttling"] = f"{self._cpu} counts no throttling"
        if self._oom is not None and _keyed_count(self._oom, "oom_kill") is None:
            self.absent["oom_kills"] = f"{self._oom} counts no kills"
        zones = sorted((root / "sys/class/thermal").glob("thermal_zone*"))
        self._zones = {_zone_name(zone, zones): zone / "temp" for zone in zones}
        if not self.read().temperature_c:
            self.absent["temperature"] = "no thermal zone of this machine can be read"

    @property
    def memory_group(self) -> str:
        """The file that the memory is read from; "" where there is none."""
        return "" if self._memory is None else str(self._memory)

    def read(self) -> HostSample:
        """The counters now. Raises OSError where `/proc/stat` cannot be read."""
        ticks = _cpu_ticks(self._proc / "stat")
        memory = None if self._memory is None else _number(self._memory)
        return HostSample(
            busy_ticks=sum(ticks) - sum(ticks[column] for column in IDLE_COLUMNS),
            total_ticks=sum(ticks),
            memory_mib=None if memory is None else memory / MIB,
            temperature_c={
                name: value / 1000 for name, file in self._zones.items() if (value := _number(file)) is not None
            },
            oom_kills=None if self._oom is None else _keyed_count(self._oom, "oom_kill"),
            throttled_periods=None if self._cpu is None else _keyed_count(self._cpu, "nr_throttled"),
            major_faults=_keyed_count(self._proc / "vmstat", "pgmajfault"),
        )

    def _find(
        self, name: str, groups: dict[str, Path], candidates: tuple[tuple[str, str], ...], missing: str
    ) -> Path | None:
        """The first file there is, of (controller, file) pairs; the controller of cgroup v2 is ""."""
        for controller, file in candidates:
            if controller in groups and (groups[controller] / file).is_file():
                return groups[controller] / file
        self.absent[name] = missing + (f" in {', '.join(str(path) for path in groups.values())}" if groups else "")
        return None


def cpu_percent(before: HostSample, after: HostSample) -> float | None:
    """Whole-machine utilisation between two samples (U6), 100 for every core busy; None where no time has passed."""
    total = after.total_ticks - before.total_ticks
    return 100.0 * (after.busy_ticks - before.busy_ticks) / total if total > 0 else None


def _control_groups(root: Path, pid: str) -> dict[str, Path]:
    """Folder of the process's group by controller, "" for the unified hierarchy of v2."""
    mounts, groups = root / "sys/fs/cgroup", dict[str, Path]()
    with contextlib.suppress(OSError):
        for line in (root / "proc" / pid / "cgroup").read_text(encoding="ascii").splitlines():
            _, controllers, path = line.split(":", 2)
            for controller in controllers.split(","):
                if controller in {"", "memory", "cpu"}:
                    mount = mounts / controller if controller else _unified_mount(mounts)
                    inside = mount / path.lstrip("/")
                    groups[controller] = inside if inside.is_dir() else mount  # a container sees its group as the root
    return groups


def _unified_mount(mounts: Path) -> Path:
    return mounts if (mounts / "cgroup.controllers").is_file() else mounts / "unified"


def _cpu_ticks(file: Path) -> list[int]:
    words = file.read_text(encoding="ascii").partition("\n")[0].split()
    return [int(word) for word in words[1 : 1 + COUNTED_COLUMNS]]


def _zone_name(zone: Path, zones: list[Path]) -> str:
    """The zone's type, with its folder where another zone has the same."""
    types = {each: _text(each / "type") or each.name for each in zones}
    return types[zone] if list(types.values()).count(types[zone]) == 1 else f"{types[zone]} ({zone.name})"


def _text(file: Path) -> str:
    with contextlib.suppress(OSError, UnicodeDecodeError):
        return file.read_text(encoding="utf-8").strip()
    return ""


def _number(file: Path) -> int | None:
    text = _text(file)
    return int(text) if text.lstrip("-").isdecimal() else None


def _keyed_count(file: Path, name: str) -> int | None:
    """The number behind a name in a file of `name number` lines."""
    for line in _text(file).splitlines():
        words = line.split()
        if len(words) == 2 and words[0] == name and words[1].isdecimal():
            return int(words[1])
    return None
