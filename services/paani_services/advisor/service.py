"""Advisor process: evidence in; advisory and tracks out, at once and again at `advisor.rate_hz`."""

import asyncio
import contextlib

from paani import keys
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani_services.advisor.advise import AdvisorState, advise, stale_at_us


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Advise on each new evidence at once, republish between, and stop the moment the evidence is too old."""
    evidence = bus.latest(keys.EVIDENCE)
    advisory, tracks = bus.publisher(keys.ADVISORY), bus.publisher(keys.TRACKS)
    period_us = round(1e6 / config.advisor.rate_hz)
    state = AdvisorState()
    with bus.alive():
        while True:
            now_us = clock.now_us()
            malformed = state.tracker.malformed
            state, advice, seen = advise(state, evidence.value, now_us, config)
            advisory.put(advice)
            tracks.put(seen)
            if state.tracker.malformed > malformed:
                bus.count_drop("malformed_box", state.tracker.malformed - malformed)
            bus.note(f"{advice.direction} {advice.reason}")
            due_us = now_us + period_us
            stale_us = stale_at_us(state, config)
            if stale_us is not None and now_us < stale_us:
                due_us = min(due_us, stale_us)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(evidence.next(), max(due_us - clock.now_us(), 1000) * 1e-6)
