"""A device is a pseudo-terminal or a socket here; what is beyond it belongs to the test."""

from __future__ import annotations

import asyncio
import os
import socket
import threading
from collections.abc import AsyncIterator, Iterator

import pytest

from paani import serial_port
from paani.clock import process_cpu_s, stopwatch_ms
from paani.serial_port import MAX_WAITING_BYTES, Port, PortError, open_port


class Device:
    """The far end of a pseudo-terminal, whose near end PAANI opens by name."""

    def __init__(self) -> None:
        self._far, self._near = os.openpty()
        self.address = f"serial:{os.ttyname(self._near)}@115200"
        self._is_open = True

    def send(self, data: bytes) -> None:
        assert os.write(self._far, data) == len(data)

    def babble(self, size: int) -> threading.Thread:
        """Send so many bytes as fast as they are taken."""
        thread = threading.Thread(target=os.write, args=(self._far, bytes(size)), daemon=True)
        thread.start()
        return thread

    def receive(self) -> bytes:
        return os.read(self._far, 4096)

    def unplug(self) -> None:
        if self._is_open:
            self._is_open = False
            os.close(self._near)
            os.close(self._far)


@pytest.fixture
def device() -> Iterator[Device]:
    device = Device()
    yield device
    device.unplug()


@pytest.fixture
async def port(device: Device) -> AsyncIterator[Port]:
    port = await open_port(device.address)
    yield port
    await port.close()


async def test_every_byte_passes_both_ways_unchanged(device: Device, port: Port) -> None:
    """A terminal would turn \\r into \\n, echo, and take 3 as an interrupt."""
    data = bytes(range(256))
    device.send(data)
    received = b""
    while len(received) < len(data):
        received += await port.read()
    assert received == data
    await port.write(data)
    assert device.receive() == data


async def test_bytes_arrive_as_soon_as_they_are_there(device: Device, port: Port) -> None:
    delays_ms = []
    for _ in range(50):
        started_ms = stopwatch_ms()
        device.send(b"x")
        assert await port.read() == b"x"
        delays_ms.append(stopwatch_ms() - started_ms)
    assert sorted(delays_ms)[25] < 10.0


@pytest.mark.slow
async def test_waiting_for_bytes_costs_no_cpu(port: Port) -> None:
    before_s = process_cpu_s()
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.5):
            await port.read()
    assert process_cpu_s() - before_s < 0.1


@pytest.mark.slow
async def test_a_device_pulled_out_ends_reading_and_writing_in_one_line(device: Device, port: Port) -> None:
    device.send(b"last")
    await asyncio.sleep(0.05)
    device.unplug()
    assert await port.read() == b"last"
    with pytest.raises(PortError, match=r"^serial:/dev/pts/\d+@115200: vanished$"):
        await port.read()
    with pytest.raises(PortError, match="vanished"):
        await port.write(b"x")
    before_s = process_cpu_s()
    await asyncio.sleep(0.3)
    assert process_cpu_s() - before_s < 0.1
    assert port.is_closed


async def test_closing_wakes_who_reads_and_lets_the_device_go(device: Device) -> None:
    port = await open_port(device.address)
    reading = asyncio.create_task(port.read())
    await asyncio.sleep(0)
    await port.close()
    with pytest.raises(PortError, match="closed"):
        await reading
    await (await open_port(device.address)).close()


async def test_a_device_has_one_user(device: Device, port: Port) -> None:
    with pytest.raises(PortError, match="in use by another process"):
        await open_port(device.address)


@pytest.mark.slow
async def test_a_babbling_device_fills_a_bounded_queue_and_costs_no_cpu_unless_it_is_read(
    device: Device, port: Port
) -> None:
    sent = device.babble(6 * MAX_WAITING_BYTES)
    while await asyncio.to_thread(sent.is_alive) and not port.dropped_bytes:
        await asyncio.sleep(0.01)
    await asyncio.sleep(0.1)
    before_s = process_cpu_s()
    await asyncio.sleep(0.3)
    assert process_cpu_s() - before_s < 0.1
    assert sent.is_alive(), "all was taken from a device that nobody reads"
    assert len(await port.read()) == MAX_WAITING_BYTES
    received = 0
    while received + MAX_WAITING_BYTES + port.dropped_bytes < 6 * MAX_WAITING_BYTES:
        received += len(await port.read())
    sent.join()
    device.send(b"newest")
    assert (await port.read()).endswith(b"newest")


async def test_of_too_many_waiting_bytes_the_newest_are_kept(port: Port) -> None:
    newest = bytes(range(256)) * (MAX_WAITING_BYTES // 256)
    for data in (b"old", newest[:100], newest[100:]):
        port._take(data)
    assert await port.read() == newest
    assert port.dropped_bytes == 3


@pytest.mark.slow
async def test_a_device_that_takes_no_bytes_is_given_up(
    device: Device, port: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "WRITE_TIMEOUT_S", 0.1)
    with pytest.raises(PortError, match="takes no bytes"):
        await port.write(bytes(1_000_000))


@pytest.mark.parametrize(
    ("address", "problem"),
    [
        ("serial:/dev/paani-none@9600", "No such file or directory"),
        ("serial:/dev/null", "is no serial device"),
        ("socket://127.0.0.1:1", "Connection refused"),
    ],
)
async def test_a_device_that_is_not_to_be_had_is_named_with_the_reason(address: str, problem: str) -> None:
    with pytest.raises(PortError) as caught:
        await open_port(address)
    assert str(caught.value) == f"{address}: {problem}"


async def test_a_socket_is_a_port_too() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = await open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        peer, _ = listener.accept()
        with peer:
            peer.sendall(b"in")
            assert await port.read() == b"in"
            await port.write(b"out")
            assert peer.recv(10) == b"out"
        with pytest.raises(PortError, match="closed by the other side"):
            await port.read()
        with pytest.raises(PortError, match="closed by the other side"):
            await port.write(b"x")
        await port.close()


@pytest.mark.slow
async def test_a_peer_that_sends_byte_by_byte_is_not_kept_waiting() -> None:
    """It sends on when what it sent is acknowledged, which Linux puts off by 40 ms once a connection is interactive."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = await open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        peer, _ = listener.accept()
        with peer:
            durations_ms = []
            for _ in range(30):
                started_ms = stopwatch_ms()
                await port.write(b"?")
                assert peer.recv(10) == b"?"
                for _ in range(3):
                    peer.sendall(b"!")
                received = b""
                while len(received) < 3:
                    received += await port.read()
                durations_ms.append(stopwatch_ms() - started_ms)
                await asyncio.sleep(0.02)
        await port.close()
    assert sorted(durations_ms)[15] < 30.0
