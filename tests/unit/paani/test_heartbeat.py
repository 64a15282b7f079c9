"""Heartbeats: a file whose age tells, and systemd's datagrams."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

import pytest

from paani.clock import uptime_s
from paani.heartbeat import FOLDER, Heartbeat
from tests.places import ROOT


@pytest.mark.parametrize("is_abstract", [False, True])
def test_systemd_is_told_by_its_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_abstract: bool) -> None:
    address = f"@paani-{os.getpid()}" if is_abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(f"\0{address[1:]}" if is_abstract else address)
        systemd.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        heartbeat = Heartbeat(tmp_path, "advisor")
        for act, text in ((heartbeat.ready, b"READY=1"), (heartbeat.beat, b"WATCHDOG=1")):
            act()
            assert systemd.recv(100) == text


def test_the_file_is_young_while_the_process_lives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    heartbeat, path = Heartbeat(tmp_path, "advisor"), tmp_path / FOLDER / "advisor"
    heartbeat.ready()
    path.write_text("1\n")
    heartbeat.beat()
    assert abs(int(path.read_text()) - uptime_s()) <= 2.0


@pytest.mark.parametrize(("age_s", "is_well"), [(0, True), (3, True), (7, False), (10, False), (None, False)])
def test_a_container_is_well_while_its_beat_is_young_whatever_the_wall_clock_says(
    tmp_path: Path, age_s: int | None, is_well: bool
) -> None:
    beat = tmp_path / "advisor"
    beat.write_text("" if age_s is None else f"{uptime_s() - age_s:.0f}\n")
    os.utime(beat, (1.0, 1.0))
    done = subprocess.run(
        ["sh", ROOT / "deploy/beats.sh", "advisor"], env={"HEARTBEATS": str(tmp_path), "PATH": os.defpath}, check=False
    )
    assert (done.returncode == 0) is is_well


def test_a_supervisor_that_is_gone_and_a_disk_that_is_full_stop_no_boat(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FOLDER).write_text("in the way")
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    heartbeat = Heartbeat(tmp_path, "advisor")
    heartbeat.ready()
    heartbeat.beat()
