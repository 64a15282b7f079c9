"""The Foxglove port on a real drive, watched by a plain WebSocket client and read by the published schemas.

The client is aiohttp's; of the protocol (`foxglove.sdk.v1`) only the handshake and the frame's head are written here.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import struct
from collections.abc import AsyncIterator, Iterable, Sequence
from importlib import import_module
from itertools import pairwise
from typing import Any

import aiohttp
import cv2
import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.logs.reader import Log, open_log
from tests.conftest import find_free_port
from tests.integration.test_up import READY_S, Up, words_of
from tests.unit.paani.logs.small_logs import recorded

pytest.importorskip("foxglove", reason="the extra foxglove is not installed")
pytest.importorskip("foxglove_schemas_protobuf", reason="foxglove-schemas-protobuf is not installed")
pytestmark = [pytest.mark.integration, pytest.mark.timeout(150)]

DRIVE_S = 6.0
SUBPROTOCOL = "foxglove.sdk.v1"
HEAD = struct.Struct("<BIQ")  # opcode, subscription, log time [ns]
MESSAGE_DATA, CLIENT_PUBLISH = 1, struct.Struct("<BI")
SETTING = "advisor.policy.center_block_risk"


class Viewer:
    """Watches every channel; keeps what comes, by topic."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.channels: dict[int, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        self.answers: list[dict[str, Any]] = []

    async def subscribe(self) -> None:
        while not self.channels:
            self._take(await self._socket.receive())
        await self.say(op="subscribe", subscriptions=[{"id": number, "channelId": number} for number in self.channels])

    async def say(self, **words: Any) -> None:
        await self._socket.send_str(json.dumps(words))

    async def publish(self, topic: str, data: bytes) -> None:
        """As a viewer's panel that publishes does."""
        channel = {"id": 1, "topic": topic, "encoding": "json", "schemaName": "paani.Thrust"}
        await self.say(op="advertise", channels=[channel])
        await self._socket.send_bytes(CLIENT_PUBLISH.pack(1, 1) + data)

    async def watch(self) -> None:
        """Until the server goes."""
        async for message in self._socket:
            self._take(message)

    def read(self, topic: str) -> list[Any]:
        """By the schema that the server names: the published one of that name, or our own type."""
        kind = next(channel["schemaName"] for channel in self.channels.values() if channel["topic"] == topic)
        package, _, name = kind.rpartition(".")
        if package == "foxglove":
            decode = getattr(import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name).FromString
        else:
            decode = msgspec.json.Decoder(getattr(m, name)).decode
        return [decode(data) for _, data in self.messages.get(topic, [])]

    def _take(self, message: aiohttp.WSMessage) -> None:
        if message.type is aiohttp.WSMsgType.BINARY:
            opcode, number, time_ns = HEAD.unpack_from(message.data)
            if opcode == MESSAGE_DATA:
                topic = self.channels[number]["topic"]
                self.messages.setdefault(topic, []).append((time_ns, message.data[HEAD.size :]))
        elif message.type is aiohttp.WSMsgType.TEXT:
            words = json.loads(message.data)
            if words["op"] == "advertise":
                self.channels |= {channel["id"]: channel for channel in words["channels"]}
            else:
                self.answers.append(words)


@contextlib.asynccontextmanager
async def connected(http: aiohttp.ClientSession, port: int) -> AsyncIterator[Viewer]:
    async with http.ws_connect(f"http://127.0.0.1:{port}/", protocols=[SUBPROTOCOL], max_msg_size=0) as socket:
        assert socket.protocol == SUBPROTOCOL
        yield Viewer(socket)


async def request_refused(viewer: Viewer) -> None:
    """Orders thrust, arms, and sets a parameter."""
    thrust = m.Thrust(
        source_us=1, left=1.0, right=1.0, enabled=True, producer="controller", seq=10**6, topic="controller/thrust"
    )
    await viewer.publish("controller/thrust", msgspec.json.encode(thrust))
    await viewer.publish("operator/arming", b'{"armed":true}')
    await viewer.say(op="setParameters", parameters=[{"name": SETTING, "value": 0.99}], id="set")
    await viewer.say(op="getParameters", parameterNames=[SETTING, "foxglove.tls_pem", "bus.runtime_dir"], id="get")


async def hold_unread(http: aiohttp.ClientSession, port: int) -> aiohttp.ClientWebSocketResponse:
    """A viewer that asks for everything and then never reads again, with next to no buffer."""
    deaf = await http.ws_connect(f"http://127.0.0.1:{port}/", protocols=[SUBPROTOCOL], max_msg_size=0)
    transport = deaf.get_extra_info("socket")
    transport.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    viewer = Viewer(deaf)
    await viewer.subscribe()
    assert deaf._conn is not None
    assert deaf._conn.transport is not None
    deaf._conn.transport.pause_reading()
    return deaf


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Viewer, Log]:
    """What a viewer saw of a recorded drive; it asked for what no viewer may, and another viewer never read."""
    folder = tmp_path_factory.mktemp("foxglove")
    port = find_free_port()
    sets = (
        f"bus.router=tcp/127.0.0.1:{find_free_port()}", f"bus.runtime_dir={folder / 'runtime'}",
        f"foxglove.port={port}", "dashboard.serve=false",
    )  # fmt: skip
    words = ("--headless", "--with", "foxglove", "--record", str(folder / "drive"), "--for", str(DRIVE_S))
    up = Up(folder, *words_of(sets, *words))
    up.until(lambda: "processes alive after" in up.out, READY_S)

    async def watch() -> Viewer:
        async with aiohttp.ClientSession() as http, connected(http, port) as viewer:
            deaf = await hold_unread(http, port)
            await viewer.subscribe()
            await request_refused(viewer)
            await viewer.watch()
            await deaf.close()
            return viewer

    try:
        viewer = asyncio.run(watch())
        assert up.process.wait(60) == 0, (up.out, up.errors)
    finally:
        up.process.terminate()
    return viewer, open_log(folder / "drive")


def dated(layers: Iterable[int], pictures: Sequence[int]) -> set[int]:
    """The layers' pictures [us]; those from before the viewer's first picture left out, as it came between the two."""
    return {source_us for source_us in layers if source_us >= min(pictures)}


@pytest.mark.rotating(cpu_s=20)
def test_pictures_decode_and_are_those_of_the_bus(drive: tuple[Viewer, Log]) -> None:
    viewer, log = drive
    pictures = viewer.read("camera/picture")
    assert len(pictures) > DRIVE_S
    headers = {
        header.source_us: header
        for record in log.records(["camera/picture/header"])
        for header in [msgspec.json.decode(record.data, type=m.PictureHeader)]
    }
    for picture in pictures:
        pixels = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
        header = headers[picture.timestamp.ToMicroseconds()]
        assert pixels is not None
        assert pixels.shape == (header.height_px, header.width_px, 3)
        assert (picture.format, picture.frame_id) == ("jpeg", "camera_optical")


def test_every_overlay_lies_on_a_picture_that_was_sent(drive: tuple[Viewer, Log]) -> None:
    viewer, log = drive
    sent = [picture.timestamp.ToMicroseconds() for picture in viewer.read("camera/picture")]
    assert len(sent) == len(set(sent))
    for topic in ("viewer/annotations", "viewer/corridors"):
        stamps = [
            {each.timestamp.ToMicroseconds() for each in (*drawn.points, *drawn.texts)} for drawn in viewer.read(topic)
        ]
        layers = [stamp for group in stamps for stamp in group]
        assert all(len(group) <= 1 for group in stamps), topic
        assert len(layers) == len(set(layers)), "no picture has a layer twice"
        assert dated(layers, sent) <= set(sent), topic
    assert len(viewer.read("viewer/corridors")) > DRIVE_S
    boxes = {
        tracks.source_us: {f"#{track.id} {track.label} {track.confidence:.2f}" for track in tracks.tracks}
        for tracks in recorded(log, keys.TRACKS)
    }
    for drawn in viewer.read("viewer/annotations"):
        for text in drawn.texts:
            assert text.text in boxes[text.timestamp.ToMicroseconds()]


def test_masks_are_coloured_and_lie_on_their_picture(drive: tuple[Viewer, Log]) -> None:
    viewer, _ = drive
    sent = [picture.timestamp.ToMicroseconds() for picture in viewer.read("camera/picture")]
    masks = viewer.read("viewer/mask")
    assert len(masks) > DRIVE_S
    assert dated((mask.timestamp.ToMicroseconds() for mask in masks), sent) <= set(sent)
    for mask in masks:
        pixels = cv2.imdecode(np.frombuffer(mask.data, np.uint8), cv2.IMREAD_COLOR)
        assert pixels is not None
        assert pixels.max() > 100, "classes would be 0, 1 and 2"


def test_positions_are_those_on_the_bus(drive: tuple[Viewer, Log]) -> None:
    viewer, log = drive
    places: dict[int, list[complex]] = {}  # several of one instant, where a fix comes before the next IMU sample
    for each in recorded(log, keys.ODOMETRY):
        places.setdefault(each.source_us, []).append(complex(each.x_m, each.y_m))
    poses, chains = viewer.read("viewer/pose"), viewer.read("viewer/transforms")
    assert min(len(poses), len(chains)) > 10 * DRIVE_S
    for pose in poses:
        position = pose.pose.position
        assert complex(position.x, position.y) in places[pose.timestamp.ToMicroseconds()]
    for chain in chains:
        to_odom, to_base, to_camera = chain.transforms
        turn = complex(to_odom.rotation.w, to_odom.rotation.z) ** 2
        place = complex(to_odom.translation.x, to_odom.translation.y)
        place += turn * complex(to_base.translation.x, to_base.translation.y)
        assert min(abs(place - each) for each in places[to_odom.timestamp.ToMicroseconds()]) < 1e-6
        assert (to_camera.parent_frame_id, to_camera.child_frame_id) == ("base_link", "camera_optical")
    fixes = {each.source_us: each for each in recorded(log, keys.GPS)}
    for fix in viewer.read("viewer/gps"):
        there = fixes[fix.timestamp.ToMicroseconds()]
        assert (fix.latitude, fix.longitude) == (there.latitude_deg, there.longitude_deg)


def seq_of(data: bytes) -> int:
    return int(msgspec.json.decode(data)["seq"])


def test_messages_come_as_they_are_and_truth_does_not(drive: tuple[Viewer, Log]) -> None:
    viewer, log = drive
    for topic in (keys.ADVISORY, keys.COMMAND, keys.IMU):
        there = {seq_of(record.data): record.data for record in log.records([topic.name])}
        come = {seq_of(data): data for _, data in viewer.messages[topic.name]}
        both = come.keys() & there.keys()
        assert len(both) > max(DRIVE_S, 0.9 * len(come))  # a busy recorder may have lost one
        assert all(come[seq] == there[seq] for seq in both), topic.name
    assert not any(channel["topic"].startswith("@") for channel in viewer.channels.values())


def test_a_viewer_that_publishes_is_refused_and_counted(drive: tuple[Viewer, Log]) -> None:
    """The protocol's own error, a count in the health report, and nothing on the bus."""
    viewer, log = drive
    refused = [answer for answer in viewer.answers if answer["op"] == "status"]
    assert any("clientPublish" in answer["message"] for answer in refused)
    values = {answer["id"]: answer["parameters"] for answer in viewer.answers if answer["op"] == "parameterValues"}
    assert [value["value"] for value in values["set"]] == [0.48]
    assert [(value["name"], value["value"]) for value in values["get"]] == [(SETTING, 0.48)]
    drops = {drop.cause: drop.count for report in recorded(log, keys.health("foxglove")) for drop in report.drops}
    assert drops["viewer_message_refused"] == 2
    assert drops["viewer_set_refused"] == 1
    written = [record.topic for record in log.records() if b'"producer":"foxglove"' in record.data]
    assert set(written) == {"health/foxglove"}
    assert max(each.seq for each in recorded(log, keys.THRUST)) < 10**6


def test_a_viewer_that_never_reads_disturbs_nobody(drive: tuple[Viewer, Log]) -> None:
    """The one that reads went on to the end, and the boat drove."""
    viewer, log = drive
    times_s = [time_ns * 1e-9 for time_ns, _ in viewer.messages["localization/odometry"]]
    assert times_s[-1] - times_s[0] > DRIVE_S - 2.0
    assert max(later - earlier for earlier, later in pairwise(times_s)) < 2.0
    assert any(applied.zero_cause is m.ZeroCause.NONE for applied in recorded(log, keys.THRUST_APPLIED))
