"""The bus over a real router: authority, newest wins, pulled pictures, liveliness, recovery."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.authority import ensure_credentials
from paani.bus import Latest, Publisher, open_bus
from paani.bus.admission import MAX_MESSAGE_BYTES
from paani.bus.routing import open_router
from paani.bus.session import MAX_BYTES
from paani.clock import ManualClock, WallClock
from paani.config import Config, load_config
from paani.errors import UserError
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, put_raw

pytestmark = pytest.mark.integration
CLOCK = WallClock()


def thrust(left: float = 0.1) -> m.Thrust:
    return m.Thrust(source_us=CLOCK.now_us(), left=left, right=0.1, enabled=True)


async def until(condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(0.01)


async def until_received(own: Publisher[m.Thrust], inbox: Latest[m.Thrust]) -> None:
    """A subscriber is known to its publisher only a moment after it was declared. None is on its way after this."""
    while inbox.value is None:
        own.put(thrust())
        await asyncio.sleep(0.02)
    last = own.put(thrust())
    await until(lambda: inbox.value is not None and inbox.value.seq == last.seq)


async def test_only_the_controllers_thrust_arrives(open_as: OpenAs) -> None:
    """B13, architecture 4: a service that is not the producer is not heard, wildcards included."""
    plant, controller, advisor = await open_as("plant"), await open_as("controller"), await open_as("advisor")
    inbox = plant.latest(keys.THRUST)
    own, forged = controller.publisher(keys.THRUST), advisor.publisher(keys.THRUST)
    await until_received(own, inbox)
    before = inbox.received
    for _ in range(5):
        forged.put(thrust(left=1.0))
        put_raw(advisor, "controller/thrust", b"{}")
        put_raw(advisor, "controller/*", b"{}")
        put_raw(advisor, "**", b"{}")
        put_raw(controller, "controller/*", b"{}")
    own.put(thrust(left=0.3))
    await until(lambda: inbox.value is not None and inbox.value.left == 0.3)
    assert inbox.received == before + 1
    assert not plant.drops


async def test_what_is_refused_is_counted_by_cause(open_as: OpenAs) -> None:
    plant, controller = await open_as("plant"), await open_as("controller")
    inbox = plant.latest(keys.THRUST)
    own = controller.publisher(keys.THRUST)
    await until_received(own, inbox)
    sent = own.put(thrust())
    for data in (b"", b'{"left": NaN}', b"{}"):
        put_raw(controller, "controller/thrust", data)
    await until(lambda: sum(plant.drops.values()) == 3)
    assert dict(plant.drops) == {"undecodable": 1, "non_finite": 1, "wrong_type": 1}
    assert inbox.value is not None
    assert inbox.value.seq == sent.seq


async def test_truth_is_for_its_readers_alone(open_as: OpenAs) -> None:
    """L4: no estimator or advisor can read the simulator's truth."""
    plant, dashboard, localization = await open_as("plant"), await open_as("dashboard"), await open_as("localization")
    seen, hidden = dashboard.latest(keys.TRUE_POSE), localization.latest(keys.TRUE_POSE)
    publisher = plant.publisher(keys.TRUE_POSE)
    pose = m.TruePose(
        source_us=1,
        sim_us=0,
        x_m=0,
        y_m=0,
        z_m=0,
        roll_rad=0,
        pitch_rad=0,
        yaw_rad=0,
        surge_mps=0,
        sway_mps=0,
        yaw_rate_radps=0,
    )
    while seen.received < 3:
        publisher.put(pose)
        await asyncio.sleep(0.02)
    assert hidden.received == 0


async def test_a_wrong_password_does_not_get_in(open_as: OpenAs, config: Config, private_sets: tuple[str, ...]) -> None:
    await open_as("observer")
    other = load_config(sets=(*private_sets, f"bus.runtime_dir={config.bus.runtime_dir}-other"))
    await asyncio.to_thread(ensure_credentials, other.bus)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(2.5):
            await open_bus(other.bus, "controller", CLOCK)


async def test_newest_wins_and_the_rest_is_counted(open_as: OpenAs) -> None:
    plant, controller = await open_as("plant"), await open_as("controller")
    inbox = plant.latest(keys.THRUST)
    own = controller.publisher(keys.THRUST)
    await until_received(own, inbox)
    await inbox.next()
    start = inbox.received
    for index in range(20):
        own.put(thrust(left=index / 20))
    await until(lambda: inbox.received == start + 20)
    assert (await inbox.next()).left == 19 / 20
    assert inbox.superseded >= 19


async def test_pictures_are_pulled_one_at_a_time(open_as: OpenAs) -> None:
    camera, dashboard = await open_as("camera"), await open_as("dashboard")
    pictures = camera.picture_publisher(keys.PICTURE, push=False)
    pulled = dashboard.pull_picture(keys.PICTURE)
    taken_us = CLOCK.now_us() - 1_000_000
    header = m.PictureHeader(source_us=taken_us, frame_seq=0, frame_epoch=1, width_px=4, height_px=3)
    seen = []
    for index in range(5):
        pictures.put_picture(msgspec.structs.replace(header, source_us=taken_us + index), b"jpeg %d" % index)
        picture = await asyncio.wait_for(pulled.next(), 5)
        seen.append((picture.data, picture.header.source_us, picture.header.width_px, picture.header.height_px))
    assert seen == [(b"jpeg %d" % index, taken_us + index, 4, 3) for index in range(5)], "each with its own stamp (B1)"
    pictures.new_epoch()
    pictures.put_picture(header, b"again")
    assert (await asyncio.wait_for(pulled.next(), 5)).data == b"again"


async def test_pictures_are_pulled_on_after_the_clock_was_set_back(config: Config) -> None:
    """To before the publisher began: its new epoch is lower than that of the picture that was pulled last."""
    clock = ManualClock(CLOCK.now_us())
    router = await open_router(config.bus)
    camera, dashboard = await open_bus(config.bus, "camera", clock), await open_bus(config.bus, "dashboard", clock)
    pictures, pulled = camera.picture_publisher(keys.PICTURE, push=False), dashboard.pull_picture(keys.PICTURE)
    for number in range(3):
        header = m.PictureHeader(source_us=clock.now_us(), frame_seq=number, frame_epoch=1, width_px=4, height_px=3)
        pictures.put_picture(header, b"jpeg %d" % number)
        assert (await asyncio.wait_for(pulled.next(), 5)).data == b"jpeg %d" % number
        clock.advance(0.2 if number == 0 else -3600.0)
    for bus in (camera, dashboard):
        await bus.close()
    await asyncio.to_thread(router.close)


async def test_services_find_each_other_again_after_the_router_dies(config: Config) -> None:
    router = await open_router(config.bus)
    plant = await open_bus(config.bus, "plant", CLOCK)
    controller = await open_bus(config.bus, "controller", CLOCK)
    inbox, own = plant.latest(keys.THRUST), controller.publisher(keys.THRUST)
    for _ in range(2):
        start = inbox.received
        async with asyncio.timeout(5):
            while inbox.received == start:
                own.put(thrust())
                await asyncio.sleep(0.02)
        await asyncio.to_thread(router.close)
        own.put(thrust())  # on a dead link: neither blocks nor raises
        router = await open_router(config.bus)
    for bus in (plant, controller):
        await bus.close()
    await asyncio.to_thread(router.close)


async def test_alive_means_ready(open_as: OpenAs, spawn: Spawn) -> None:
    observer = await open_as("observer")
    async with spawn("advisor"):
        health = observer.latest(keys.health("advisor"))
        report = await asyncio.wait_for(health.next(), 5)
        assert report.ready
        assert {entry.topic for entry in report.inputs} >= {keys.EVIDENCE.name}
        assert report.rss_mib > 10


async def test_a_report_that_fails_ends_the_service(open_as: OpenAs, config: Config) -> None:
    bus, folder = await open_as("controller"), Path(config.bus.runtime_dir)
    beside = folder.with_name("elsewhere")
    await asyncio.to_thread(folder.rename, beside)
    await asyncio.to_thread(folder.symlink_to, beside)
    with pytest.raises(UserError, match=r"bus\.runtime_dir .*: is a link"), bus.alive():
        await asyncio.Event().wait()


async def test_a_process_gives_back_what_it_has_freed(open_as: OpenAs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("paani.bus.bus.RECYCLE_S", 0.0)
    bus, full = await open_as("advisor"), list[dict[str, int]]()
    collected = lambda phase, info: full.append(info) if phase == "stop" and info["generation"] == 2 else None  # noqa: E731
    gc.unfreeze()
    try:
        with bus.alive():
            assert gc.get_freeze_count() > 0
            gc.callbacks.append(collected)
            await until(lambda: bool(full))
    finally:
        gc.unfreeze()
        gc.callbacks.remove(collected)


async def test_a_picture_is_watched_by_subscribers_and_by_those_who_pull(open_as: OpenAs) -> None:
    perception, observer, dashboard = await open_as("perception"), await open_as("observer"), await open_as("dashboard")
    masks = perception.picture_publisher(keys.MASK)
    pulled_only = perception.picture_publisher(keys.MASK, push=False)
    await asyncio.sleep(0.3)
    assert not masks.is_watched()
    observer.latest_picture(keys.MASK)
    await until(masks.is_watched)
    assert not pulled_only.is_watched()
    async with at_work(dashboard.pull_picture(keys.MASK).next()):
        await until(pulled_only.is_watched)


async def test_what_is_too_large_is_dropped_and_disturbs_nobody(open_as: OpenAs) -> None:
    plant, controller = await open_as("plant"), await open_as("controller")
    inbox, own = plant.latest(keys.THRUST), controller.publisher(keys.THRUST)
    await until_received(own, inbox)
    put_raw(controller, "controller/thrust", b" " * (MAX_MESSAGE_BYTES + 1))
    await until(lambda: plant.drops["oversized"] == 1)
    await until_accepted(own, inbox, 0.4)


async def test_what_no_link_takes_cuts_off_its_sender_alone(open_as: OpenAs) -> None:
    plant, controller, advisor = await open_as("plant"), await open_as("controller"), await open_as("advisor")
    inbox, own = plant.latest(keys.THRUST), controller.publisher(keys.THRUST)
    await until_received(own, inbox)
    put_raw(advisor, "advisor/advisory", b" " * (MAX_BYTES + 1))
    await until_accepted(own, inbox, 0.4)


async def until_accepted(own: Publisher[m.Thrust], inbox: Latest[m.Thrust], left: float) -> None:
    async with asyncio.timeout(5.0):
        while inbox.value is None or inbox.value.left != left:
            own.put(thrust(left=left))
            await asyncio.sleep(0.02)


async def test_strangers_that_say_nothing_keep_nobody_out(open_as: OpenAs, config: Config) -> None:
    """Zenoh alone waits 10 s for each of a hundred of them before it lets anybody else in."""
    await open_as("plant")
    _, _, address = config.bus.router.partition("/")
    host, _, port = address.partition(":")
    silent = [await asyncio.open_connection(host, int(port)) for _ in range(150)]
    try:
        async with asyncio.timeout(4.0):
            await open_as("controller")
    finally:
        for _, writer in silent:
            writer.close()
