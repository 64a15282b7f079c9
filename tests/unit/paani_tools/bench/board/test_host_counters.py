"""The machine's counters, from copies of Linux's files of both kinds of control groups."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from paani_tools.bench.board.host_counters import HostCounters, cpu_percent
from paani_tools.bench.board.machine import identify_machine

STAT = "cpu  {busy} 0 0 {idle} {waiting} 0 0 {stolen} 0 0\ncpu0 1 2 3 4 5 6 7 8 9 10\n"


def stat(busy: int, idle: int, waiting: int = 100, stolen: int = 500) -> str:
    return STAT.format(busy=busy, idle=idle, waiting=waiting, stolen=stolen)


def write(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


V2 = {
    "proc/stat": stat(300, 600),
    "proc/vmstat": "pgfault 5\npgmajfault 7\n",
    "proc/self/cgroup": "0::/boat.slice\n",
    "sys/fs/cgroup/cgroup.controllers": "cpu memory\n",
    "sys/fs/cgroup/boat.slice/memory.current": f"{300 * 2**20}\n",
    "sys/fs/cgroup/boat.slice/memory.events": "low 0\noom 4\noom_kill 3\n",
    "sys/fs/cgroup/boat.slice/cpu.stat": "usage_usec 5\nnr_periods 9\nnr_throttled 2\n",
    "sys/class/thermal/thermal_zone0/type": "cpuss0-thermal\n",
    "sys/class/thermal/thermal_zone0/temp": "45300\n",
    "sys/class/thermal/thermal_zone1/type": "ddr-thermal\n",
    "sys/class/thermal/thermal_zone1/temp": "41000\n",
}
V1 = {
    "proc/stat": stat(300, 600),
    "proc/vmstat": "pgmajfault 7\n",
    "proc/12/cgroup": "8:pids:/\n4:memory:/docker/abc\n1:cpu,cpuacct:/\n0::/\n",
    "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{200 * 2**20}\n",
    "sys/fs/cgroup/memory/memory.oom_control": "oom_kill_disable 0\nunder_oom 0\noom_kill 1\n",
    "sys/fs/cgroup/cpu/cpu.stat": "nr_periods 0\nnr_throttled 6\nthrottled_time 0\n",
}


def test_version_2_groups_and_thermal_zones(tmp_path: Path) -> None:
    counters = HostCounters(write(tmp_path, V2))
    sample = counters.read()
    assert counters.absent == {}
    assert counters.memory_group.endswith("boat.slice/memory.current")
    assert (sample.memory_mib, sample.oom_kills, sample.throttled_periods, sample.major_faults) == (300.0, 3, 2, 7)
    assert sample.temperature_c == {"cpuss0-thermal": 45.3, "ddr-thermal": 41.0}


def test_version_1_groups_of_a_process_in_a_container(tmp_path: Path) -> None:
    """A container sees its own group where the mount begins, whatever path `/proc` names."""
    counters = HostCounters(write(tmp_path, V1), pid="12")
    sample = counters.read()
    assert (sample.memory_mib, sample.oom_kills, sample.throttled_periods) == (200.0, 1, 6)
    assert set(counters.absent) == {"temperature"}
    assert sample.temperature_c == {}


def test_what_a_machine_does_not_tell_is_absent_with_its_reason(tmp_path: Path) -> None:
    counters = HostCounters(write(tmp_path, {"proc/stat": stat(1, 1)}))
    sample = counters.read()
    assert set(counters.absent) == {"memory", "oom_kills", "throttling", "temperature"}
    assert "no memory control group" in counters.absent["memory"]
    assert (sample.memory_mib, sample.oom_kills, sample.throttled_periods, sample.major_faults) == (None,) * 4


def test_u6_load_is_that_of_the_whole_machine(tmp_path: Path) -> None:
    """U6: busy over all ticks; waiting for a disk is idle, and what a hypervisor took is nobody's."""
    before = HostCounters(write(tmp_path, V2)).read()
    (tmp_path / "proc/stat").write_text(stat(300 + 25, 600 + 45, waiting=100 + 30, stolen=500 + 40))
    after = HostCounters(tmp_path).read()
    assert cpu_percent(before, after) == pytest.approx(25.0)
    assert cpu_percent(after, after) is None
    assert cpu_percent(before, replace(after, total_ticks=before.total_ticks + 50)) == pytest.approx(50.0)


def test_u6_memory_is_the_whole_charge_of_the_group(tmp_path: Path) -> None:
    """U6: the kernel's own sum, cache and kernel memory included, and not the anonymous part of `memory.stat`."""
    write(tmp_path, {**V2, "sys/fs/cgroup/boat.slice/memory.stat": "anon 5\nfile 6\nkernel 7\n"})
    counters = HostCounters(tmp_path)
    (tmp_path / "sys/fs/cgroup/boat.slice/memory.current").write_text(str(1_746_614_682))
    assert counters.read().memory_mib == pytest.approx(1665.7, abs=0.05)


def test_the_board_says_what_it_is(tmp_path: Path) -> None:
    files = {
        "proc/device-tree/model": "Arduino UnoQ\0",
        "proc/device-tree/compatible": "arduino,imola\0qcom,qrb2210\0qcom,qcm2290\0",
        "proc/meminfo": "MemTotal:        3774873 kB\nMemFree: 1 kB\n",
    }
    board = identify_machine(write(tmp_path, files))
    assert (board.name, board.is_board, board.memory_mib) == ("Arduino UnoQ", True, 3686)
    (tmp_path / "proc/device-tree/compatible").write_text("arduino,other\0")
    assert not identify_machine(tmp_path).is_board


def test_this_machine_can_be_read() -> None:
    sample = HostCounters().read()
    assert 0 < sample.busy_ticks < sample.total_ticks
    assert identify_machine().memory_mib > 0
