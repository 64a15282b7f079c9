"""Recorder settings."""

from __future__ import annotations

from paani.config.section import NonNegative, Positive, Section, Size
from paani.keys import every_topic
from paani.topic_names import present_name

KNOWN_TOPICS = frozenset(topic.name for topic in every_topic())


class RecorderConfig(Section, frozen=True):
    """`folder` is where recordings go; empty: nothing is recorded, and no recorder runs.

    `leave_out`: topics not recorded. The eye's pictures are what the camera relays, byte for byte.
    A part ends after `part_s` or `part_mib`. `budget_mib` bounds all parts in the folder: the oldest are deleted,
    except those with a file `NAME.keep` beside them. With less than `min_free_mib` left on the disk nothing is written.
    """

    folder: str = ""
    leave_out: tuple[str, ...] = ("eye/picture",)
    queue_messages: Size = 2000  # waiting to be written: about five seconds of everything
    queue_mib: Positive = 16.0  # waiting to be written; beyond it pictures are dropped first, and counted
    flush_s: Positive = 0.4  # a crash costs at most this, one write and one look at the bus
    part_s: Positive = 600.0
    part_mib: Positive = 512.0
    budget_mib: Positive = 20_000.0  # about a day with pictures
    min_free_mib: NonNegative = 1000.0

    def __post_init__(self) -> None:
        """What is left out exists."""
        for name in self.leave_out:
            if present_name(name) not in KNOWN_TOPICS:
                raise ValueError(f"leave_out: no topic '{name}'")
