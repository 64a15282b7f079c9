"""Board and host as two network namespaces, and the emulated link between them."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import msgspec

from tests.link.emulator import ADDRESSES, Counters
from tests.places import ROOT

STOP_S = 6.0


def missing() -> str:
    """Why there can be no such link on this machine; empty where there can."""
    if os.geteuid() != 0:
        return "needs root, to make network namespaces"
    if not Path("/dev/net/tun").exists():
        return "needs /dev/net/tun"
    if shutil.which("ip") is None:
        return "needs ip (Debian: iproute2)"
    trial = subprocess.run(["unshare", "--net", "true"], capture_output=True, check=False)
    return "" if trial.returncode == 0 else "needs the right to make network namespaces"


class Link:
    """The running emulator. Every process started with `start` ends with the context that made it."""

    def __init__(self, prefix: str, emulator: subprocess.Popen[str]) -> None:
        self._prefix, self._emulator = prefix, emulator
        self._started: list[subprocess.Popen[str]] = []

    def set(self, **conditions: Any) -> Counters:
        """Change fields of `Conditions`; returns the counters so far."""
        assert self._emulator.stdin is not None
        assert self._emulator.stdout is not None
        self._emulator.stdin.write(msgspec.json.encode(conditions).decode() + "\n")
        self._emulator.stdin.flush()
        return msgspec.json.decode(self._emulator.stdout.readline(), type=Counters)

    def start(
        self, side: str, *words: str, env: Mapping[str, str] | None = None, stdout: IO[str] | int | None = None
    ) -> subprocess.Popen[str]:
        """Start `python WORDS` in the namespace of this side; standard error goes where standard output does."""
        process = subprocess.Popen(
            ["ip", "netns", "exec", f"{self._prefix}-{side}", sys.executable, *words],
            cwd=ROOT, env={**os.environ, **(env or {})}, stdin=subprocess.DEVNULL, stdout=stdout,
            stderr=subprocess.STDOUT if stdout is not None else None, text=True,
        )  # fmt: skip
        self._started.append(process)
        return process

    def stop(self, process: subprocess.Popen[str]) -> None:
        """SIGTERM, and SIGKILL for one that does not end."""
        process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(STOP_S)
        process.kill()
        process.wait()

    def stop_all(self) -> None:
        for process in reversed(self._started):
            self.stop(process)


@contextlib.contextmanager
def emulated_link(seed: int = 1) -> Iterator[Link]:
    """A link without faults between two new namespaces; both are gone afterwards, whatever happened."""
    prefix = f"twohosts{uuid.uuid4().hex[:6]}"
    emulator = subprocess.Popen(
        [sys.executable, "-m", "tests.link.emulator", prefix, str(seed)],
        cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert emulator.stdin is not None
    assert emulator.stdout is not None
    link = Link(prefix, emulator)
    try:
        assert emulator.stdout.readline() == "ready\n", "the emulator did not start"
        yield link
    finally:
        link.stop_all()
        emulator.stdin.close()
        emulator.wait(STOP_S)
        emulator.stdout.close()


def address(side: str, port: int) -> str:
    """Zenoh's endpoint of a side."""
    return f"tcp/{ADDRESSES[side]}:{port}"
