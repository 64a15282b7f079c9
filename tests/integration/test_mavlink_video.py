"""The camera by MAVLink and RTSP, with clients that others wrote: MAVSDK's camera plugin, and FFmpeg as the player."""

from __future__ import annotations

import asyncio
from typing import Any

import cv2
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, find_free_port

pytest.importorskip("pymavlink", reason="needs pymavlink")
sdk: Any = pytest.importorskip("mavsdk.asyncio.mavsdk", reason="needs mavsdk")
cameras: Any = pytest.importorskip("mavsdk.asyncio.plugins.camera")
kinds: Any = pytest.importorskip("mavsdk.component_type")
pytestmark = pytest.mark.integration
CLOCK = WallClock()
BLUE, GREEN = (200, 40, 30), (30, 180, 60)


def picture_of(colour: tuple[int, int, int]) -> bytes:
    """A plain picture with a bright square, which a wrong table or a lost packet would not leave so."""
    bgr = np.full((240, 320, 3), colour, np.uint8)
    bgr[40:80, 40:80] = 255
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()


def watch(uri: str) -> list[Any]:
    """Frames until a green one; FFmpeg asks for UDP first, is refused, and takes TCP."""
    capture = cv2.VideoCapture(uri, cv2.CAP_FFMPEG)
    frames = []
    try:
        for _ in range(200):
            ok, frame = capture.read()
            if not ok:
                break
            frames.append(frame)
            if frame[200, 200, 1] > 120:
                break
    finally:
        capture.release()
    return frames


@pytest.mark.slow
async def test_a_player_shows_the_camera_where_mavlink_says_it_is(spawn: Spawn, open_as: OpenAs) -> None:
    tcp, video = find_free_port(), find_free_port()
    pictures = (await open_as("camera")).picture_publisher(keys.PICTURE)
    colour = BLUE

    async def publish() -> None:
        seq = 0
        while True:
            seq += 1
            header = m.PictureHeader(
                source_us=CLOCK.now_us(), frame_seq=seq, frame_epoch=1, width_px=320, height_px=240
            )
            pictures.put_picture(header, picture_of(colour))
            await asyncio.sleep(0.1)

    configuration = sdk.Configuration.create_with_component_type(kinds.ComponentType.GROUND_STATION)
    links = (f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""', f"mavlink.video=127.0.0.1:{video}")
    async with (
        at_work(publish()),
        spawn("mavlink", *links),
        sdk.Mavsdk(configuration) as mavsdk,
        asyncio.timeout(60.0),
    ):
        await mavsdk.add_any_connection(f"tcpout://127.0.0.1:{tcp}")
        system = await mavsdk.first_autopilot(timeout_s=10.0)
        assert system is not None
        camera = cameras.CameraAsync(system)
        while not (listed := (await camera.camera_list()).cameras):
            await asyncio.sleep(0.1)
        assert (listed[0].vendor_name, listed[0].model_name) == ("PAANI", "otter")
        while not (uri := (await camera.get_video_stream_info(listed[0].component_id)).settings.uri):
            await asyncio.sleep(0.2)
        assert uri == f"rtsp://127.0.0.1:{video}/camera"
        async with asyncio.TaskGroup() as group:
            watching = group.create_task(asyncio.to_thread(watch, uri))
            await asyncio.sleep(1.0)
            colour = GREEN
        frames = watching.result()
        camera.destroy()
    assert frames[-1].shape == (240, 320, 3)
    assert frames[-1][200, 200] == pytest.approx(GREEN, abs=4)
    assert frames[-1][60, 60] == pytest.approx((255, 255, 255), abs=4)


async def test_what_is_no_player_is_told_so_and_holds_back_none(spawn: Spawn, open_as: OpenAs) -> None:
    """A browser's request, one without an end, a player that is one too many, one whose answers nobody reads."""
    video = find_free_port()
    observer = await open_as("observer")
    health = observer.latest(keys.health("mavlink"))
    links = (f"mavlink.video=127.0.0.1:{video}", 'mavlink.udp=""', "mavlink.max_clients=2")
    async with spawn("mavlink", *links), asyncio.timeout(30.0):
        for request in (b"GET /camera HTTP/1.1\r\nHost: boat\r\n\r\n", b"OPTIONS " + b"x" * 20_000):
            reader, writer = await asyncio.open_connection("127.0.0.1", video)
            writer.write(request)
            assert await reader.read() == b"RTSP/1.0 400 Bad Request\r\n\r\n"
            writer.close()
        deaf = (await asyncio.open_connection("127.0.0.1", video))[1]
        deaf.write(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n" * 50_000)
        reader, writer = await asyncio.open_connection("127.0.0.1", video)
        third, third_writer = await asyncio.open_connection("127.0.0.1", video)
        assert await third.read() == b""
        third_writer.close()
        writer.write(b"DESCRIBE rtsp://127.0.0.1/camera RTSP/1.0\r\nCSeq: 2\r\n\r\n")
        assert (await reader.readline(), await reader.readline()) == (b"RTSP/1.0 200 OK\r\n", b"CSeq: 2\r\n")
        while not (drops := (await health.next()).drops):
            pass
        assert {drop.cause for drop in drops} == {"video_refused"}
        deaf.transport.abort()
        writer.close()
