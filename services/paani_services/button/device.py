"""The button as the operating system gives it: an input device of Linux (evdev), or a file with a level.

It blocks, so it belongs in a thread. What cannot be read is never a button that is up.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from abc import ABC, abstractmethod
from pathlib import Path

from paani_services.button.events import EVENT, has_press, is_any_held

LOOKED_AT_EVENTS = 64
KEY_BYTES = 96  # of the bit field of all keys, KEY_MAX of linux/input-event-codes.h is 0x2ff
EVIOCGKEY = 2 << 30 | KEY_BYTES << 16 | ord("E") << 8 | 0x18  # linux/input.h: which keys are held now
MAY_MOVE = b"1"
LEVEL_BYTES = 16


class Button(ABC):
    """`look` says why the boat may not move now, empty where it may."""

    @abstractmethod
    def look(self) -> str:
        """`pressed`, also where it was pressed and let go since the last look, or what is wrong with it."""

    def close(self) -> None:  # noqa: B027  # a level has nothing to close
        """After the last look."""


class InputButton(Button):
    """Any key of an input device. It is opened again after a fault, as a device that is plugged in again is another."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1

    def look(self) -> str:
        try:
            if self._descriptor < 0:
                self._descriptor = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            was_pressed = has_press(self._events())
            held = bytes(fcntl.ioctl(self._descriptor, EVIOCGKEY, bytes(KEY_BYTES)))
        except OSError as error:
            self.close()
            return f"{self._path}: {error.strerror}"
        return "pressed" if was_pressed or is_any_held(held) else ""

    def close(self) -> None:
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
        self._descriptor = -1

    def _events(self) -> bytes:
        """Those since the last look. Raises OSError where the device is gone."""
        found = b""
        with contextlib.suppress(BlockingIOError):
            while chunk := os.read(self._descriptor, LOOKED_AT_EVENTS * EVENT.size):
                found += chunk
                if len(chunk) < LOOKED_AT_EVENTS * EVENT.size:
                    break
        return found


class LevelButton(Button):
    """A file that holds `1` while a closed circuit runs through the button: a press and a broken wire are the same."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def look(self) -> str:
        try:
            descriptor = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                level = os.read(descriptor, LEVEL_BYTES).strip()
            finally:
                os.close(descriptor)
        except OSError as error:
            return f"{self._path}: {error.strerror}"
        if level == MAY_MOVE:
            return ""
        return "pressed" if level == b"0" else f"{self._path}: holds neither 0 nor 1"


def open_button(line: str) -> Button:
    """The button of a line as `button.line` has it; nothing is opened before the first look."""
    kind, _, path = line.partition(":")
    return InputButton(Path(path)) if kind == "input" else LevelButton(Path(path))
