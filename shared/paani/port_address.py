"""Addresses of devices and lines, as settings state them. Nothing is opened here."""

from __future__ import annotations

import contextlib
import ipaddress
import re
from urllib.parse import urlsplit

DEFAULT_BAUD = 115200  # of the microcontroller's serial line, and the usual one of its kind
MIN_BAUD, MAX_BAUD = 300, 4_000_000  # what Linux's serial drivers take
PORT_FORMATS = "serial:/dev/NAME@BAUD or socket://HOST:PORT"
LINE_FORMATS = "serial:/dev/NAME@BAUD, socket://HOST:PORT or unix:/PATH"
UNIX = "unix:"


def parse_address(address: str) -> tuple[str, int]:
    """Path and baud rate of a serial device, or `host:port` and 0. Raises ValueError, in one line."""
    if address.startswith("serial:"):
        match = re.fullmatch(r"serial:(/[^\s@]+)(?:@(\d{1,9}))?", address)
        if match is None:
            raise ValueError(f"'{address}' is no port (expected {PORT_FORMATS})")
        baud = int(match[2] or DEFAULT_BAUD)
        if not MIN_BAUD <= baud <= MAX_BAUD:
            raise ValueError(f"'{address}': a baud rate lies between {MIN_BAUD} and {MAX_BAUD}")
        return match[1], baud
    if address.startswith("socket://"):
        with contextlib.suppress(ValueError):
            parts = urlsplit(address)
            if parts.hostname and parts.port and not (parts.path or parts.query or parts.fragment):
                parts.hostname.encode("idna")
                return f"{parts.hostname}:{parts.port}", 0
    raise ValueError(f"'{address}' is no port (expected {PORT_FORMATS})")


def is_router(address: str) -> bool:
    """Whether the board's router lies between us and the microcontroller."""
    return address.startswith(UNIX)


def require_line(address: str) -> None:
    """Raises ValueError, in one line, for what is no address of a line to the microcontroller."""
    if is_router(address) and not re.fullmatch(r"unix:/[^\0\s]+", address):
        raise ValueError(f"'{address}' is no line (expected {LINE_FORMATS})")
    if not is_router(address):
        try:
            parse_address(address)
        except ValueError as error:
            raise ValueError(str(error).replace(PORT_FORMATS, LINE_FORMATS)) from error


def tcp_address(address: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT`, IPv6 hosts in brackets. Raises ValueError, in one line."""
    with contextlib.suppress(ValueError):
        parts = urlsplit(f"//{address}")
        if parts.hostname and parts.port and address.rpartition(":")[0].strip("[]").lower() == parts.hostname:
            parts.hostname.encode("idna")  # as whoever asks for its address will
            return parts.hostname, parts.port
    raise ValueError(f"'{address}' is no HOST:PORT")


def parse_endpoint(address: str) -> tuple[str, str, int]:
    """Scheme, host without brackets, and port of `tcp/HOST:PORT` or `tls/HOST:PORT`. Raises ValueError, in one line."""
    scheme, _, place = address.partition("/")
    if scheme in {"tcp", "tls"}:
        with contextlib.suppress(ValueError):
            return scheme, *tcp_address(place)
    raise ValueError(f"{address}: expected tcp/HOST:PORT")


def is_loopback(host: str | None) -> bool:
    """Whether only programs of this machine reach a host: `localhost`, or an address of the loopback interface."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host or "").is_loopback
    return (host or "").lower() == "localhost"
