"""Hub between the bus and the pages: the newest message of each topic, and a queue per client. No sockets."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import ItemsView, Iterable, Iterator

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani.clock import MonotonicClock
from paani_services.dashboard.client_queue import ClientQueue
from paani_services.dashboard.frames import FrameHeader, encode_frame

EVENT_KEY = "dashboard/event"
MAX_EVENTS = 24  # for clients that join late
MAX_PAST_EVENTS = 1000
FRAME_KEYS = frozenset({keys.PICTURE.name, keys.MASK.name, keys.EVIDENCE.name, keys.TRACKS.name})
RECENT = 8  # values of such a key that are kept, for whoever needs those of one frame
Value = m.Message | Picture | msgspec.Struct


class Event(msgspec.Struct, frozen=True):
    """One line of the page's log. `level` is `info`, `warn` or `stop`."""

    at_us: int
    level: str
    text: str


class Client:
    """The queue of one page, and the event that wakes its sender."""

    def __init__(self) -> None:
        self.queue = ClientQueue()
        self.frames_ready = asyncio.Event()


class Hub:
    """Keeps the newest value of each key for clients that join late; encodes only while there are clients."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self.has_clients = asyncio.Event()
        self._steady = MonotonicClock()
        self._values: dict[str, tuple[Value, int]] = {}
        self._watchers: dict[str, set[asyncio.Event]] = {}
        self._recent: dict[str, deque[tuple[Value, int]]] = {key: deque(maxlen=RECENT) for key in FRAME_KEYS}
        self.events: deque[Event] = deque(maxlen=MAX_PAST_EVENTS)

    def add_client(self, now_us: int) -> Client:
        """Add a client; the newest value of every key is already in its queue."""
        client = Client()
        for key, (value, received_us) in self._values.items():
            client.queue.put_state(key, self._encode(key, value, now_us - received_us))
        for event in [*self.events][-MAX_EVENTS:]:
            client.queue.put_event(self._encode(EVENT_KEY, event, now_us - event.at_us))
        client.frames_ready.set()
        self.clients.add(client)
        self.has_clients.set()
        return client

    def remove_client(self, client: Client) -> None:
        self.clients.discard(client)
        if not self.clients:
            self.has_clients.clear()

    def put(self, key: str, value: Value, received_us: int, now_us: int) -> None:
        """The newest value of a key, received at `received_us`."""
        self._values[key] = (value, received_us)
        for changed in self._watchers.get(key, ()):
            changed.set()
        if key in self._recent:
            self._recent[key].append((value, received_us))
        if self.clients:
            frame = self._encode(key, value, now_us - received_us)
            for client in self.clients:
                client.queue.put_state(key, frame)
                client.frames_ready.set()

    @contextlib.contextmanager
    def changes(self, key: str) -> Iterator[asyncio.Event]:
        """An event that is set whenever there is a newer value of the key; it begins set where there is one."""
        changed = asyncio.Event()
        if key in self._values:
            changed.set()
        watchers = self._watchers.setdefault(key, set())
        watchers.add(changed)
        try:
            yield changed
        finally:
            watchers.discard(changed)

    def publish_event(self, event: Event) -> None:
        """Queue an event for every client."""
        self.events.append(event)
        frame = self._encode(EVENT_KEY, event, 0)
        for client in self.clients:
            client.queue.put_event(frame)
            client.frames_ready.set()

    def newest(self, key: str) -> tuple[Value, int] | None:
        """The newest value of a key and when it came [us]."""
        return self._values.get(key)

    def items(self) -> ItemsView[str, tuple[Value, int]]:
        """The newest value of every key, and when it came [us]."""
        return self._values.items()

    def recent(self, key: str) -> Iterable[tuple[Value, int]]:
        """The newest values of a key whose messages belong to frames, and when they came; none of any other key."""
        return self._recent.get(key, ())

    def _encode(self, key: str, value: Value, age_us: int) -> bytes:
        return encode_value(key, value, FrameHeader(age_ms=max(0, age_us // 1000), made_us=self._steady.now_us()))


def encode_value(key: str, value: Value, header: FrameHeader) -> bytes:
    """One frame: a message as JSON, a picture as its bytes with its header in the frame's header."""
    if isinstance(value, Picture):
        picture = msgspec.Raw(msgspec.json.encode(value.header))
        return encode_frame(key, msgspec.structs.replace(header, picture=picture), value.data)
    return encode_frame(key, header, msgspec.json.encode(value))
