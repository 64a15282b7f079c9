"""Whether this process still hears the bus: a session may live on when its receiving end has died."""

from __future__ import annotations

from collections.abc import Callable

from paani.clock import Clock

DEAF_S = 3.0  # the router reports its health once a second; a link without life is torn down after two


class Hearing:
    """Judged by the router's health report, and only while there is a connection to the router at all."""

    def __init__(self, clock: Clock, is_connected: Callable[[], bool]) -> None:
        """clock: one that is never set."""
        self._clock, self._is_connected = clock, is_connected
        self._heard_us: int | None = None

    def note(self) -> None:
        """Something has come from the router. Called on any thread."""
        self._heard_us = self._clock.now_us()

    def is_deaf(self) -> bool:
        """Connected, and what used to come has not come for so long that it never will.

        A router that has never spoken is one of another kind, without a process that reports.
        """
        if self._heard_us is None:
            return False
        if not self._is_connected():
            self.note()  # whoever connects again has time to hear
            return False
        return (self._clock.now_us() - self._heard_us) * 1e-6 > DEAF_S
