"""State of the recorder."""

from __future__ import annotations

import msgspec

from paani.messages.header import Count, Message, Stamp, Text


class RecordedTopic(msgspec.Struct, frozen=True, kw_only=True):
    """Message counts of one topic since the recorder started.

    written: in a file. dropped: received, but not written. missing: numbers of the producer that never arrived.
    unreadable: received without a readable header; such messages are written or dropped too.
    """

    topic: Text
    written: Count = 0
    dropped: Count = 0
    missing: Count = 0
    unreadable: Count = 0


class RecorderState(Message, frozen=True, kw_only=True):
    """Published once a second. `problem` says why nothing is recorded; the sums are those of `topics`."""

    recording: bool
    problem: Text = ""
    file: Text = ""
    since_us: Stamp = 0
    file_bytes: Count = 0
    free_bytes: Count = 0
    waiting: Count = 0
    written: Count = 0
    dropped: Count = 0
    missing: Count = 0
    topics: tuple[RecordedTopic, ...] = ()
