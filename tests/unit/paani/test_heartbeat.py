"""Heartbeats: a file whose age tells, and systemd's datagrams."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from paani.heartbeat import FOLDER, Heartbeat


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
    os.utime(path, (1.0, 1.0))
    heartbeat.beat()
    assert path.stat().st_mtime > 1e9


def test_a_supervisor_that_is_gone_and_a_disk_that_is_full_stop_no_boat(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FOLDER).write_text("in the way")
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    heartbeat = Heartbeat(tmp_path, "advisor")
    heartbeat.ready()
    heartbeat.beat()
