"""What each process says of itself once a second: inputs alive, fresh and at rate, drops, CPU, memory."""

from __future__ import annotations

import collections
import contextlib
import os
import resource
from collections.abc import Callable, Sequence
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus.inbox import Inbox
from paani.clock import process_cpu_s

RATE_TOLERANCE = 0.5  # an input is at rate while at least this share of its nominal rate arrives


class HealthReporter:
    """Turns counters into rates between two reports."""

    def __init__(
        self,
        service: str,
        inputs: Sequence[tuple[keys.Topic[Any], Inbox[Any]]],
        drops: collections.Counter[str],
        note: Callable[[], str],
    ) -> None:
        self._service, self._inputs, self._drops, self._note = service, inputs, drops, note
        self._started_us = self._last_us = 0
        self._last_cpu_s = process_cpu_s()
        self._last_received: dict[int, int] = {}
        self._rss_mib = 0.0

    def report(self, now_us: int) -> m.Health:
        """The report for the time since the last one."""
        self._started_us = self._started_us or now_us
        span_s = (now_us - self._last_us) * 1e-6 if self._last_us else 0.0
        cpu_s = process_cpu_s()
        with contextlib.suppress(OSError):  # a process without a free descriptor says what it last knew
            self._rss_mib = rss_mib()
        report = m.Health(
            source_us=now_us,
            service=self._service,
            ready=True,
            uptime_s=max(0.0, (now_us - self._started_us) * 1e-6),
            cpu_cores=max(0.0, (cpu_s - self._last_cpu_s) / span_s) if span_s > 0 else 0.0,
            rss_mib=self._rss_mib,
            inputs=tuple(self._input(topic, inbox, span_s) for topic, inbox in self._inputs),
            drops=tuple(m.DropCount(cause=cause, count=n) for cause, n in sorted(self._drops.items())),
            note=self._note(),
            open_files=count_open_files(),
            temperature_c=warmest_zone_c(),
        )
        self._last_us, self._last_cpu_s = now_us, cpu_s
        return report

    def _input(self, topic: keys.Topic[Any], inbox: Inbox[Any], span_s: float) -> m.InputHealth:
        received = inbox.received
        rate_hz = (received - self._last_received.get(id(inbox), 0)) / span_s if span_s > 0 else 0.0
        self._last_received[id(inbox)] = received
        age_s = min(inbox.receipt_age_s(), 1e6)
        return m.InputHealth(
            topic=topic.name,
            alive=age_s < 10.0 * max(topic.fresh_s, 1.0 / topic.rate_hz),
            fresh=age_s <= topic.fresh_s,
            rate_ok=rate_hz >= RATE_TOLERANCE * topic.rate_hz,
            rate_hz=max(0.0, rate_hz),
            age_s=max(0.0, age_s),
            received=received,
            superseded=inbox.superseded,
        )


def rss_mib() -> float:
    """Resident memory of this process [MiB]."""
    return int(_read("/proc/self/statm").split()[1]) * resource.getpagesize() / 2**20


def count_open_files() -> int:
    """Descriptors that this process holds; where it is given no more, all that it may hold."""
    try:
        return len(os.listdir("/proc/self/fd")) - 1  # noqa: PTH208  as in `_read`; one of them reads this folder
    except OSError:
        return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def warmest_zone_c(folder: str = "/sys/class/thermal") -> float:
    """The temperature of this machine's warmest thermal zone [degrees C]; 0 where none can be read."""
    warmest = 0.0
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):  # noqa: PTH208  as in `_read`
            if name.startswith("thermal_zone"):
                with contextlib.suppress(OSError, ValueError):  # a zone may be switched off
                    warmest = max(warmest, int(_read(f"{folder}/{name}/temp")) * 1e-3)
    return warmest


def _read(path: str) -> str:
    """A file of the kernel's. By no `Path`: each adds its parts to the interpreter's table of strings.

    They leave it again, but their places stay taken until the table is made anew, twice as large: half a megabyte to a
    megabyte more after half an hour of one report a second.
    """
    with open(path, encoding="ascii") as file:  # noqa: PTH123
        return file.read()
