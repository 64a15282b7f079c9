"""The bus of one drive in lockstep: messages between processes take no time, and every stamp is simulated time.

It fills the header as the live bus does and shows every message to whoever records the drive.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from paani import messages as m
from paani.clock import Clock
from paani.decider import Input
from paani.keys import Topic
from paani_sim.plant.plant import Plant

T = TypeVar("T", bound=m.Message)
START_US = 1_800_000_000_000_000  # the first stamp of every drive, so that equal drives are equal to the byte


class PlantClock:
    """Simulated time of the plant, counted from `START_US`."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def now_us(self) -> int:
        """See `paani.clock.Clock`."""
        return START_US + self._plant.sim_us


class MessageTap(Protocol):
    """Receives every message as sent; `data` are a picture's bytes."""

    def __call__(self, topic: Topic[m.Message], message: m.Message, now_us: int, data: bytes = b"") -> None: ...


class LockstepInbox:
    """The newest message of one topic that was delivered."""

    def __init__(self) -> None:
        self.newest = Input()


class LockstepPublisher:
    """Publishes messages of one topic on a `LockstepBus`."""

    def __init__(self, bus: LockstepBus, topic: Topic[Any]) -> None:
        self._bus, self._topic = bus, topic

    def put(self, message: Any) -> Any:
        """Fill in the header; returns the message as sent."""
        return self._bus.put(self._topic, message)


class LockstepBus:
    """Numbers the messages of one drive. Publishing delivers nothing: the drive decides what arrives, and when."""

    def __init__(self, clock: Clock, domain: int, tap: MessageTap | None = None) -> None:
        """`tap` None: nobody records."""
        self.epoch = START_US // 1000
        self.tap = tap
        self._clock, self._domain = clock, domain
        self._seq: dict[str, int] = {}
        self._inboxes: dict[str, LockstepInbox] = {}

    def latest(self, topic: Topic[Any]) -> LockstepInbox:
        """The inbox of a topic; every process reads the same one."""
        return self._inboxes.setdefault(topic.name, LockstepInbox())

    def publisher(self, topic: Topic[Any]) -> LockstepPublisher:
        """Write one topic."""
        return LockstepPublisher(self, topic)

    def put(self, topic: Topic[T], message: T, data: bytes = b"") -> T:
        """Fill in the header as of now; returns the message as sent."""
        now_us = self._clock.now_us()
        seq = self._seq[topic.name] = self._seq.get(topic.name, -1) + 1
        sent = topic.stamp(message, domain=self._domain, seq=seq, epoch=self.epoch, sent_us=now_us)
        if self.tap is not None:
            self.tap(topic, sent, now_us, data)  # type: ignore[arg-type]  # a topic of one message type is one of messages
        return sent

    def deliver(self, topic: Topic[Any], message: m.Message) -> None:
        """A sent message arrives now at every process that subscribes to its topic."""
        self.latest(topic).newest = Input(message, self._clock.now_us())
