"""Queue of frames for one client: the newest frame of each key, and a short ring of events. Pure."""

from __future__ import annotations

from collections import deque


class ClientQueue:
    """A slow client loses old states and old events, both counted, and never delays another client."""

    def __init__(self, event_depth: int = 32) -> None:
        self._states: dict[str, bytes] = {}
        self._events: deque[bytes] = deque(maxlen=event_depth)
        self.superseded = 0
        self.dropped_events = 0

    def put_state(self, key: str, frame: bytes) -> None:
        """Queue the newest frame of a key; it replaces one that waits, in its place in the queue."""
        self.superseded += key in self._states
        self._states[key] = frame

    def put_event(self, frame: bytes) -> None:
        """Queue an event; a full ring drops its oldest."""
        self.dropped_events += len(self._events) == self._events.maxlen
        self._events.append(frame)

    def pop(self) -> bytes | None:
        """The next frame to send: events first, oldest first; then the key that has waited longest."""
        if self._events:
            return self._events.popleft()
        if self._states:
            return self._states.pop(next(iter(self._states)))
        return None

    def __len__(self) -> int:
        return len(self._events) + len(self._states)
