"""Which processes hang: their process lives, but nothing is heard of them."""

from __future__ import annotations

import math

HUNG_S = 5.0
START_S = 60.0  # a process that is not alive by then hangs in its start
ROUTER_QUIET_S = 2.5  # health comes once a second; without the router nobody can be heard
STALLED_S = 2.0  # a watcher that looks this late was itself asleep and judges nobody
ROUTER = "router"


class Silence:
    """Remembers when each service was last heard, on the supervisor's monotonic clock."""

    def __init__(self, now_us: int) -> None:
        self._heard_us: dict[str, int] = {}
        self._starting: set[str] = set()
        self._looked_us = now_us

    def started(self, service: str, now_us: int) -> None:
        """Its process has just been started."""
        self._heard_us[service] = now_us
        self._starting.add(service)

    def note_health(self, service: str, now_us: int) -> None:
        """It is alive and has spoken. What comes after its process ended does not count."""
        if service in self._heard_us:
            self._heard_us[service] = now_us
            self._starting.discard(service)

    def ended(self, service: str) -> None:
        """Its process is gone."""
        self._heard_us.pop(service, None)
        self._starting.discard(service)

    def hung(self, now_us: int) -> list[str]:
        """Services to kill now. While the router is quiet only the router is judged."""
        if now_us - self._looked_us > STALLED_S * 1e6:
            self._forgive(now_us, but="")
        self._looked_us = now_us
        if self._age_s(ROUTER, now_us) > ROUTER_QUIET_S:
            self._forgive(now_us, but=ROUTER)
        return [
            service
            for service in self._heard_us
            if self._age_s(service, now_us) > (START_S if service in self._starting else HUNG_S)
        ]

    def _age_s(self, service: str, now_us: int) -> float:
        heard_us = self._heard_us.get(service)
        return math.inf if heard_us is None else (now_us - heard_us) * 1e-6

    def _forgive(self, now_us: int, but: str) -> None:
        for service in self._heard_us:
            if service != but and service not in self._starting:
                self._heard_us[service] = now_us
