"""What the recorder says of itself."""

from __future__ import annotations

import msgspec

from paani.messages.header import Count, Message, Stamp, Text


class RecordedTopic(msgspec.Struct, frozen=True, kw_only=True):
    """Messages of one topic since the recorder began.

    written: in a file. dropped: heard, but not kept. missing: numbers that its producer gave and nobody here heard.
    unreadable: among the written, those without a header that can be read.
    """

    topic: Text
    written: Count = 0
    dropped: Count = 0
    missing: Count = 0
    unreadable: Count = 0


class RecorderState(Message, frozen=True, kw_only=True):
    """Once a second from the recorder. `problem` says why it does not record; the sums are those of `topics`."""

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
