"""What each process says of itself once a second: inputs alive, fresh and at rate, drops, CPU, memory."""

from __future__ import annotations

import collections
import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus.inbox import Inbox
from paani.clock import process_cpu_s

PAGE_KIB = 4
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

    def report(self, now_us: int) -> m.Health:
        """The report for the time since the last one."""
        self._started_us = self._started_us or now_us
        span_s = (now_us - self._last_us) * 1e-6 if self._last_us else 0.0
        cpu_s = process_cpu_s()
        report = m.Health(
            source_us=now_us,
            service=self._service,
            ready=True,
            uptime_s=max(0.0, (now_us - self._started_us) * 1e-6),
            cpu_cores=max(0.0, (cpu_s - self._last_cpu_s) / span_s) if span_s > 0 else 0.0,
            rss_mib=rss_mib(),
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
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE_KIB / 1024


def count_open_files() -> int:
    """Descriptors that this process holds."""
    return len(list(Path("/proc/self/fd").iterdir())) - 1  # one of them reads this folder


def warmest_zone_c(folder: Path = Path("/sys/class/thermal")) -> float:
    """The temperature of this machine's warmest thermal zone [degrees C]; 0 where none can be read."""
    warmest = 0.0
    for zone in folder.glob("thermal_zone*/temp"):
        with contextlib.suppress(OSError, ValueError):  # a zone may be switched off
            warmest = max(warmest, int(zone.read_text(encoding="ascii")) * 1e-3)
    return warmest
