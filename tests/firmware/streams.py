"""Raw bytes on a line: what a faulty or hostile peer sends."""

from __future__ import annotations

import asyncio
import contextlib
import random

from paani.microcontroller.line import open_line
from paani.microcontroller.rpc import MessageScanner, Response, encode_request
from paani.serial_port import Port


async def open_stream(address: str) -> Port:
    """The line without anyone who answers or judges. QEMU asks once a second whether its pseudo-terminal is in use."""
    port = await open_line(address)
    call_id = random.getrandbits(31)
    async with asyncio.timeout(10):
        while True:
            await port.write(encode_request(call_id, "paani_status"))
            with contextlib.suppress(TimeoutError):
                await wait_for_answer(port, call_id, 0.2)
                return port


async def wait_for_answer(port: Port, call_id: int, timeout_s: float = 5.0) -> None:
    """Read until this request is answered. Raises TimeoutError."""
    scanner = MessageScanner()
    async with asyncio.timeout(timeout_s):
        while True:
            for message in scanner.feed(await port.read()):
                if isinstance(message, Response) and message.id == call_id:
                    return


def corrupted(frame: bytes, rng: random.Random) -> bytes:
    """The frame with flipped bits, bytes put in or taken out, a burst, or no end; never the whole call.

    A request with another identifier is the same call, and the head of the next one may stand in for an end.
    """
    data = bytearray(frame)
    call = frame[frame.index(b"paani_") - 1 :]
    while call in data + b"\x94\x00":
        at = rng.randrange(len(data))
        match rng.randrange(5):
            case 0:
                for _ in range(rng.randint(1, 6)):
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            case 1:
                data[at:at] = rng.randbytes(rng.randint(1, 3))
            case 2:
                del data[at : at + rng.randint(1, 3)]
            case 3:
                data[at : at + 4] = rng.randbytes(min(4, len(data) - at))
            case _:
                del data[at:]
        if not data:
            data = bytearray(frame)
    return bytes(data)
