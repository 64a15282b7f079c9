"""One session per process; everything a service may do with it."""

from __future__ import annotations

import asyncio
import collections
import contextlib
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any, TypeVar

import msgspec
import zenoh

from paani import keys
from paani import messages as m
from paani.bus.admission import Admission, ShiftUs, same_clock, since_sent
from paani.bus.hearing import Hearing
from paani.bus.inbox import Inbox, Latest, Queue
from paani.bus.other_machine import OtherMachine
from paani.bus.publish import LONG_POLL_S, PicturePublisher, Publisher
from paani.bus.raw import RawInbox
from paani.bus.session import open_client
from paani.clock import Clock, MachineClock, MonotonicClock
from paani.config import BusConfig
from paani.health import HealthReporter
from paani.heartbeat import Heartbeat
from paani.link_access import LINK
from paani.memory import RECYCLE_S, recycle, set_loaded_apart
from paani.runtime import runtime_dir
from paani.sides import ECHOES, ROUTER, Side, is_sent_from

T = TypeVar("T", bound=m.Message)
MAX_PICTURE_BYTES = 16 << 20  # encoded; a 12-megapixel JPEG of the best quality is half of it


class Picture(msgspec.Struct, frozen=True):
    """Encoded picture bytes and the header that travelled with them."""

    header: m.PictureHeader
    data: bytes


class Bus:
    """Typed access to the bus for one user. Made by `open_bus`."""

    def __init__(self, session: zenoh.Session, config: BusConfig, user: str, clock: Clock) -> None:
        self._session, self._config, self.user, self._clock = session, config, user, clock
        self._loop = asyncio.get_running_loop()
        self._declared: list[object] = []
        self._steady = MachineClock() if config.side is not Side.BOTH else None
        self._other: OtherMachine | None = None
        self.inputs: list[tuple[keys.Topic[Any], Inbox[Any]]] = []
        self.drops: collections.Counter[str] = collections.Counter()
        self.note_text = ""

    @property
    def prefix(self) -> str:
        return f"paani/{self._config.domain}/{self._config.vessel}"

    @property
    def graph(self) -> keys.Graph:
        return self._config.graph

    def latest(self, topic: keys.Topic[T]) -> Latest[T]:
        """Subscribe, newest wins."""
        inbox: Latest[T] = Latest(self._clock)
        self._watch(topic, inbox)
        self._subscribe(topic, inbox.offer)
        return inbox

    def queue(self, topic: keys.Topic[T], depth: int = 64) -> Queue[T]:
        """Subscribe with a short queue that drops its oldest."""
        inbox: Queue[T] = Queue(self._clock, depth)
        self._watch(topic, inbox)
        self._subscribe(topic, inbox.offer)
        return inbox

    def on(self, topic: keys.Topic[T], callback: Callable[[T], None]) -> None:
        """Subscribe with a function that Zenoh's thread calls; it must return at once."""
        self._subscribe(topic, callback)

    def raw(self, topic: keys.Topic[Any], depth: int) -> RawInbox:
        """Subscribe to what is on the topic as it is, unjudged."""
        return RawInbox(self._session, self._key(topic), depth, self._clock)

    def latest_picture(self, topic: keys.Topic[m.PictureHeader]) -> Latest[Picture]:
        """Subscribe to pictures pushed on this machine."""
        inbox: Latest[Picture] = Latest(self._clock)
        admission = self._admission(topic)
        self._watch(topic, inbox)

        def offer(sample: zenoh.Sample) -> None:
            picture = self._admit_picture(admission, sample)
            if picture is not None:
                inbox.offer(picture)

        self._declare_subscriber(topic, offer)
        return inbox

    def pull_picture(self, topic: keys.Topic[m.PictureHeader]) -> PulledPicture:
        """Pull pictures one at a time: nothing travels unless `next` waits for it."""
        pulled = PulledPicture(self, topic, self._admission(topic), self._clock)
        self._watch(topic, pulled)
        return pulled

    def publisher(self, topic: keys.Topic[T]) -> Publisher[T]:
        """The right to write is the router's to give: only the topic's producer in this graph is heard."""
        row, domain = self._row(topic), self._config.domain
        return Publisher(self._session, row, self._key(topic), domain, self._clock, self._steady)

    def picture_publisher(self, topic: keys.Topic[m.PictureHeader], *, push: bool = True) -> PicturePublisher:
        """Pictures: pushed on this machine unless `push` is false, and always there to be pulled."""
        row, domain = self._row(topic), self._config.domain
        return PicturePublisher(self._session, row, self._key(topic), domain, self._clock, self._steady, push=push)

    @contextlib.contextmanager
    def alive(self) -> Iterator[None]:
        """Declare this service alive, which means ready; start its pulse and its health report.

        A process that does not hear the bus any more reports no health and no heartbeat, so that whoever supervises it
        starts it again. What fails in reporting ends the service: the context raises it.
        """
        set_loaded_apart()
        token = self._session.liveliness().declare_token(f"{self.prefix}/{keys.alive_name(self.user)}")
        reporter = HealthReporter(self.user, self.inputs, self.drops, lambda: self.note_text)
        tasks = [asyncio.create_task(self._report(reporter), name="health")]
        if self.user in keys.BEATING_SERVICES:
            tasks.append(asyncio.create_task(self._beat(), name="pulse"))
        owner, failures = asyncio.current_task(), list[BaseException]()

        def note_end(task: asyncio.Task[None]) -> None:
            if owner is not None and not task.cancelled() and (failure := task.exception()) is not None:
                failures.append(failure)
                owner.cancel()

        for task in tasks:
            task.add_done_callback(note_end)
        try:
            yield
        except asyncio.CancelledError:
            if failures:
                raise failures[0] from None
            raise
        finally:
            for task in tasks:
                task.cancel()
            with contextlib.suppress(zenoh.ZError):
                token.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs

    async def alive_events(self) -> AsyncIterator[tuple[str, bool]]:
        """Services that become alive (True) or vanish (False), those alive already first."""
        events: asyncio.Queue[tuple[str, bool]] = asyncio.Queue()

        def changed(sample: zenoh.Sample) -> None:
            service = str(sample.key_expr).rpartition("/")[2]
            event = (service, sample.kind == zenoh.SampleKind.PUT)
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(events.put_nowait, event)

        subscriber = self._session.liveliness().declare_subscriber(
            f"{self.prefix}/{keys.alive_name('*')}", zenoh.handlers.Callback(changed, indirect=False), history=True
        )
        try:
            while True:
                yield await events.get()
        finally:
            with contextlib.suppress(zenoh.ZError):
                subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs

    def count_drop(self, cause: str, n: int = 1) -> None:
        """Count something refused; the health report shows it."""
        self.drops[cause] += n

    def note(self, text: str) -> None:
        """One short line for the health report."""
        self.note_text = text[:200].encode(errors="replace").decode()  # a file's name may be no text

    async def close(self) -> None:
        await asyncio.to_thread(self._session.close)

    async def fetch(self, topic: keys.Topic[m.PictureHeader], after: tuple[int, int]) -> zenoh.Sample | None:
        """One long poll for a picture newer than `after` (epoch, seq)."""
        samples: list[zenoh.Sample] = []
        done = self._loop.create_future()
        cancellation = zenoh.CancellationToken()

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                samples.append(reply.ok)

        def finish() -> None:
            if not done.done():
                done.set_result(None)

        def on_done() -> None:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(finish)

        self._session.get(
            f"{self._key(topic)}?after={after[0]}.{after[1]}",
            zenoh.handlers.Callback(on_reply, on_done, indirect=False),
            timeout=LONG_POLL_S + 0.5,
            cancellation_token=cancellation,
        )
        try:
            await done
        except asyncio.CancelledError:
            cancellation.cancel()  # type: ignore[no-untyped-call]  # zenoh's stubs
            raise
        return samples[0] if samples else None

    def _key(self, topic: keys.Topic[T]) -> str:
        return topic.key(self._config.domain, self._config.vessel)

    def _admission(self, topic: keys.Topic[T]) -> Admission[T]:
        row, domain, max_future_s = self._row(topic), self._config.domain, self._config.max_future_s
        return Admission(row, domain, max_future_s, self._clock_difference(row), as_sent=self.user == LINK)

    def _clock_difference(self, row: keys.Topic[T]) -> ShiftUs:
        """By how much this machine's clock is ahead of the one that stamps a topic; see `other_machine`.

        The other machine's pulses, and STOP, which may come from either, are never of the future: their receivers ask
        when they came, not when they were sent. Nor are the pictures that a router only hands on. The shore of a fleet
        has a clock of its own, which nobody learns.
        """
        side = self._config.side
        if keys.SHORE in {self.user, row.producer}:
            return since_sent
        is_other = is_sent_from(side.other, row, self._config.graph)
        if side is Side.BOTH or not (is_other or row.producer in keys.STOPPING_CLIENTS):
            return same_clock
        if not is_other or row.type is m.Pulse or self.user == LINK:
            return since_sent
        return self._listen_to_other().shift_us

    def _listen_to_other(self) -> OtherMachine:
        """The other machine's clock, learnt from the pulses of the process that echoes there."""
        if self._other is None:
            self._other = OtherMachine(MachineClock())
            self._subscribe(keys.pulse(ECHOES[self._config.side.other]), self._other.note_pulse)
        return self._other

    def _row(self, topic: keys.Topic[T]) -> keys.Topic[T]:
        return keys.topic_in(topic, self._config.graph)

    def _watch(self, topic: keys.Topic[T], inbox: Inbox[Any]) -> None:
        self.inputs.append((topic, inbox))

    def _subscribe(self, topic: keys.Topic[T], offer: Callable[[T], None]) -> None:
        admission = self._admission(topic)

        def receive(sample: zenoh.Sample) -> None:
            message, cause = admission.judge(sample.payload.to_bytes(), self._clock.now_us())
            if message is None:
                self.drops[cause] += 1
            else:
                offer(message)

        self._declare_subscriber(topic, receive)

    def _declare_subscriber(self, topic: keys.Topic[T], receive: Callable[[zenoh.Sample], None]) -> None:
        key = self._key(topic)

        def exact(sample: zenoh.Sample) -> None:
            if str(sample.key_expr) == key and sample.kind == zenoh.SampleKind.PUT:
                receive(sample)
            else:
                self.drops["wrong_key"] += 1

        self._declared.append(self._session.declare_subscriber(key, zenoh.handlers.Callback(exact, indirect=False)))

    def _admit_picture(self, admission: Admission[m.PictureHeader], sample: zenoh.Sample) -> Picture | None:
        if len(sample.payload) > MAX_PICTURE_BYTES:
            self.drops["oversized"] += 1
            return None
        attachment = sample.attachment.to_bytes() if sample.attachment is not None else b""
        header, cause = admission.judge(attachment, self._clock.now_us())
        if header is None:
            self.drops[cause] += 1
            return None
        return Picture(header, sample.payload.to_bytes())

    async def _beat(self) -> None:
        topic = keys.pulse(self.user)
        publisher = self.publisher(topic)
        other = self._listen_to_other() if self.user == ECHOES.get(self._config.side) else None
        while True:
            echo_us, heard_us = other.echo if other is not None else (0, 0)
            publisher.put(m.Pulse(source_us=self._clock.now_us(), echo_us=echo_us, heard_us=heard_us))
            await asyncio.sleep(1.0 / topic.rate_hz)

    def _is_connected(self) -> bool:
        """Whether there is another process's router at the other end; the router's own process does not hear itself."""
        return self.user != ROUTER and bool(self._session.info.routers_zid())

    async def _report(self, reporter: HealthReporter) -> None:
        publisher = self.publisher(keys.health(self.user))
        heartbeat = Heartbeat(await asyncio.to_thread(runtime_dir, self._config), self.user)
        steady = MonotonicClock()
        hearing = Hearing(steady, self._is_connected)
        self._declare_subscriber(keys.health(ROUTER), lambda sample: hearing.note())
        await asyncio.to_thread(heartbeat.ready)
        recycled_us = steady.now_us()
        while True:
            if steady.now_us() - recycled_us >= RECYCLE_S * 1e6:
                recycle()
                recycled_us = steady.now_us()
            if not await asyncio.to_thread(hearing.is_deaf):
                publisher.put(await asyncio.to_thread(reporter.report, self._clock.now_us()))
                await asyncio.to_thread(heartbeat.beat)
            await asyncio.sleep(1.0)


class PulledPicture(Latest[Picture]):
    """Same interface as a subscription; each `next` is one long poll after the last picture seen."""

    def __init__(
        self, bus: Bus, topic: keys.Topic[m.PictureHeader], admission: Admission[m.PictureHeader], clock: Clock
    ) -> None:
        super().__init__(clock)
        self._bus, self._topic, self._admission = bus, topic, admission

    async def next(self) -> Picture:
        """The newest picture after the last one returned; waits for one."""
        while True:
            header = self.value.header if self.value else None
            sample = await self._bus.fetch(self._topic, (header.epoch, header.seq) if header else (0, 0))
            picture = self._bus._admit_picture(self._admission, sample) if sample is not None else None
            if picture is not None:
                self.offer(picture)
                self._taken = True
                return picture
            await asyncio.sleep(0.05)


async def open_bus(config: BusConfig, user: str, clock: Clock) -> Bus:
    """Open the session of one user; waits for the router as long as it takes."""
    return Bus(await open_client(config, user), config, user, clock)
