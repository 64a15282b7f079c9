"""The microcontroller's core on this computer: in process through ctypes, or as a program that plays scripts."""

from __future__ import annotations

import ctypes
import fcntl
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import pytest

from paani.messages import Direction
from paani.microcontroller.payloads import EscSettings, Guide, McuStatus, ThrustCall
from paani.microcontroller.rpc import (
    MessageScanner,
    Notification,
    Response,
    RpcMessage,
    encode_notification,
    encode_request,
)
from tests.places import ROOT

INDICATION_LINE, THRUST_LINE = 0, 1
CLOCK = 1 << 32  # milliseconds until the clock of the microcontroller wraps
BUILD = ROOT / "runs" / "mcu" / "native"
HEADS = {Guide: "paani_guide", ThrustCall: "paani_thrust", EscSettings: "paani_esc"}
METHODS = {Guide: 0, ThrustCall: 1, EscSettings: 2}
NOT_ARMED, ESTOP, RECEIVER, BATTERY, CURRENT = 16, 1, 2, 4, 8  # bits of `holds`
RECEIVERS = {"none": 0, "standby": 1, "takes over": 2}

Payload = Guide | ThrustCall | EscSettings


def build() -> Path:
    """Build both harnesses; skips where there is no compiler. Two tests at once wait for each other."""
    if not (shutil.which("g++") and shutil.which("make")):
        pytest.skip("needs g++ and make")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(["make", "-s", "-C", ROOT / "mcu" / "native", f"OUT={BUILD}"], check=True)
    return BUILD


def guide(seq: int = 1, direction: Direction = Direction.LEFT, session: int = 7, **fields: Any) -> Guide:
    return Guide(direction=direction, session=session, seq=seq, lease_ms=fields.pop("lease_ms", 500), **fields)


def thrust(seq: int, left: float = 1.0, right: float = 1.0, *, armed: bool = True, **fields: int) -> ThrustCall:
    claim = {"session": 9, "lease_ms": 300} | fields
    return ThrustCall(armed=armed, seq=seq, left=left, right=right, **claim)


def request(payload: Payload, call_id: int = 1) -> bytes:
    return encode_request(call_id, HEADS[type(payload)], payload.encode())


def notification(payload: Payload) -> bytes:
    return encode_notification(HEADS[type(payload)], payload.encode())


class Core:
    """The core in this process, one turn of its loop for each millisecond."""

    def __init__(self, now_ms: int = 0, *, paper: bool = False, steps_at_once: bool = True) -> None:
        self._library = ctypes.CDLL(str(build() / "libpaani.so"))
        self._library.paani_new.restype = ctypes.c_void_p
        self._session = ctypes.c_void_p(self._library.paani_new(int(paper), ctypes.c_uint32(now_ms)))
        self._scanners = {INDICATION_LINE: MessageScanner(), THRUST_LINE: MessageScanner()}
        self.now_ms = now_ms
        if steps_at_once:
            self.wait(0)

    def close(self) -> None:
        self._library.paani_delete(self._session)

    def wait(self, duration_ms: int) -> None:
        """Let the loop run for so long; with 0, one turn at the same time."""
        self.now_ms = (self.now_ms + duration_ms) % CLOCK
        self._library.paani_run_until(self._session, ctypes.c_uint32(self.now_ms))

    def stand_still(self, duration_ms: int) -> None:
        """Let time pass in which the loop does not turn."""
        self.now_ms = (self.now_ms + duration_ms) % CLOCK
        self._library.paani_stand_still(self._session, ctypes.c_uint32(duration_ms))

    def receive(self, line: int, data: bytes) -> None:
        self._library.paani_receive(self._session, ctypes.c_uint8(line), data, ctypes.c_uint32(len(data)))

    def take_bytes(self, line: int) -> bytes:
        """What the core has sent on this line since the last call."""
        buffer = ctypes.create_string_buffer(4096)
        size = int(self._library.paani_take(self._session, ctypes.c_uint8(line), buffer, ctypes.c_uint32(len(buffer))))
        return buffer.raw[:size]

    def take(self, line: int) -> list[RpcMessage]:
        """The messages in what it has sent."""
        return self._scanners[line].feed(self.take_bytes(line))

    def junk_bytes(self, line: int) -> int:
        """How much of what it has sent was part of no message."""
        return self._scanners[line].junk_bytes

    def call(self, payload: Payload | bytes, method: type[Payload] | None = None) -> McuStatus:
        """Judge a payload that a router has taken out of its stream."""
        status = ctypes.create_string_buffer(52)
        kind = METHODS[method or type(payload)]  # type: ignore[index]
        data = payload if isinstance(payload, bytes) else payload.encode()
        size = ctypes.c_uint32(len(data))
        self._library.paani_call(self._session, ctypes.c_uint8(kind), data, size, status)
        return _decode(status.raw)

    def status(self, line: int = INDICATION_LINE) -> McuStatus:
        status = ctypes.create_string_buffer(52)
        self._library.paani_status(self._session, ctypes.c_uint8(line), status)
        return _decode(status.raw)

    def lights(self) -> list[str]:
        """The rows of the matrix, a digit for each light."""
        lights = ctypes.create_string_buffer(104)
        self._library.paani_matrix(self._session, lights)
        digits = "".join(str(light) for light in lights.raw)
        return [digits[at : at + 13] for at in range(0, 104, 13)]

    def set_pins(
        self,
        *,
        estop: bool = False,
        receiver: str = "none",
        receiver_us: tuple[int, int] = (0, 0),
        battery_mv: int = 12_000,
        current_ca: int = 0,
    ) -> None:
        fields = (int(estop), RECEIVERS[receiver], *receiver_us, battery_mv, current_ca)
        types = (ctypes.c_int, ctypes.c_uint8, *(ctypes.c_uint16,) * 3, ctypes.c_int16)
        self._library.paani_pins(self._session, *(kind(field) for kind, field in zip(types, fields, strict=True)))

    def disarm(self) -> None:
        """As after the first stage of the watchdog."""
        self._library.paani_disarm(self._session)


def _decode(data: bytes) -> McuStatus:
    status = McuStatus.decode(data)
    assert status is not None, data.hex()
    return status


def statuses(messages: list[RpcMessage]) -> list[McuStatus]:
    """The statuses in what the core sent: in its answers and in its notifications."""
    found = []
    for message in messages:
        match message:
            case Response(result=bytes(data)) | Notification("paani_mcu", (bytes(data),)):
                found.append(_decode(data))
    return found


class Script:
    """What the core lives through, for the program that AddressSanitizer watches."""

    def __init__(self) -> None:
        self._records = bytearray()
        self._now_ms = 0

    def _add(self, kind: bytes, data: bytes) -> None:
        self._records += kind + struct.pack("<H", len(data)) + data

    def receive(self, line: int, data: bytes) -> None:
        for at in range(0, len(data), 60_000):
            self._add(b"01"[line : line + 1], data[at : at + 60_000])

    def wait(self, duration_ms: int) -> None:
        self._now_ms = (self._now_ms + duration_ms) % CLOCK
        self._add(b"t", struct.pack("<I", self._now_ms))

    def read_behind_memory(self) -> None:
        self._add(b"!", bytes(3))

    def play(self) -> subprocess.CompletedProcess[bytes]:
        return subprocess.run([build() / "replay"], input=bytes(self._records), capture_output=True, check=False)
