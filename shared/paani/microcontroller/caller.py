"""Calls to the microcontroller over one line: one at a time, timed, with a line that is opened again by itself."""

from __future__ import annotations

import asyncio
import collections
import contextlib
import logging
from collections.abc import Callable

from paani.clock import stopwatch_ms
from paani.messages import McuVerdict
from paani.microcontroller.line import open_line
from paani.microcontroller.numbering import is_out_of_order
from paani.microcontroller.payloads import VERSION, McuStatus, version_of
from paani.microcontroller.rpc import (
    MessageScanner,
    Notification,
    Request,
    Response,
    RpcMessage,
    encode_request,
    encode_response,
)
from paani.port_address import is_router
from paani.serial_port import Port, PortError
from paani.statistics.order_statistics import nearest_rank

LOG = logging.getLogger(__name__)
ANSWER_TIMEOUT_S = 0.25  # the board's router answers within 5 ms, a serial line at 115200 baud within 10
FIRST_RETRY_S, LAST_RETRY_S = 0.25, 2.0  # between attempts to open the line
SILENT_CALLS = 4  # unanswered in a row, the microcontroller counts as silent: one second
ROUND_TRIPS = 200  # kept for the percentiles: 20 s at 10 Hz
BABBLE_BYTES, BABBLE_PAUSE_S = 4096, 0.05  # at 115200 baud no more than 600 bytes come between two calls
ROUTE = "paani_mcu"  # where the microcontroller reports its changes of state
NO_ROUTE = 2  # error code of the board's router


class CallError(Exception):
    """A call without a usable answer; the text is the cause."""


class McuCaller:
    """One line to the microcontroller. `run` keeps it open; `call` may be used at any time.

    `status` is the newest that the microcontroller said of the line of this kind, `status_ms` when (`stopwatch_ms`).
    """

    def __init__(self, address: str, kind: int) -> None:
        self.address, self._kind = address, kind
        self.status: McuStatus | None = None
        self.status_ms = 0.0
        self.connections = self.sent = self.answered = self.unanswered = self.late = 0
        self.on_status: Callable[[McuStatus], None] = lambda status: None
        self._port: Port | None = None
        self._port_problem = "not opened yet"
        self._answer_problem = ""
        self._silent_calls = 0
        self._junk_at_message = 0
        self._scanner = MessageScanner()
        self._junk_bytes = 0
        self._call_id = 0
        self._outstanding: asyncio.Future[Response] | None = None
        self._calling = asyncio.Lock()
        self._round_trips_ms: collections.deque[float] = collections.deque(maxlen=ROUND_TRIPS)

    @property
    def is_connected(self) -> bool:
        """Whether the line is open; the microcontroller at its end may be silent all the same."""
        return self._port is not None

    @property
    def problem(self) -> str:
        """Why no guidance is accepted, in one line that names the device; empty while it is."""
        if self._port is None:
            return self._port_problem
        if self._silent_calls >= SILENT_CALLS:
            is_babbling = self._scanner.junk_bytes > self._junk_at_message
            fault = "speaks another protocol" if is_babbling else "no answer from the microcontroller"
            return f"{self.address}: {fault}"
        return f"{self.address}: {self._answer_problem}" if self._answer_problem else ""

    @property
    def junk_bytes(self) -> int:
        """Received since the start, and part of no message."""
        return self._junk_bytes + self._scanner.junk_bytes

    def round_trip_ms(self, percent: float) -> float:
        """This percentile of the newest round trips; 0 before the first."""
        return nearest_rank(self._round_trips_ms, percent) if self._round_trips_ms else 0.0

    async def run(self) -> None:
        """Keep the line open until cancelled. Raises ValueError at once for what is no address."""
        retry_s = FIRST_RETRY_S
        while True:
            answered = self.answered
            try:
                port = await open_line(self.address)
            except PortError as error:
                self._lose(str(error))
            else:
                await self._use(port)
                if self.answered > answered:
                    retry_s = FIRST_RETRY_S
            await asyncio.sleep(retry_s)
            retry_s = min(2.0 * retry_s, LAST_RETRY_S)

    async def call(self, method: str, payload: bytes | None = None) -> McuStatus:
        """The microcontroller's status in answer to a call. Raises CallError after `ANSWER_TIMEOUT_S` at the latest."""
        async with self._calling:
            port = self._port
            if port is None:
                raise CallError(self._port_problem)
            try:
                response = await self._exchange(port, method, payload)
            except TimeoutError:
                self.unanswered += 1
                self._silent_calls += 1
                raise CallError("no answer") from None
            return self._judge(response)

    async def _exchange(self, port: Port, method: str, payload: bytes | None) -> Response:
        """Send one request, and wait for its answer. Raises TimeoutError, and CallError for a line that breaks."""
        self._call_id = self._call_id % 0xFFFF_FFFF + 1
        outstanding: asyncio.Future[Response] = asyncio.get_running_loop().create_future()
        self._outstanding = outstanding
        params = () if payload is None else (payload,)
        started_ms = stopwatch_ms()
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_S):
                await port.write(encode_request(self._call_id, method, *params))
                self.sent += 1
                response = await outstanding
        except PortError as error:
            raise CallError(str(error)) from error
        finally:
            self._outstanding = None
        self._round_trips_ms.append(stopwatch_ms() - started_ms)
        self.answered += 1
        self._silent_calls = 0
        return response

    def _judge(self, response: Response) -> McuStatus:
        """The status in an answer. Raises CallError for what is none."""
        if response.error:
            self._answer_problem = (
                "the router has no route to the microcontroller"
                if response.error_code == NO_ROUTE
                else f"error {response.error_code}: {response.error}"
            )
            raise CallError(self._answer_problem)
        status = McuStatus.decode(response.result) if isinstance(response.result, bytes) else None
        if status is None or status.kind != self._kind:
            self._answer_problem = _mismatch(response.result, status)
            raise CallError(self._answer_problem)
        self._take_status(status)
        self._answer_problem = ""
        if status.verdict is McuVerdict.FOREIGN_SESSION:
            self._answer_problem = f"second session refused: session {status.session} holds the microcontroller"
        elif status.verdict not in {McuVerdict.ACCEPTED, McuVerdict.NONE}:
            self._answer_problem = f"refused: {status.verdict}"
        return status

    async def _use(self, port: Port) -> None:
        """Listen until the line breaks."""
        self._port, self._scanner = port, MessageScanner()
        self._silent_calls, self._junk_at_message, self._answer_problem = 0, 0, ""
        self.connections += 1
        LOG.info("%s: open", self.address)
        try:
            if is_router(self.address):
                await port.write(encode_request(0, "$/register", ROUTE))
            while True:
                data = await port.read()
                for message in self._scanner.feed(data):
                    self._junk_at_message = self._scanner.junk_bytes
                    await self._handle(message, port)
                if len(data) >= BABBLE_BYTES:
                    await asyncio.sleep(BABBLE_PAUSE_S)
        except PortError as error:
            self._lose(str(error))
        finally:
            self._port = None
            self._junk_bytes += self._scanner.junk_bytes
            self._scanner = MessageScanner()
            if self._outstanding is not None and not self._outstanding.done():
                self._outstanding.set_exception(PortError(self._port_problem))
            with contextlib.suppress(PortError):
                await port.close()

    async def _handle(self, message: RpcMessage, port: Port) -> None:
        match message:
            case Response(id=call_id) if self._outstanding is not None and call_id == self._call_id:
                if not self._outstanding.done():
                    self._outstanding.set_result(message)
            case Response(id=call_id):
                self.late += call_id > 0  # 0 is the answer to `$/register`
            case Request(id=call_id, method="$/reset" | "$/register"):
                await port.write(encode_response(call_id, True))
            case Notification(method="paani_mcu", params=(bytes() as payload,)):
                status = McuStatus.decode(payload)
                if status is not None and status.kind == self._kind:
                    self._take_status(status)
            case _:
                pass

    def _take_status(self, status: McuStatus) -> None:
        """Keep the newest: the router delivers notifications out of order."""
        if self.status is not None and is_out_of_order(self.status, status):
            return
        self.status, self.status_ms = status, stopwatch_ms()
        self.on_status(status)

    def _lose(self, problem: str) -> None:
        if problem != self._port_problem:
            LOG.warning("%s", problem)
        self._port_problem = problem


def _mismatch(result: object, status: McuStatus | None) -> str:
    if status is not None:
        return "the microcontroller's line is of another kind (indication and thrust exchanged?)"
    if isinstance(result, bytes) and result and version_of(result) != VERSION:
        return f"speaks version {version_of(result)} of the protocol, expected {VERSION}"
    return "speaks another protocol"
