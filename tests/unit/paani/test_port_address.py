"""What names a device, and what does not."""

from __future__ import annotations

import pytest

from paani.port_address import is_loopback, parse_address, require_line


@pytest.mark.parametrize(
    ("address", "parsed"),
    [
        ("serial:/dev/ttyACM0@9600", ("/dev/ttyACM0", 9600)),
        ("serial:/dev/serial/by-id/usb-u-blox_AG-if00", ("/dev/serial/by-id/usb-u-blox_AG-if00", 115200)),
        ("socket://127.0.0.1:5000", ("127.0.0.1:5000", 0)),
        ("socket://[::1]:5000", ("::1:5000", 0)),
    ],
)
def test_an_address_names_a_device(address: str, parsed: tuple[str, int]) -> None:
    assert parse_address(address) == parsed


@pytest.mark.parametrize(
    "address",
    [
        "",
        "/dev/ttyACM0",
        "serial:ttyACM0",
        "serial:/dev/ttyACM0@fast",
        "serial:/dev/ttyACM0@12",
        "serial:/dev/ttyACM0@9999999",
        "socket://127.0.0.1",
        "socket://:5000",
        "socket://127.0.0.1:99999",
        "socket://127.0.0.1:5000/x",
        "unix:/run/x.sock",
    ],
)
def test_what_is_no_address_is_refused_in_one_line(address: str) -> None:
    with pytest.raises(ValueError, match=r"^'[^\n]*$"):
        parse_address(address)


@pytest.mark.parametrize("address", ["serial:/dev/ttyACM0", "socket://127.0.0.1:5000", "unix:/run/arduino-router.sock"])
def test_a_line_is_a_port_or_the_boards_router(address: str) -> None:
    require_line(address)


@pytest.mark.parametrize("address", ["unix:router.sock", "unix:", "serial:", "tcp/127.0.0.1:5000"])
def test_what_is_no_line_is_refused_with_all_that_would_be_one(address: str) -> None:
    with pytest.raises(ValueError, match=r"^'[^\n]*unix:/PATH\)$"):
        require_line(address)


@pytest.mark.parametrize(
    ("host", "local"),
    [
        ("127.0.0.1", True),
        ("127.8.9.1", True),
        ("::1", True),
        ("::1%lo", True),
        ("127.8.0.1", True),
        ("localhost", True),
        ("LOCALHOST", True),
        ("boat.local", False),
        ("192.168.1.2", False),
        ("0.0.0.0", False),
        ("fe80::1%lo", False),
        ("127.0.0.1.example", False),
        ("", False),
        (None, False),
        ("::", False),
    ],
)
def test_this_machine_is_its_loopback_interface(host: str | None, local: bool) -> None:
    assert is_loopback(host) is local
