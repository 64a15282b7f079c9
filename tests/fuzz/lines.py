"""What comes over lines and sockets: microcontroller frames, NMEA and UBX, and the requests of the page."""

from __future__ import annotations

import io
import json
import random
from collections import Counter
from pathlib import Path
from urllib.parse import parse_qsl

import msgspec

from paani import messages as m
from paani.config import GpsConfig, HeadingConfig, ImuConfig, SensorDevicesConfig
from paani.microcontroller.payloads import (
    INDICATION,
    THRUST,
    EscSettings,
    Guide,
    McuStatus,
    ThrustCall,
    append_crc,
    has_valid_crc,
    version_of,
)
from paani.microcontroller.rpc import (
    MAX_MESSAGE_BYTES,
    MessageScanner,
    Request,
    Response,
    encode_notification,
    encode_request,
    encode_response,
)
from paani_services.dashboard.requests import (
    BadRequestError,
    NoQuery,
    PressRequest,
    SnapshotQuery,
    decode_body,
    decode_query,
    is_own_host,
    is_same_origin,
)
from paani_services.dashboard.tuning import ProposalRequest, ProposeRequest
from paani_services.sensors.fixes import fixes_from_sentences
from paani_services.sensors.framing import MAX_SENTENCE, MAX_UBX_PAYLOAD
from paani_services.sensors.playback import play
from paani_services.sensors.suite import SensorSuite
from paani_services.thrusters.output import find_output_cause, holds_of
from tests.fuzz.damage import damaged_bytes, damaged_text, damaged_tree, json_bytes
from tests.fuzz.target import ContractError, Target
from tests.unit.paani_services.sensors.written import imu_line, nav_pvt, rmc, sentence, ubx

START_US = 1_800_000_000_000_000
LINE = "serial:/dev/ttyX@115200"


class McuStream(Target):
    """What the board's router or the microcontroller writes, cut anywhere, and what is made of each message."""

    name, share = "microcontroller's stream (RPC)", 60

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._scanner = MessageScanner()
        self._payloads = (
            McuStatus(kind=THRUST, state=m.McuState.FRESH, verdict=m.McuVerdict.ACCEPTED, session=7, holds=3).encode(),
            McuStatus(kind=INDICATION, state=m.McuState.STALE, display=m.Direction.LEFT).encode(),
            Guide(direction=m.Direction.LEFT, session=9, seq=3, lease_ms=600, risks=(1, 2, 3)).encode(),
            ThrustCall(armed=True, session=9, seq=3, lease_ms=300, left=0.5, right=-0.5).encode(),
            EscSettings(session=9, trim_left_us=-5).encode(),
        )
        payload = self._payloads[0]
        self._messages = (
            *(encode_response(5, each) for each in self._payloads),
            encode_request(6, "$/reset"),
            encode_notification("paani_mcu", payload),
            encode_request(7, "paani_thrust", payload),
            msgspec.msgpack.encode([1, 5, [2, "no route"], None]),
            msgspec.msgpack.encode([1, 5, None, {"a": [1, 2.5, None, True, "t", msgspec.msgpack.Ext(1, b"x")]}]),
        )

    def payload(self) -> bytes:
        rng = self.rng
        pieces = []
        for _ in range(rng.randint(1, 4)):
            choice, message = rng.random(), rng.choice(self._messages)
            if choice < 0.25:  # a payload of any content whose CRC is right
                inside = damaged_bytes(rng.choice(self._payloads)[:-2], rng)[:120]
                pieces.append(encode_response(rng.randrange(8), append_crc(inside)))
            else:
                pieces.append(damaged_bytes(message, rng, self._messages) if choice < 0.8 else message)
        return b"".join(pieces)

    def take(self, data: bytes) -> str:
        half = len(data) // 2
        messages = [message for piece in (data[:half], data[half:]) for message in self._scanner.feed(piece)]
        if len(self._scanner._buffer) > MAX_MESSAGE_BYTES:
            raise ContractError(f"keeps {len(self._scanner._buffer)} bytes")
        for message in messages:
            given = [message.result] if isinstance(message, Response) else message.params
            for payload in given:
                if isinstance(payload, bytes):
                    _judge(payload)
            if isinstance(message, Request):
                encode_response(message.id, True)
        return "" if messages else "no message"


def _judge(payload: bytes) -> None:
    if not has_valid_crc(payload):
        raise ContractError("a payload without its CRC")
    version_of(payload)
    for kind in (Guide, ThrustCall, EscSettings):
        kind.decode(payload)
    status = McuStatus.decode(payload)
    if status is not None:
        holds_of(status)
        find_output_cause(status, 0.0, 300.0)


class SensorLines(Target):
    """NMEA and UBX of a receiver, an inertial unit and a compass on one line, into a hull's fixes and samples."""

    name, share = "serial lines (NMEA, UBX)", 80

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._suite = SensorSuite(
            SensorDevicesConfig(
                gps=GpsConfig(line=LINE), imu=ImuConfig(line=LINE), heading=HeadingConfig(line=LINE), variation_deg=2.0
            )
        )
        self._now_us = START_US
        self._suite.opened(LINE, self._now_us)
        bodies = (
            "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "GPGLL,4916.45,N,12311.12,W,225444,A,A",
            "GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A", "GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.020,0.031",
            "HCHDG,101.1,1.0,E,7.1,W", "GPHDT,123.456,T", "HCHDM,238.5,M", "GPTHS,123.4,A", "PUBX,00,1,2",
            "GPTXT,01,01,02,x",
            "VNYMR,+006.380,+000.023,-001.953,+1.0640,-0.2531,+3.0614,+00.005,+00.344,-09.758,-0.001,-0.0004,-0.001",
        )  # fmt: skip
        self._frames = (
            rmc(knots=3.0), imu_line(1000), nav_pvt(), ubx(b"\x01\x35", bytes(200)),
            *(sentence(body).encode() for body in bodies),
        )  # fmt: skip

    def payload(self) -> bytes:
        rng = self.rng
        frame = rng.choice(self._frames)
        choice = rng.random()
        if choice < 0.5 and frame.startswith(b"$"):  # other fields, and the right checksum
            body = damaged_text(frame[1 : frame.index(b"*")], rng).decode("latin-1")
            return sentence(body.replace("*", "")[:170]).encode("latin-1", "replace")
        if choice < 0.7 and not frame.startswith(b"$"):
            return ubx(frame[2:4], damaged_bytes(frame[6:-2], rng)[: rng.choice((92, 1100))])
        return damaged_bytes(frame, rng, self._frames) + rng.choice((b"", b"\r\n", frame))

    def take(self, data: bytes) -> str:
        self._now_us += 50_000
        before = Counter(self._suite.drops)
        line = self._suite.lines[LINE]
        frames = line.frames
        reading = self._suite.take(LINE, data, self._now_us)
        for message in (*reading.fixes, *reading.samples):
            kind = type(message)
            msgspec.json.decode(msgspec.json.encode(message), type=kind)  # its bounds hold
        for device in self._suite.report(self._now_us):
            msgspec.convert(msgspec.to_builtins(device), m.SensorDevice)
        waiting = len(self._suite._framers[LINE]._waiting)
        if waiting > max(MAX_UBX_PAYLOAD + 8, MAX_SENTENCE) or len(line.kinds) > 100:
            raise ContractError(f"keeps {waiting} bytes and {len(line.kinds)} kinds")
        list(play(io.BytesIO(data)))
        list(fixes_from_sentences(data.decode("latin-1").splitlines(), Counter()))
        causes = Counter(self._suite.drops) - before
        if causes:
            return next(iter(causes))
        return "" if line.frames > frames else "no frame"


class PageRequests(Target):
    """Bodies, queries and headers of requests to the page's server."""

    name, share = "page's requests", 40
    _bodies = (
        (PressRequest, {"press": 7}),
        (ProposalRequest, {"proposal": "a1"}),
        (ProposeRequest, {"changes": [{"path": "advisor.policy.center_block_risk", "value": "0.4"}]}),
    )
    _queries = (b"max_age_s=2.5", b"", b"max_age_s=nan&x=1", b"max_age_s=1e400")

    def payload(self) -> bytes:
        rng = self.rng
        if rng.random() < 0.3:
            return damaged_text(rng.choice(self._queries), rng)
        _, tree = rng.choice(self._bodies)
        if rng.random() < 0.6:
            return json_bytes(damaged_tree(tree, rng), rng)
        return damaged_text(json.dumps(tree).encode(), rng)

    def take(self, data: bytes) -> str:
        text = data.decode("latin-1")
        causes = set()
        for kind, _ in self._bodies:
            try:
                decode_body(data, kind)
            except BadRequestError as error:
                causes.add(_refused(error))
            else:
                causes.add("")
        query = dict(parse_qsl(text, max_num_fields=None))
        for query_kind in (SnapshotQuery, NoQuery):
            try:
                decode_query(query, query_kind)
            except BadRequestError as error:
                _refused(error)
        for host in (text, f"[{text}]", f"127.0.0.1:{text}", f"localhost{text[:20]}"):
            is_own_host(host, ("127.0.0.1",))
            is_same_origin(f"http://{host}", text)
        return "" if "" in causes else sorted(causes)[0]


def _refused(error: BadRequestError) -> str:
    if "\n" in str(error) or not error.field:
        raise ContractError(f"not one line with a field: {error!r}")
    return error.field if error.field in {"press", "proposal", "changes"} else "body"


LINES: tuple[type[Target], ...] = (McuStream, SensorLines, PageRequests)
