"""Advisor process: evidence in; advisory, tracks and shadow out, at once and again at `advisor.rate_hz`."""

import asyncio
import contextlib

from paani import keys
from paani.bus import Bus, Stepper
from paani.clock import Clock
from paani.config import Config
from paani.messages import Advisory
from paani_services.advisor.advise import evidence_expiry_us
from paani_services.advisor.counterfactual import prepare_subsets
from paani_services.advisor.decide import DECIDER


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Advise on each new evidence at once, republish in between, and advise STOP as soon as the evidence is too old."""
    prepare_subsets(config)
    stepper = Stepper(bus, clock, config, DECIDER)
    evidence = stepper.inboxes[keys.EVIDENCE.name]
    period_us = round(1e6 / config.advisor.rate_hz)
    with bus.alive():
        while True:
            malformed, refused = stepper.state.active.tracker.malformed, stepper.state.tuning.refused
            now_us, outputs = stepper.decide()
            advisory = stepper.conclude(outputs)[keys.ADVISORY.name]
            assert isinstance(advisory, Advisory)
            state = stepper.state
            tuning = f"; promoted {state.tuning.active.proposal}" if state.tuning.active.proposal else ""
            bus.note(f"{advisory.direction} {advisory.reason}{tuning}")
            if state.active.tracker.malformed > malformed:
                bus.count_drop("malformed_box", state.active.tracker.malformed - malformed)
            if state.tuning.refused > refused:
                bus.count_drop("refused_tuning")
            due_us = now_us + period_us
            stale_us = evidence_expiry_us(state.active, config)
            if stale_us is not None and now_us < stale_us:
                due_us = min(due_us, stale_us)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(min(max(due_us - clock.now_us(), 1000), period_us) * 1e-6):
                    await evidence.next()
