"""What a running system shows to others: listening sockets, command lines, logs and file modes."""

from __future__ import annotations

import contextlib
import ipaddress
import stat
import struct
from pathlib import Path

LISTENING = "0A"


def listening(pid: int) -> set[tuple[str, int]]:
    """Address and port of each TCP socket that the process listens at, and of each UDP socket that it has bound."""
    inodes, found = sockets_of(pid), set()
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            words = line.split()
            is_open = words[3] == LISTENING if table.startswith("tcp") else words[2].endswith(":0000")
            if words[9] in inodes and is_open:
                found.add(_address(words[1]))
    return found


def sockets_of(pid: int) -> set[str]:
    """Inodes of the sockets that the process has."""
    inodes = set()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            target = str(descriptor.readlink())
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    return inodes


def readable_by_others(folder: Path) -> set[Path]:
    """Files and folders here that not only their owner may open; what lies in a closed folder is closed."""
    if not stat.S_IMODE(folder.stat().st_mode) & 0o077:
        return set()
    return {folder} | {path for path in folder.rglob("*") if stat.S_IMODE(path.lstat().st_mode) & 0o077}


def places_of(secret: str, pids: list[int], logs: Path) -> set[str]:
    """Command lines and log files that hold the secret."""
    lines = [Path(f"/proc/{pid}/cmdline") for pid in pids]
    return {str(path) for path in (*lines, *logs.glob("*")) if secret.encode() in path.read_bytes()}


def _address(text: str) -> tuple[str, int]:
    """Of `/proc/net`: 32-bit words of this machine's byte order in hexadecimal, and a port."""
    host, _, port = text.partition(":")
    words = [int(host[at : at + 8], 16) for at in range(0, len(host), 8)]
    return str(ipaddress.ip_address(b"".join(struct.pack("=I", word) for word in words))), int(port, 16)
