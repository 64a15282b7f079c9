"""The newest of everything, and the clients who watch it. Pure: no sockets, no clock."""

from __future__ import annotations

import asyncio
from collections import deque

import msgspec

from paani import messages as m
from paani.bus import Picture
from paani_services.dashboard.frames import FrameHeader, encode_frame
from paani_services.dashboard.slots import Slots

EVENT_KEY = "dashboard/event"
KEPT_EVENTS = 24
Value = m.Message | Picture | msgspec.Struct


class Event(msgspec.Struct, frozen=True):
    """A line for the page's log. `level` is `info`, `warn` or `stop`."""

    at_us: int
    level: str
    text: str


class Client:
    """Slots and the bell that wakes their sender."""

    def __init__(self) -> None:
        self.slots = Slots()
        self.bell = asyncio.Event()


class Hub:
    """Keeps the newest value of each key for those who join late; encodes only while somebody watches."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self.watched = asyncio.Event()
        self._values: dict[str, tuple[Value, int]] = {}
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)

    def join(self, now_us: int) -> Client:
        """A new client, with everything there is already in its slots."""
        client = Client()
        for key, (value, received_us) in self._values.items():
            client.slots.put_state(key, frame_of(key, value, now_us - received_us))
        for event in self._events:
            client.slots.put_event(frame_of(EVENT_KEY, event, now_us - event.at_us))
        client.bell.set()
        self.clients.add(client)
        self.watched.set()
        return client

    def leave(self, client: Client) -> None:
        self.clients.discard(client)
        if not self.clients:
            self.watched.clear()

    def put(self, key: str, value: Value, received_us: int, now_us: int) -> None:
        """The newest value of a key, received at `received_us`."""
        self._values[key] = (value, received_us)
        if self.clients:
            frame = frame_of(key, value, now_us - received_us)
            for client in self.clients:
                client.slots.put_state(key, frame)
                client.bell.set()

    def tell(self, event: Event) -> None:
        """An event for everybody."""
        self._events.append(event)
        frame = frame_of(EVENT_KEY, event, 0)
        for client in self.clients:
            client.slots.put_event(frame)
            client.bell.set()

    def newest(self, key: str) -> tuple[Value, int] | None:
        """The newest value of a key and when it came [us]."""
        return self._values.get(key)


def frame_of(key: str, value: Value, age_us: int) -> bytes:
    """A message travels as its JSON; a picture as its bytes, with its header in the frame's header."""
    age_ms = max(0, age_us // 1000)
    if isinstance(value, Picture):
        header = FrameHeader(age_ms=age_ms, picture=msgspec.Raw(msgspec.json.encode(value.header)))
        return encode_frame(key, header, value.data)
    return encode_frame(key, FrameHeader(age_ms=age_ms), msgspec.json.encode(value))
