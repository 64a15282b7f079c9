"""The emulated link: what it is set to is what packets meet, and nothing is left of it."""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.link.emulator import ADDRESSES, Conditions, Counters, Direction
from tests.link.namespaces import Link, emulated_link, missing
from tests.places import ROOT

PACKET = b"x" * 1000
ECHO = """
import socket, sys
s = socket.socket(2, 2); s.bind((sys.argv[1], 9)); print('up', flush=True)
while True: s.sendto(*s.recvfrom(2048))
"""
# Sends one numbered datagram after the other, and prints the round trip of each that came back [ms].
ASK = """
import socket, sys, time
s = socket.socket(2, 2); s.settimeout(0.3); print('up', flush=True)
for i in range(int(sys.argv[2])):
    t = time.perf_counter(); s.sendto(str(i).encode() + b'.' * 980, (sys.argv[1], 9))
    try:
        while not s.recv(2048).startswith(str(i).encode() + b'.'): pass
        print(1e3 * (time.perf_counter() - t), flush=True)
    except TimeoutError: print('lost', flush=True)
"""


def arrivals(conditions: Conditions, packets: int, seed: int = 1) -> tuple[list[tuple[int, bytes]], Counters]:
    """What comes out, and when [ms], of packets sent one a millisecond."""
    direction, counters = Direction(seed), Counters()
    for index in range(packets):
        direction.send(index.to_bytes(2) + PACKET, conditions, counters, float(index))
    found = [(at, packet) for at in range(packets * 20) for packet in direction.take_due(float(at))]
    return found, counters


def test_delay_and_jitter_keep_the_order() -> None:
    found, _ = arrivals(Conditions(delay_ms=20.0, jitter_ms=5.0), 200)
    order = [int.from_bytes(packet[:2]) for _, packet in found]
    assert order == list(range(200))
    waits = [at - index for at, index in zip((at for at, _ in found), order, strict=True)]
    assert 15.0 <= min(waits) < 20.0 < max(waits) <= 26.0


def test_the_same_seed_loses_the_same_packets() -> None:
    conditions = Conditions(loss=0.1)
    first, again, other = (arrivals(conditions, 500, seed)[0] for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert 400 < len(first) < 480


def test_rate_and_queue_bound_what_passes() -> None:
    """A thousand bytes a millisecond come to a line of half of that: it is always busy, and the queue overflows."""
    found, counters = arrivals(Conditions(rate_bps=4e6, queue_bytes=10_000), 200)
    passed = len(found) * len(PACKET)
    assert counters.overflowed == 200 - len(found)
    assert counters.overflowed > 80
    assert passed <= 200 * 500 + 12_000
    assert max(at - int.from_bytes(packet[:2]) for at, packet in found) <= 10_000 / 500 + 5


def test_a_cut_drops_what_comes_and_what_is_under_way() -> None:
    direction, counters = Direction(1), Counters()
    direction.send(PACKET, Conditions(delay_ms=50.0), counters, 0.0)
    assert direction.drop_all() == 1
    direction.send(PACKET, Conditions(cut=True), counters, 1.0)
    assert (list(direction.take_due(1e6)), counters.cut) == ([], 1)


@pytest.fixture
def link() -> Iterator[Link]:
    if reason := missing():
        pytest.skip(reason)
    with emulated_link() as made:
        yield made


def round_trips(link: Link, count: int) -> list[str]:
    asked = link.start("host", "-c", ASK, ADDRESSES["board"], str(count), stdout=subprocess.PIPE)
    return asked.communicate(timeout=30)[0].split()[1:]


def test_packets_cross_as_the_link_is_set(link: Link) -> None:
    echo = link.start("board", "-c", ECHO, ADDRESSES["board"], stdout=subprocess.PIPE)
    assert echo.stdout is not None
    assert echo.stdout.readline() == "up\n"
    link.set(delay_ms=20.0)
    assert statistics.median(map(float, round_trips(link, 20))) >= 40.0
    link.set(delay_ms=0.0, cut=True)
    assert round_trips(link, 3) == ["lost"] * 3
    link.set(cut=False, loss=1.0)
    assert round_trips(link, 3) == ["lost"] * 3
    link.set(loss=0.0)
    assert "lost" not in round_trips(link, 5)
    counters = link.set()
    assert counters.cut >= 3
    assert counters.lost >= 3
    assert counters.delivered >= 2 * 25
    echo.stdout.close()


@pytest.mark.parametrize("end", ["its input ends", "SIGTERM"])
def test_nothing_is_left_of_it(end: str) -> None:
    if reason := missing():
        pytest.skip(reason)
    prefix = f"twohosts{os.getpid()}"
    command = [sys.executable, "-m", "tests.link.emulator", prefix, "1"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as emulator:
        assert emulator.stdin is not None
        assert emulator.stdout is not None
        assert emulator.stdout.readline() == "ready\n"
        assert f"{prefix}-board" in names()
        if end == "SIGTERM":
            emulator.send_signal(signal.SIGTERM)
        else:
            emulator.stdin.close()
        assert emulator.wait(10) == 0
    assert prefix not in names()


def names() -> str:
    return subprocess.run(["ip", "netns", "list"], capture_output=True, text=True, check=True).stdout
