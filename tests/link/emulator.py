"""A link between two network namespaces with delay, jitter, loss, rate, queue and cuts, in user space.

    python -m tests.link.emulator PREFIX SEED

makes the namespaces PREFIX-board and PREFIX-host with one TUN device each (10.77.0.1 and 10.77.0.2), prints `ready`,
and relays packets until standard input ends; then both are gone. A line of JSON on standard input sets fields of
`Conditions`, and is answered by a line with the counters so far. It needs root and /dev/net/tun; no kernel module.
"""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import os
import random
import selectors
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from types import FrameType

import msgspec

from paani.clock import stopwatch_ms

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
SIDES = ("board", "host")
ADDRESSES = {"board": "10.77.0.1", "host": "10.77.0.2"}
PACKET_BYTES = 1500


class Conditions(msgspec.Struct, forbid_unknown_fields=True):
    """What each direction does to a packet. `rate_bps` 0: no limit; `queue_bytes` bounds what waits for the rate."""

    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss: float = 0.0
    rate_bps: float = 0.0
    queue_bytes: int = 64_000
    cut: bool = False


class Counters(msgspec.Struct):
    """Packets and bytes of both directions since the start."""

    delivered: int = 0
    delivered_bytes: int = 0
    lost: int = 0
    overflowed: int = 0
    cut: int = 0


class Direction:
    """Packets on their way to one side, in order. All times in milliseconds of one clock."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._under_way: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._free_ms = self._last_ms = 0.0

    def send(self, packet: bytes, conditions: Conditions, counters: Counters, now_ms: float) -> None:
        """Take one packet: it is lost, or due later."""
        is_lost = self._random.random() < conditions.loss
        jitter_ms = self._random.uniform(-1.0, 1.0) * conditions.jitter_ms
        if conditions.cut:
            counters.cut += 1
            return
        if is_lost:
            counters.lost += 1
            return
        start_ms = max(now_ms, self._free_ms)
        bytes_per_ms = conditions.rate_bps / 8e3
        if bytes_per_ms and (start_ms - now_ms) * bytes_per_ms > conditions.queue_bytes:
            counters.overflowed += 1
            return
        self._free_ms = start_ms + (len(packet) / bytes_per_ms if bytes_per_ms else 0.0)
        self._last_ms = max(self._last_ms, self._free_ms + max(0.0, conditions.delay_ms + jitter_ms))
        self._sent += 1
        heapq.heappush(self._under_way, (self._last_ms, self._sent, packet))

    def take_due(self, now_ms: float) -> Iterator[bytes]:
        """Packets that have arrived by now."""
        while self._under_way and self._under_way[0][0] <= now_ms:
            yield heapq.heappop(self._under_way)[2]

    def due_in_s(self, now_ms: float) -> float | None:
        """Until the next packet arrives; None without any."""
        return max(0.0, self._under_way[0][0] - now_ms) * 1e-3 if self._under_way else None

    def drop_all(self) -> int:
        """What a cut finds under way is gone; returns how many."""
        dropped = len(self._under_way)
        self._under_way.clear()
        self._free_ms = self._last_ms = 0.0
        return dropped


def open_tun(name: str) -> int:
    """A new TUN device; it lives as long as the descriptor."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI))
    return device


def ip(*words: str) -> None:
    """Run `ip`. Raises CalledProcessError."""
    subprocess.run(["ip", *words], check=True, stdout=subprocess.DEVNULL)


@contextlib.contextmanager
def namespaces(prefix: str) -> Iterator[dict[str, int]]:
    """Both namespaces, and the descriptor of the device in each, by side."""
    devices: dict[str, int] = {}
    made: list[str] = []
    try:
        for side in SIDES:
            space, device = f"{prefix}-{side}", f"pl{os.getpid()}{side[0]}"
            ip("netns", "add", space)
            made.append(space)
            devices[side] = open_tun(device)
            ip("link", "set", device, "netns", space)
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "addr", "add", f"{ADDRESSES[side]}/24", "dev", device)
            ip("-n", space, "link", "set", device, "mtu", str(PACKET_BYTES), "up")
        yield devices
    finally:
        for descriptor in devices.values():
            os.close(descriptor)
        for space in made:
            ip("netns", "del", space)


def relay(devices: dict[str, int], seed: int) -> None:
    """Relay until standard input ends."""
    conditions, counters = Conditions(), Counters()
    directions = {side: Direction(seed + index) for index, side in enumerate(SIDES)}
    other = {"board": "host", "host": "board"}
    selector = selectors.DefaultSelector()
    selector.register(sys.stdin.fileno(), selectors.EVENT_READ, "")
    for side, device in devices.items():
        selector.register(device, selectors.EVENT_READ, side)
    pending = b""
    while True:
        now_ms = stopwatch_ms()
        waits = [wait for each in directions.values() if (wait := each.due_in_s(now_ms)) is not None]
        for key, _ in selector.select(min(waits, default=None)):
            if key.data:
                with contextlib.suppress(BlockingIOError):
                    while True:
                        packet = os.read(key.fd, PACKET_BYTES + 64)
                        directions[other[key.data]].send(packet, conditions, counters, stopwatch_ms())
                continue
            read = os.read(key.fd, 4096)
            if not read:
                return
            *lines, pending = (pending + read).split(b"\n")
            for line in lines:
                conditions = msgspec.convert(
                    {**msgspec.to_builtins(conditions), **msgspec.json.decode(line)}, Conditions
                )
                if conditions.cut:
                    counters.cut += sum(each.drop_all() for each in directions.values())
                sys.stdout.write(msgspec.json.encode(counters).decode() + "\n")
                sys.stdout.flush()
        now_ms = stopwatch_ms()
        for side, direction in directions.items():
            for packet in direction.take_due(now_ms):
                with contextlib.suppress(OSError):  # the device is down, or its queue is full: as on a wire
                    os.write(devices[side], packet)
                    counters.delivered += 1
                    counters.delivered_bytes += len(packet)


def _end(number: int, frame: FrameType | None) -> None:
    raise SystemExit(0)


def main(prefix: str, seed: int) -> None:
    """Until standard input ends, or SIGTERM."""
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: whoever started this ends it
    with namespaces(prefix) as devices:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        relay(devices, seed)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
