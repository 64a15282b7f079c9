"""Late joiners get everything there is with its true age; a client that never reads costs nobody anything."""

from __future__ import annotations

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani.config import load_config
from paani_services.dashboard.frames import decode_frame
from paani_services.dashboard.hub import EVENT_KEY, Client, Event, Hub
from paani_services.dashboard.page_state import ServiceLiveness, page_settings


def taken(client: Client) -> dict[str, tuple[int, bytes]]:
    found = {}
    while (frame := client.queue.pop()) is not None:
        key, header, body = decode_frame(frame)
        found[key] = (header.age_ms, body)
    return found


def arming(seq: int) -> m.Arming:
    return m.Arming(source_us=1, armed=False, seq=seq)


async def test_a_late_joiner_gets_the_newest_with_its_age() -> None:
    hub = Hub()
    hub.put("operator/arming", arming(1), 1_000_000, 1_000_000)
    hub.put("operator/arming", arming(2), 2_000_000, 2_000_000)
    hub.publish_event(Event(2_500_000, "warn", "eye is gone"))
    got = taken(hub.add_client(5_000_000))
    age_ms, body = got["operator/arming"]
    assert age_ms == 3000
    assert msgspec.json.decode(body, type=m.Arming).seq == 2
    assert got[EVENT_KEY][0] == 2500


async def test_a_stalled_client_keeps_one_frame_per_key_and_the_other_gets_all() -> None:
    hub = Hub()
    stalled, healthy = hub.add_client(0), hub.add_client(0)
    for seq in range(100):
        hub.put("operator/arming", arming(seq), 0, 0)
        got = taken(healthy)
        assert msgspec.json.decode(got["operator/arming"][1], type=m.Arming).seq == seq
    assert len(stalled.queue) == 1
    assert stalled.queue.superseded == 99


async def test_nothing_is_encoded_without_clients() -> None:
    hub = Hub()
    client = hub.add_client(0)
    assert hub.has_clients.is_set()
    hub.remove_client(client)
    hub.put("operator/arming", arming(1), 0, 0)
    assert not hub.has_clients.is_set()
    assert len(client.queue) == 0


async def test_a_picture_travels_as_its_bytes_with_its_header_beside() -> None:
    hub = Hub()
    client = hub.add_client(0)
    header = m.PictureHeader(source_us=1, frame_seq=7, frame_epoch=3, width_px=4, height_px=2)
    hub.put(keys.PICTURE.name, Picture(header, b"\xff\xd8jpeg"), 0, 40_000)
    frame = client.queue.pop()
    assert frame is not None
    key, head, body = decode_frame(frame)
    assert (key, head.age_ms, body) == ("camera/picture", 40, b"\xff\xd8jpeg")
    assert msgspec.json.decode(head.picture, type=m.PictureHeader) == header


def test_a_start_is_a_newer_epoch_and_not_a_router_that_was_lost_or_a_clock_that_was_set_back() -> None:
    lives = ServiceLiveness()
    for epoch, is_start in ((7000, True), (7000, False), (3000, False), (3000, False), (3200, True)):
        for alive in (False, True):
            lives.update("eye", alive=alive)
        assert (lives.report("eye", epoch) is not None) == is_start
    (eye,) = [life for life in lives.update("eye", alive=True).services if life.service == "eye"]
    assert (eye.alive, eye.starts) == (True, 2)


@pytest.mark.parametrize(
    ("sets", "mode", "pictures"),
    [
        (("camera.source=sim",), "sim", "sim"),
        (("camera.source=webcam:1",), "sim", "camera"),
        (("camera.source=/tmp/v.mp4",), "sim", "file"),
        (("bus.vessel=boat_replay", "camera.source=/tmp/drive.mcap"), "replay", "file"),
        (("dashboard.replayed=/tmp/drive.mcap",), "replay", "sim"),
        (("profile=hil",), "hil", "sim"),
        (("profile=hull",), "hull", "camera"),
        (("profile=hull", "bus.vessel=boat_replay"), "replay", "camera"),
    ],
)
def test_the_page_names_what_the_thrust_moves_and_where_pictures_come_from(
    sets: tuple[str, ...], mode: str, pictures: str
) -> None:
    """A video before a camera's place moves a boat as a camera does: only a recording is a replay."""
    settings = page_settings(load_config(sets=sets))
    assert (settings.mode, settings.pictures) == (mode, pictures)


def test_a_watcher_of_a_key_is_woken_by_that_key_alone() -> None:
    hub = Hub()
    with hub.changes("a") as changed:
        assert not changed.is_set()
        hub.put("b", Event(1, "info", "other"), 1, 1)
        assert not changed.is_set()
        hub.put("a", Event(1, "info", "own"), 1, 1)
        assert changed.is_set()
        with hub.changes("a") as late:
            assert late.is_set(), "what there is already is news to who comes late"
        changed.clear()
        late.clear()
        hub.put("a", Event(2, "info", "own"), 2, 2)
        assert changed.is_set()
        assert not late.is_set(), "who has gone is woken no more"
