"""The last ten minutes as the page saw them: a keyframe, a sample and the events of every second. No sockets, no clock.

A keyframe is the newest message of every key and its age then, as the frames that a page receives live, so that a page
shows a moment of the past with the code that shows the present. Of picture, mask, evidence and tracks it has those of
the frame that the advice was made from.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple, TypeVar

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani_services.dashboard.frames import FrameHeader, pack_frames
from paani_services.dashboard.hub import Event, Hub, Value, encode_value
from paani_services.dashboard.time_series import SAMPLE_PERIOD_US, Sample, sample_of

SPAN_US = 600_000_000
MAX_BYTES = 48 << 20  # with pictures of 20 kB ten minutes take about 20 MB
MAX_WINDOW_US = 15_000_000  # of one request
SAMPLE_KEY = "dashboard/sample"

T = TypeVar("T", bound=m.Message)


class Keyframe(NamedTuple):
    """at_us: when it was made [Unix us]. packed: its frames, compressed."""

    at_us: int
    packed: bytes


class History:
    """Bounded by time and by bytes; the oldest go first."""

    def __init__(self, services: tuple[str, ...], span_us: int = SPAN_US, max_bytes: int = MAX_BYTES) -> None:
        self._services, self._span_us, self._max_bytes = services, span_us, max_bytes
        self._keyframes: deque[Keyframe] = deque()
        self._bytes = 0
        self.samples: deque[Sample] = deque(maxlen=round(span_us / SAMPLE_PERIOD_US))

    def take(self, hub: Hub, now_us: int) -> Sample:
        """Keep what the hub holds now; returns the sample of it."""
        packed = zlib.compress(pack_frames(encode_keyframe(hub, now_us)), 1)
        self._keyframes.append(Keyframe(now_us, packed))
        self._bytes += len(packed)
        while self._bytes > self._max_bytes or now_us - self._keyframes[0].at_us > self._span_us:
            self._bytes -= len(self._keyframes.popleft().packed)
        sample = sample_of(FreshInHub(hub, now_us), self._services, now_us)
        self.samples.append(sample)
        return sample

    def window(self, from_us: int, to_us: int) -> bytes:
        """The frames of the keyframes of this time, oldest first, and of the last one before it."""
        chosen = [each for each in self._keyframes if from_us <= each.at_us <= to_us]
        before = [each for each in self._keyframes if each.at_us < from_us][-1:]
        return b"".join(zlib.decompress(each.packed) for each in (*before, *chosen))


class FreshInHub:
    """Looks up what the hub holds and what is not older than its topic allows."""

    def __init__(self, hub: Hub, now_us: int) -> None:
        self._hub, self._now_us = hub, now_us

    def __call__(self, topic: keys.Topic[T]) -> T | None:
        value, received_us = self._hub.newest(topic.name) or (None, 0)
        is_fresh = (self._now_us - received_us) * 1e-6 <= topic.fresh_s
        return value if is_fresh and isinstance(value, topic.type) else None


def encode_keyframe(hub: Hub, now_us: int) -> Iterable[bytes]:
    """The frames of what the hub holds now."""
    newest = hub.newest(keys.ADVISORY.name)
    frame = frame_id(newest[0]) if newest is not None else None
    for key, (value, received_us) in hub.items():
        if key == SAMPLE_KEY:
            continue
        chosen, chosen_us = next(
            ((each, us) for each, us in hub.recent(key) if frame_id(each) == frame), (value, received_us)
        )
        yield encode_value(key, chosen, FrameHeader(age_ms=max(0, (now_us - chosen_us) // 1000), at_us=now_us))


def frame_id(value: Value) -> tuple[int, int] | None:
    """Which frame a value belongs to; None where it belongs to none."""
    stamped = value.header if isinstance(value, Picture) else value
    epoch, seq = getattr(stamped, "frame_epoch", None), getattr(stamped, "frame_seq", None)
    return None if epoch is None or seq is None else (epoch, seq)


def events_since(events: Iterable[Event], from_us: int) -> tuple[Event, ...]:
    """Those that happened at this moment or later."""
    return tuple(event for event in events if event.at_us >= from_us)
