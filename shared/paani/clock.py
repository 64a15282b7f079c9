"""The only place that reads time."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Protocol


class Clock(Protocol):
    """Microsecond stamps. Live processes share one wall clock; lockstep and tests pass their own."""

    def now_us(self) -> int:
        """Now, in integer microseconds since the clock's origin."""
        ...


class WallClock:
    """Unix time for stamps that other processes read."""

    def now_us(self) -> int:
        return time.time_ns() // 1000


class MonotonicClock:
    """Never steps; for watchdogs and ages inside one process."""

    def now_us(self) -> int:
        return time.monotonic_ns() // 1000


def steady_beside(clock: Clock) -> Clock:
    """What tells ages beside this clock: itself, or where it is one that may be set, one that never is."""
    return MonotonicClock() if isinstance(clock, WallClock) else clock


def _boot_origin_us() -> int:
    """Drawn by the kernel at each start of the machine; of no more digits than a time of this century."""
    try:
        drawn = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
        return int(drawn.replace("-", ""), 16) % (9 * 10**14)
    except (OSError, ValueError):
        return 0


BOOT_ORIGIN_US = _boot_origin_us()


class MachineClock:
    """Monotonic, and of another origin after each start of the machine: what was stamped before then is of no use."""

    def now_us(self) -> int:
        return BOOT_ORIGIN_US + time.monotonic_ns() // 1000


class ManualClock:
    """Time that moves when told to."""

    def __init__(self, now_us: int = 1_000_000) -> None:
        self._now_us = now_us

    def now_us(self) -> int:
        return self._now_us

    def advance(self, seconds: float) -> None:
        self._now_us += round(seconds * 1e6)


MIN_STEP_S = 0.1  # a clock that is only slewed differs by less between two looks


class WallTime:
    """What to add to a time by a clock that is never set, for a stamp by one that may be."""

    def __init__(self, clock: Clock, steady: Clock) -> None:
        self._clock, self._steady = clock, steady
        self._offset_us = clock.now_us() - steady.now_us()

    def offset_us(self) -> int:
        """The same from call to call, until the clock is set."""
        offset_us = self._clock.now_us() - self._steady.now_us()
        if abs(offset_us - self._offset_us) > MIN_STEP_S * 1e6:
            self._offset_us = offset_us
        return self._offset_us


def has_passed(since_us: int, span_us: float, now_us: int) -> bool:
    """Whether this span of time has passed since then, by a clock that may be set: a start in the future is over."""
    return not 0 <= now_us - since_us < span_us


EARLY_S = 0.02  # a picture this much too early is in time: sources jitter


def patience_us(rate_hz: float) -> int:
    """Time to let pass after a picture before the next is wanted."""
    period_s = 1.0 / rate_hz
    return round(max(period_s - EARLY_S, 0.5 * period_s) * 1e6)


def stopwatch_ms() -> float:
    """Milliseconds of an arbitrary origin, for measuring durations."""
    return time.perf_counter_ns() * 1e-6


def uptime_s() -> float:
    """Seconds since the machine was started, sleep included: as `/proc/uptime`, whatever becomes of the wall clock."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def process_cpu_s() -> float:
    """CPU seconds this process has used."""
    return time.process_time()
