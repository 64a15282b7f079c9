"""What is at the far end of a line: a stand-in for the microcontroller, and for what speaks something else."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

from paani.clock import stopwatch_ms
from paani.messages import Direction, McuState, McuVerdict
from paani.microcontroller.payloads import INDICATION, Guide, McuStatus
from paani.microcontroller.rpc import (
    MessageScanner,
    Notification,
    Request,
    Response,
    encode_notification,
    encode_request,
    encode_response,
)


class McuPeer:
    """Accepts every guidance, unless told otherwise, and keeps what it was sent."""

    def __init__(self) -> None:
        self.calls: list[Request | Notification] = []
        self.responses: list[Response] = []
        self.guides: list[Guide] = []
        self.received = bytearray()
        self.boot_count = 1
        self.verdict = McuVerdict.ACCEPTED
        self.session = 0
        self.answers: Callable[[Request], bytes] = self.answer
        self.delay_s = 0.0
        self.writer: asyncio.StreamWriter | None = None  # of the connection to the router
        self.started_ms = stopwatch_ms()
        self._scanner = MessageScanner()

    @property
    def mcu_ms(self) -> int:
        return round(stopwatch_ms() - self.started_ms)

    def reset(self) -> None:
        """Start anew, as after the watchdog."""
        self.boot_count += 1
        self.started_ms = stopwatch_ms()
        self.session = 0

    def status(self, **fields: object) -> McuStatus:
        """What it says of itself now."""
        display = self.guides[-1].direction if self.guides and self.session else Direction.STOP
        known: dict[str, object] = {
            "kind": INDICATION,
            "state": McuState.FRESH if self.session else McuState.BOOT,
            "verdict": self.verdict,
            "session": self.session,
            "boot_count": self.boot_count,
            "seq": self.guides[-1].seq if self.guides else 0,
            "mcu_ms": self.mcu_ms,
            "display": display,
            "accepted": len(self.guides) % 65_536,
        }
        return McuStatus(**(known | fields))  # type: ignore[arg-type]  # fields of the test's choice

    def answer(self, request: Request) -> bytes:
        """The answer to a call."""
        if request.method == "paani_guide":
            guide = Guide.decode(request.params[0])
            assert guide is not None, request
            self.guides.append(guide)
            self.session = self.session or guide.session
        return encode_response(request.id, self.status().encode())

    def take(self, data: bytes) -> list[bytes]:
        """What it answers to these bytes."""
        self.received += data
        answers = []
        for message in self._scanner.feed(data):
            match message:
                case Request():
                    self.calls.append(message)
                    answers.append(self.answers(message))
                case Notification():
                    self.calls.append(message)
                case Response():
                    self.responses.append(message)
        return answers

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer on one connection until it ends."""
        self._scanner = MessageScanner()
        try:
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(4096):
                    for answer in self.take(data):
                        await asyncio.sleep(self.delay_s)
                        writer.write(answer)
        finally:
            writer.close()


def boot_messages() -> bytes:
    """What the firmware sends when it starts."""
    return encode_request(1, "$/reset") + encode_request(2, "$/register", "paani_guide")


def notification(status: McuStatus) -> bytes:
    return encode_notification("paani_mcu", status.encode())


class PtyLine:
    """A serial device that a peer sits behind, and that can be pulled out and plugged in again under the same name.

    The name is a link to the pseudo-terminal of the moment, as udev's `/dev/serial/by-id` is.
    """

    def __init__(self, path: str, peer: McuPeer) -> None:
        self.address = f"serial:{path}@115200"
        self._path, self._peer = path, peer
        self._descriptors: tuple[int, ...] = ()

    def plug_in(self) -> None:
        far, near = os.openpty()
        tty.setraw(near)
        os.set_blocking(far, False)
        self._descriptors = (far, near)
        Path(self._path).symlink_to(os.ttyname(near))
        asyncio.get_running_loop().add_reader(far, self._ready, far)

    def send(self, data: bytes) -> None:
        """What is sent into a cable that is not plugged in is lost."""
        if self._descriptors:
            with contextlib.suppress(BlockingIOError):
                os.write(self._descriptors[0], data)

    def pull_out(self) -> None:
        if self._descriptors:
            asyncio.get_running_loop().remove_reader(self._descriptors[0])
            Path(self._path).unlink()
            for descriptor in self._descriptors:
                os.close(descriptor)
            self._descriptors = ()

    def _ready(self, far: int) -> None:
        with contextlib.suppress(OSError):
            for answer in self._peer.take(os.read(far, 4096)):
                os.write(far, answer)


@contextlib.asynccontextmanager
async def tcp_line(peer: McuPeer) -> AsyncIterator[str]:
    """The address of a socket behind which the peer sits."""
    async with served(peer.serve) as port:
        yield f"socket://127.0.0.1:{port}"


@contextlib.asynccontextmanager
async def served(serve: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]) -> AsyncIterator[int]:
    """The port on which each connection is served; they end with it."""
    serving: set[asyncio.Task[None]] = set()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        serving.add(task)
        with contextlib.suppress(asyncio.CancelledError):
            await serve(reader, writer)
        writer.close()

    async with await asyncio.start_server(accept, "127.0.0.1", 0) as server:
        try:
            yield int(server.sockets[0].getsockname()[1])
        finally:
            for task in serving:
                task.cancel()


async def until(condition: Callable[[], bool], seconds: float = 15.0) -> None:
    """Wait until the condition holds; TimeoutError after so many seconds."""
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def run_sketch(router: Path, peer: McuPeer) -> None:
    """Be the sketch behind the router: register, answer, and begin again when the router restarts."""
    while True:
        with contextlib.suppress(OSError):
            reader, writer = await asyncio.open_unix_connection(router)
            writer.write(boot_messages())
            peer.writer = writer
            await peer.serve(reader, writer)
        await asyncio.sleep(0.05)
