"""What an input device of Linux says, from its bytes (linux/input.h). Pure."""

from __future__ import annotations

import struct

EVENT = struct.Struct("@llHHi")  # seconds, microseconds, type, code, value
EV_SYN, EV_KEY = 0, 1
SYN_DROPPED = 3  # the kernel had no room for events: a press may be among those
UP = 0


def has_press(data: bytes) -> bool:
    """Whether a key went down, or may have; a part of an event at the end counts as one."""
    whole = len(data) - len(data) % EVENT.size
    if whole != len(data):
        return True
    for _, _, kind, code, value in EVENT.iter_unpack(data):
        if (kind == EV_KEY and value != UP) or (kind == EV_SYN and code == SYN_DROPPED):
            return True
    return False


def is_any_held(keys: bytes) -> bool:
    """Whether the bit field of the keys that are held has one."""
    return any(keys)
