"""The camera as a component of its own."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from paani_services.mavlink.camera import Stream
from tests.mavlink_peer import HEARTBEAT, NOW_US, Peer, Port, armed, in_order, kinds, only

CAMERA = 100
STREAM = Stream("127.0.0.1", 8554, 5.0, 69.4, (640, 360))


def ask(peer: Peer, command: int, first: float = 0.0) -> list[Any]:
    return peer.send(common.MAVLink_command_long_message(1, CAMERA, command, 0, first, 0, 0, 0, 0, 0, 0))


def port(stream: Stream | None) -> Port:
    made = Port(in_order())
    made.stream = stream
    return made


@pytest.mark.parametrize(
    ("command", "first", "answer"),
    [
        (512, 259, ["CAMERA_INFORMATION"]),
        (521, 1, ["CAMERA_INFORMATION"]),
        (512, 269, ["VIDEO_STREAM_INFORMATION"]),
        (2504, 0, ["VIDEO_STREAM_INFORMATION"]),
        (512, 270, ["VIDEO_STREAM_INFORMATION", "VIDEO_STREAM_STATUS"]),
        (512, 262, []),
        (2000, 0, []),  # a photograph
        (400, 1, []),  # arming is the boat's
        (400, 0, []),
    ],
)
def test_it_says_what_it_is_and_does_nothing(command: int, first: float, answer: list[str]) -> None:
    made = port(STREAM)
    sent = ask(Peer(made.gateway), command, first)
    assert kinds(sent) == [*answer, "COMMAND_ACK"]
    assert {message.get_srcComponent() for message in sent} == {CAMERA}
    assert sent[-1].result == (common.MAV_RESULT_ACCEPTED if answer else common.MAV_RESULT_UNSUPPORTED)
    assert made.asked == []


def test_the_stream_is_where_it_is_served() -> None:
    made = port(STREAM)
    sent = ask(Peer(made.gateway), 512, 270)
    located, status = only(sent, "VIDEO_STREAM_INFORMATION"), only(sent, "VIDEO_STREAM_STATUS")
    assert (located.uri, located.type) == ("rtsp://127.0.0.1:8554/camera", common.VIDEO_STREAM_TYPE_RTSP)
    for message in (located, status):
        assert (message.resolution_h, message.resolution_v, message.framerate, message.hfov) == (640, 360, 5.0, 69)
    info = only(ask(Peer(made.gateway), 512, 259), "CAMERA_INFORMATION")
    names = [bytes(name).rstrip(b"\0") for name in (info.vendor_name, info.model_name)]
    assert (names, info.flags) == ([b"PAANI", b"otter"], common.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM)


@pytest.mark.parametrize(
    ("host", "is_local", "uri"),
    [
        ("127.0.0.1", True, "rtsp://127.0.0.1:8554/camera"),
        ("127.0.0.1", False, ""),  # where the station could not reach it
        ("0.0.0.0", False, "rtsp://192.168.1.10:8554/camera"),
        ("10.8.0.1", False, "rtsp://10.8.0.1:8554/camera"),
        ("fd00::1", False, "rtsp://[fd00::1]:8554/camera"),
    ],
)
def test_a_station_hears_of_it_where_it_can_watch(host: str, is_local: bool, uri: str) -> None:
    made = port(STREAM._replace(host=host))
    peer = Peer(made.gateway, local=is_local)
    peer.station.own_host = "192.168.1.10"
    answers = ask(peer, 512, 269)
    assert [message.uri for message in answers if message.get_type() == "VIDEO_STREAM_INFORMATION"] == [uri] * bool(uri)
    made.gateway.tick(armed())
    beats = [(each.get_srcComponent(), each.type) for each in peer.received() if each.get_type() == "HEARTBEAT"]
    assert beats == [(CAMERA, common.MAV_TYPE_CAMERA)] * bool(uri) + [(1, common.MAV_TYPE_SURFACE_BOAT)]


def test_without_a_stream_there_is_no_camera() -> None:
    made = port(None)
    peer = Peer(made.gateway)
    assert ask(peer, 512, 259) == []
    peer.send(HEARTBEAT)
    made.gateway.tick(in_order())
    assert {message.get_srcComponent() for message in peer.received()} == {1}


def test_each_component_counts_its_own_frames() -> None:
    """By the gaps in the numbers of a component stations see what a link has lost."""
    made = port(STREAM)
    peer = Peer(made.gateway)
    numbers: dict[int, list[int]] = {1: [], CAMERA: []}
    for second in range(3):
        peer.send(HEARTBEAT, NOW_US)
        made.gateway.tick(in_order(now_us=NOW_US + second * 1_000_000))
        for message in peer.received():
            numbers[message.get_srcComponent()].append(message.get_seq())
    assert numbers[CAMERA] == [0, 1, 2]
    assert numbers[1] == list(range(len(numbers[1])))
