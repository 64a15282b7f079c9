"""Tells whoever supervises this process that it lives: systemd by its socket, a container's health check by a file.

The file holds the machine's uptime at the last beat: a wall clock may be set.
The protocol of systemd's socket is that of sd_notify(3): datagrams of `NAME=VALUE` lines to what NOTIFY_SOCKET names.
"""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

from paani.clock import uptime_s

FOLDER = "heartbeats"


class Heartbeat:
    """`ready` once, then `beat` once a second while the event loop turns. Neither ever fails."""

    def __init__(self, runtime: Path, service: str) -> None:
        self._path = runtime / FOLDER / service
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address

    def ready(self) -> None:
        """The service is ready: what waits for it may start."""
        self._touch()
        self._notify("READY=1")

    def beat(self) -> None:
        """It still is."""
        self._touch()
        self._notify("WATCHDOG=1")

    def _touch(self) -> None:
        with contextlib.suppress(OSError):  # a full disk stops no boat
            self._path.parent.mkdir(mode=0o700, exist_ok=True)
            self._path.touch(mode=0o600)
            self._path.write_text(f"{uptime_s():.0f}\n", encoding="ascii")

    def _notify(self, text: str) -> None:
        if not self._address:
            return
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            line.sendto(text.encode(), self._address)
