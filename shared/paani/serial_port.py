"""Ports that bytes come from: serial devices and TCP sockets, under one interface. The one importer of pyserial.

    serial:/dev/ttyACM0@115200    a serial device and its baud rate (default 115200), opened by pyserial
    socket://127.0.0.1:5000       a TCP connection, such as an emulator's serial line

The event loop reads a device as soon as it has bytes, so that neither a thread nor a fixed block size delays them.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
from typing import cast

import serial

from paani.port_address import parse_address

MAX_WAITING_BYTES = 65_536  # over five seconds at 115200 baud: older bytes are of no use to anybody
READ_BYTES = 4096  # the kernel's buffer of a serial device
__all__ = [
    "CONNECT_TIMEOUT_S",
    "Port",
    "PortError",
    "SerialPort",
    "StreamPort",
    "describe",
    "open_port",
    "parse_address",
]

CONNECT_TIMEOUT_S = 5.0
WRITE_TIMEOUT_S = 1.0  # a device that takes no byte for so long is as good as gone


class PortError(ConnectionError):
    """The device cannot be opened, or is gone. The text is one line that names it and says why."""


class Port:
    """An open device. One task reads it; several may write. Waiting bytes are bounded: the oldest are dropped."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.dropped_bytes = 0
        self._waiting = bytearray()
        self._arrived = asyncio.Event()
        self._problem = ""
        self._is_paused = False
        self._writing = asyncio.Lock()

    @property
    def is_closed(self) -> bool:
        """Whether the device is gone or closed; bytes that came before can still be read."""
        return bool(self._problem)

    async def read(self) -> bytes:
        """All bytes that have come; waits for one at least. Raises PortError once the device is gone or closed."""
        while not self._waiting:
            if self._problem:
                raise PortError(f"{self.address}: {self._problem}")
            self._arrived.clear()
            await self._arrived.wait()
        data = bytes(self._waiting)
        self._waiting.clear()
        if self._is_paused and not self._problem:
            self._is_paused = False
            self._resume_reading()
        return data

    async def write(self, data: bytes) -> None:
        """Hand over all bytes. Raises PortError when the device is gone, or takes none for `WRITE_TIMEOUT_S`."""
        async with self._writing:
            try:
                async with asyncio.timeout(WRITE_TIMEOUT_S):
                    await self._write(data)
            except TimeoutError:
                self._end("takes no bytes")
            except OSError as error:
                self._end(describe(error))
        if self._problem:
            raise PortError(f"{self.address}: {self._problem}")

    async def close(self) -> None:
        """Let the device go. Who reads gets PortError."""
        self._end("closed")

    async def _write(self, data: bytes) -> None:
        raise NotImplementedError

    def _pause_reading(self) -> None:
        raise NotImplementedError

    def _resume_reading(self) -> None:
        raise NotImplementedError

    def _take(self, data: bytes) -> None:
        """Keep the newest bytes. To bound the CPU, a device that babbles is left alone until these are read."""
        self._waiting += data
        excess = len(self._waiting) - MAX_WAITING_BYTES
        if excess > 0:
            del self._waiting[:excess]
            self.dropped_bytes += excess
            if not self._is_paused:
                self._is_paused = True
                self._pause_reading()
        self._arrived.set()

    def _end(self, problem: str) -> None:
        """Stop using the device; the first reason stays."""
        self._problem = self._problem or problem
        self._arrived.set()


class SerialPort(Port):
    """A serial device, read and written by the event loop."""

    def __init__(self, address: str, device: serial.Serial) -> None:
        super().__init__(address)
        self._device, self._fd = device, int(device.fileno())
        self._loop = asyncio.get_running_loop()
        self._resume_reading()

    async def close(self) -> None:
        await super().close()
        await asyncio.to_thread(self._device.close)

    def _pause_reading(self) -> None:
        self._loop.remove_reader(self._fd)

    def _resume_reading(self) -> None:
        self._loop.add_reader(self._fd, self._read_ready)

    def _read_ready(self) -> None:
        try:
            data = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._end(describe(error))
            return
        if data:
            self._take(data)
        else:  # ready to be read, and nothing there: that is how Linux reports a device that was pulled out
            self._end("vanished")

    async def _write(self, data: bytes) -> None:
        left = memoryview(data)
        while left and not self._problem:
            try:
                left = left[os.write(self._fd, left) :]
            except BlockingIOError:
                await self._wait_writable()

    async def _wait_writable(self) -> None:
        writable = asyncio.Event()
        self._loop.add_writer(self._fd, writable.set)
        try:
            await writable.wait()
        finally:
            self._loop.remove_writer(self._fd)

    def _end(self, problem: str) -> None:
        if not self._problem:
            self._pause_reading()
        super()._end(problem)


class StreamPort(Port, asyncio.Protocol):
    """A stream socket of the event loop."""

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self._transport: asyncio.Transport
        self._writable = asyncio.Event()
        self._writable.set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)
        self._acknowledge()

    def data_received(self, data: bytes) -> None:
        self._acknowledge()
        self._take(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._end(describe(exc) if isinstance(exc, OSError) else "closed by the other side")
        self._writable.set()

    def pause_writing(self) -> None:
        self._writable.clear()

    def resume_writing(self) -> None:
        self._writable.set()

    async def close(self) -> None:
        await super().close()
        self._transport.abort()

    async def _write(self, data: bytes) -> None:
        await self._writable.wait()
        if not self._problem:
            self._transport.write(data)

    def _acknowledge(self) -> None:
        """Acknowledge what came at once, since a peer that sends byte by byte waits for it: 40 ms by default."""
        stream = self._transport.get_extra_info("socket")
        if stream is not None and stream.family != socket.AF_UNIX and hasattr(socket, "TCP_QUICKACK"):
            with contextlib.suppress(OSError):
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)

    def _pause_reading(self) -> None:
        self._transport.pause_reading()

    def _resume_reading(self) -> None:
        self._transport.resume_reading()


async def open_port(address: str) -> Port:
    """Open the device. Raises ValueError for what is no address, PortError for a device that is not to be had."""
    device, baud = parse_address(address)
    if baud:
        return SerialPort(address, await _open_serial(address, device, baud))
    host, _, port = device.rpartition(":")
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            _, stream = await loop.create_connection(lambda: StreamPort(address), host, int(port))
    except TimeoutError as error:
        raise PortError(f"{address}: no answer") from error
    except (OSError, UnicodeError) as error:
        raise PortError(f"{address}: {describe(error)}") from error
    return stream


async def _open_serial(address: str, device: str, baud: int) -> serial.Serial:
    """Open in a thread, since a driver may take its time. Cancelled meanwhile, the device is closed again."""
    opening = asyncio.ensure_future(asyncio.to_thread(serial.Serial, device, baud, timeout=0, exclusive=True))
    try:
        return await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close_unused)
        raise
    except (OSError, ValueError) as error:  # pyserial's own errors are OSErrors
        raise PortError(f"{address}: {describe(error)}") from error


def _close_unused(opening: asyncio.Future[serial.Serial]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()


def describe(error: Exception) -> str:
    """The cause of a failure in words; pyserial's texts repeat the path and Python's notation of the error."""
    if isinstance(error, socket.gaierror | UnicodeError):
        return "no such host"
    match getattr(error, "errno", None):
        case None:
            return "is no serial device" if isinstance(error, serial.SerialException) else str(error)
        case errno.EAGAIN:
            return "in use by another process"
        case errno.EACCES:
            return "permission denied (is this user in the group of the device, usually dialout?)"
        case errno.EIO | errno.ENXIO | errno.ENODEV:
            return "vanished"
        case number:
            return os.strerror(number)
