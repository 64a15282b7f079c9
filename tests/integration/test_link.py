"""Two routers, of board and host: what passes between them, and what the credential of the link is good for."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import NamedTuple

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER, ensure_credentials
from paani.bus import Bus, Latest, Picture, Stepper, open_bus
from paani.bus.routing import open_router
from paani.clock import Clock, WallClock
from paani.config import BusConfig, Config, load_config
from paani.decider import decider_of
from paani.errors import UserError
from paani.link_access import LINK
from paani.sides import Side
from paani_services.router.picture_exchange import connected_to_board, exchange_pictures
from paani_services.router.route_watch import HEARD_S, WATCHED, watch_route
from tests.at_work import at_work
from tests.bus_peers import joined, routing, until
from tests.conftest import find_free_port, put_raw

pytestmark = pytest.mark.integration
CLOCK = WallClock()
NAVIGATOR = decider_of("navigator")


class Sides(NamedTuple):
    board: BusConfig
    host: BusConfig


@pytest.fixture
async def sides(tmp_path: Path) -> Sides:
    link = f"tcp/127.0.0.1:{find_free_port()}"
    board, host = (
        load_config(
            sets=(
                f"bus.side={side}",
                f"bus.link={link}",
                f"bus.router=tcp/127.0.0.1:{find_free_port()}",
                f"bus.runtime_dir={tmp_path}",
            )
        ).bus
        for side in (Side.BOARD, Side.HOST)
    )
    await asyncio.to_thread(ensure_credentials, board)
    return Sides(board, host)


def tracks() -> m.Tracks:
    return m.Tracks(source_us=CLOCK.now_us(), frame_seq=0, frame_epoch=0, tracks=())


def thrust(left: float = 0.1) -> m.Thrust:
    return m.Thrust(source_us=CLOCK.now_us(), left=left, right=0.1, enabled=True)


async def test_messages_and_readiness_cross_both_ways_whoever_is_first(sides: Sides) -> None:
    """The host starts before its board, loses it, and has it again: by itself."""
    async with routing(sides.host), joined(sides.host, "controller") as controller:
        for _ in range(2):
            await require_crossing(sides, controller)


async def require_crossing(sides: Sides, controller: Bus) -> None:
    async with (
        routing(sides.board),
        joined(sides.board, "advisor") as advisor,
        joined(sides.board, OBSERVER) as on_board,
        joined(sides.host, OBSERVER) as on_host,
    ):
        alive: set[str] = set()
        async with at_work(follow(on_host, alive)):
            with advisor.alive():
                seen, commanded = on_host.latest(keys.TRACKS), on_board.latest(keys.THRUST)
                written, ordered = advisor.publisher(keys.TRACKS), controller.publisher(keys.THRUST)
                await until(lambda: seen.received > 2, lambda: written.put(tracks()))
                await until(lambda: commanded.received > 2, lambda: ordered.put(thrust()))
                await until(lambda: "advisor" in alive)
            await until(lambda: "advisor" not in alive)


async def follow(bus: Bus, alive: set[str]) -> None:
    async for service, is_alive in bus.alive_events():
        (alive.add if is_alive else alive.discard)(service)


async def test_the_links_credential_writes_nothing_of_the_boards(sides: Sides) -> None:
    """At the board it passes for the host, and for nobody of the board; at the host it is nobody."""
    async with contextlib.AsyncExitStack() as stack:
        for router in sides:
            await stack.enter_async_context(routing(router))
        advisor = await stack.enter_async_context(joined(sides.board, "advisor"))
        on_board, on_host = [await stack.enter_async_context(joined(side, OBSERVER)) for side in sides]
        at_board, at_host = on_board.latest(keys.TRACKS), on_host.latest(keys.TRACKS)
        thrust_there = on_board.latest(keys.THRUST)
        own = advisor.publisher(keys.TRACKS)
        await until(lambda: at_host.received > 0, lambda: own.put(tracks()))
        stranger_at_link = replace(sides.board, router=sides.board.link)
        async with joined(stranger_at_link, LINK) as stranger, joined(sides.host, LINK) as at_home:
            forged = stranger.publisher(keys.THRUST)
            await until(lambda: thrust_there.received > 0, lambda: forged.put(thrust()))
            before = (at_board.received, at_host.received, thrust_there.received)
            for forger in (stranger, at_home):
                for key in (keys.TRACKS.name, keys.ADVISORY.name, "advisor/*", "**", keys.PICTURE.name):
                    put_raw(forger, key, b"{}")
            put_raw(at_home, keys.THRUST.name, b"{}")
            last = own.put(tracks())
            await until(lambda: at_host.value is not None and at_host.value.seq == last.seq)
            await until(lambda: at_board.value is not None and at_board.value.seq == last.seq)
        assert (at_board.received, at_host.received) == (before[0] + 1, before[1] + 1)
        assert thrust_there.received == before[2]
        assert not on_board.drops
        assert not on_host.drops


@pytest.mark.parametrize("user", ["controller", "navigator", "dashboard"])
async def test_nobody_of_the_host_writes_at_the_boards_router(sides: Sides, user: str) -> None:
    """A process of the host is a subject of its own router alone, though its password opens the board's door."""
    topic: keys.Topic[m.Health] = keys.health(user)
    async with routing(sides.board), routing(sides.host), joined(sides.board, OBSERVER) as on_board:
        heard = on_board.latest(topic)
        async with (
            joined(sides.host, user) as at_home,
            joined(replace(sides.board, router=sides.board.link), user) as lost,
        ):
            own, astray = at_home.publisher(topic), lost.publisher(topic)
            report = m.Health(source_us=CLOCK.now_us(), service=user, ready=True, uptime_s=0, cpu_cores=0, rss_mib=1)
            await until(lambda: heard.received > 0, lambda: own.put(report))
            last = own.put(report)
            await until(lambda: heard.value is not None and heard.value.seq == last.seq)
            before = heard.received
            for _ in range(5):
                astray.put(report)
            last = own.put(report)
            await until(lambda: heard.value is not None and heard.value.seq == last.seq)
        assert heard.received == before + 1


async def exchange_with_board(router: Bus, host: BusConfig) -> None:
    async with connected_to_board(host, CLOCK) as board:
        await exchange_pictures(router, board, host.graph)


@pytest.mark.parametrize("is_joined", [True, False])
async def test_a_board_heard_only_beside_the_routers_is_told(sides: Sides, is_joined: bool) -> None:
    """And neither one that both hear nor one that nobody hears."""
    nowhere = replace(sides.host, link=f"tcp/127.0.0.1:{find_free_port()}")
    async with (
        routing(sides.board),
        routing(sides.host if is_joined else nowhere),
        joined(sides.board, WATCHED) as board,
        joined(sides.host, "router") as router,
        connected_to_board(sides.host, CLOCK) as beside,
    ):
        pulse = keys.pulse(WATCHED)
        direct, routed, beats = beside.latest(pulse), router.latest(pulse), board.publisher(pulse)
        await until(
            lambda: direct.received > 0 and (routed.received > 0 or not is_joined),
            lambda: beats.put(m.Pulse(source_us=CLOCK.now_us())),
        )

        async def beat() -> None:
            while True:
                beats.put(m.Pulse(source_us=CLOCK.now_us()))
                await asyncio.sleep(0.1)

        async with at_work(beat()):
            with pytest.raises(TimeoutError if is_joined else ConnectionError):
                await asyncio.wait_for(watch_route(direct, routed, 0.6), 3.0 if is_joined else 20.0)
        await until(lambda: direct.receipt_age_s() > HEARD_S)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(watch_route(direct, routed, 0.4), 1.5)


async def test_pictures_are_pulled_across_and_look_pushed_at_home(sides: Sides) -> None:
    """Both ways: the board's to whoever subscribes on the host, the host's to whoever pulls on the board."""
    header = m.PictureHeader(source_us=CLOCK.now_us(), frame_seq=0, frame_epoch=1, width_px=4, height_px=3)
    async with (
        routing(sides.board),
        routing(sides.host),
        joined(sides.board, "camera") as camera,
        joined(sides.host, "eye") as eye,
        joined(sides.host, "router") as router,
        joined(sides.host, OBSERVER) as watcher,
        at_work(exchange_with_board(router, sides.host)),
    ):
        taken, drawn = camera.picture_publisher(keys.PICTURE), eye.picture_publisher(keys.RENDERED)
        seen, pulled = watcher.latest_picture(keys.PICTURE), camera.pull_picture(keys.RENDERED)
        for index in range(3):
            taken.put_picture(header, b"taken %d" % index)
            assert (await asyncio.wait_for(seen.next(), 10)).data == b"taken %d" % index
        for index in range(3):
            drawn.put_picture(header, b"drawn %d" % index)
            assert (await asyncio.wait_for(pulled.next(), 10)).data == b"drawn %d" % index
        assert (await asyncio.wait_for(pulled_header(pulled, drawn, header), 10)).producer == "eye"


async def pulled_header(pulled: object, drawn: object, header: m.PictureHeader) -> m.PictureHeader:
    drawn.put_picture(header, b"last")  # type: ignore[attr-defined]
    picture = await pulled.next()  # type: ignore[attr-defined]
    found: m.PictureHeader = picture.header
    return found


async def test_a_side_without_a_link_does_not_start(sides: Sides) -> None:
    for config in sides:
        with pytest.raises(UserError, match=r"bus\.link: not set \(board and host meet at tcp/ADDRESS:PORT"):
            await open_router(replace(config, link=""))


async def test_a_door_that_stays_shut_is_told_from_one_that_is_not_there(
    sides: Sides, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Another boat's credentials: who waits is told that they are the reason."""
    other = replace(sides.board, router=sides.board.link, runtime_dir=str(tmp_path / "other"))
    await asyncio.to_thread(ensure_credentials, other)
    async with at_work(open_bus(other, LINK, CLOCK)):
        await until(lambda: f"{other.router} does not answer" in caplog.text)
        async with routing(sides.board):
            await until(
                lambda: f"{other.router} lets nobody in by these credentials, which are of a simulation" in caplog.text
            )


class ClockApart:
    """A wall clock that is set otherwise than this machine's."""

    def __init__(self, ahead_s: float) -> None:
        self._ahead_us = round(ahead_s * 1e6)

    def now_us(self) -> int:
        return CLOCK.now_us() + self._ahead_us


@pytest.mark.parametrize("ahead_s", [-3600.0, -5.0, 5.0, 3600.0])
async def test_board_and_host_need_no_common_time(sides: Sides, ahead_s: float) -> None:
    """What the board says is as old on the host as it is, and a step of the host writes down by which stamp it went."""
    there = ClockApart(ahead_s)
    async with contextlib.AsyncExitStack() as stack:
        for router in sides:
            await stack.enter_async_context(routing(router))
        advisor = await open_bus(sides.board, "advisor", there)
        stack.push_async_callback(advisor.close)
        operator, navigator, observer = [
            await stack.enter_async_context(joined(sides.host, user)) for user in ("operator", "navigator", OBSERVER)
        ]
        stack.enter_context(advisor.alive())
        stack.enter_context(operator.alive())
        stepper, steps = (
            Stepper(navigator, CLOCK, Config(), NAVIGATOR),
            observer.queue(keys.STEPS["navigator"]),
        )
        advice, armed = advisor.publisher(keys.ADVISORY), operator.publisher(keys.ARMING)
        heard_there = advisor.latest(keys.ARMING)
        inbox = stepper.inboxes[keys.ADVISORY.name]

        def say() -> None:
            straight = m.Advisory(
                source_us=there.now_us() - 200_000, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR
            )
            advice.put(straight)
            armed.put(m.Arming(source_us=CLOCK.now_us(), armed=True))

        def age_s(value: m.Message | None, now_us: int) -> float:
            return float("inf") if value is None else (now_us - value.source_us) * 1e-6

        await until(lambda: 0.2 <= age_s(inbox.value, CLOCK.now_us()) < 2.0, say)
        await until(lambda: 0.0 <= age_s(heard_there.value, there.now_us()) < 2.0, say)
        await until(lambda: steps.received > 0, lambda: stepper.conclude(stepper.decide()[1]))
        given, step = inbox.value, steps.drain()[-1]
        stamp_us = {heard.topic: heard.source_us for heard in step.heard}[keys.ADVISORY.name]
        assert given is not None
        assert stamp_us == given.source_us
        assert all(sent.steady_us for sent in step.sent)
        refused, received = navigator.drops.total(), inbox.received
        await until(lambda: inbox.received > received + 5, say)
        assert navigator.drops.total() == refused


@pytest.mark.parametrize("ahead_s", [-5.0, 5.0])
async def test_pictures_are_as_old_on_the_other_machine_as_they_are(sides: Sides, ahead_s: float) -> None:
    """Though the host's router hands them on in between."""
    there = ClockApart(ahead_s)
    async with contextlib.AsyncExitStack() as stack:
        for router in sides:
            await stack.enter_async_context(routing(router))
        advisor, camera = [await open_bus(sides.board, user, there) for user in ("advisor", "camera")]
        stack.push_async_callback(advisor.close)
        stack.push_async_callback(camera.close)
        operator, eye, hands_on, watcher = [
            await stack.enter_async_context(joined(sides.host, user))
            for user in ("operator", "eye", "router", OBSERVER)
        ]
        stack.enter_context(advisor.alive())
        stack.enter_context(operator.alive())
        taken, drawn = camera.picture_publisher(keys.PICTURE), eye.picture_publisher(keys.RENDERED)
        seen, pulled = watcher.latest_picture(keys.PICTURE), camera.pull_picture(keys.RENDERED)

        def show() -> None:
            for output, clock in ((taken, there), (drawn, CLOCK)):
                source_us = clock.now_us() - 200_000
                header = m.PictureHeader(source_us=source_us, frame_seq=0, frame_epoch=1, width_px=4, height_px=3)
                output.put_picture(header, b"data")

        def age_s(inbox: Latest[Picture], clock: Clock) -> float:
            return float("inf") if inbox.value is None else (clock.now_us() - inbox.value.header.source_us) * 1e-6

        async with at_work(exchange_with_board(hands_on, sides.host), keep_up(pulled)):
            await until(lambda: 0.2 <= age_s(seen, CLOCK) < 2.0, show)
            await until(lambda: 0.2 <= age_s(pulled, there) < 2.0, show)


async def keep_up(pulled: Latest[Picture]) -> None:
    while True:
        await pulled.next()


async def test_stop_is_heard_from_a_board_whose_clock_is_ahead(sides: Sides) -> None:
    """Whatever else is known of its clock: nobody on the board echoes here."""
    async with routing(sides.board), routing(sides.host), joined(sides.host, "operator") as operator:
        stop = await open_bus(sides.board, "stop", ClockApart(5.0))
        try:
            asked, ask = operator.latest(keys.REQUESTS["stop"]), stop.publisher(keys.REQUESTS["stop"])
            await until(
                lambda: asked.received > 0,
                lambda: ask.put(m.OperatorRequest(source_us=CLOCK.now_us(), act=m.RequestAct.STOP, press=1)),
            )
        finally:
            await stop.close()
