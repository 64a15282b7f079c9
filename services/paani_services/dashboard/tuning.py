"""Speaks the operator's tuning requests on the bus and waits for the advisor's answer."""

from __future__ import annotations

import asyncio
import secrets
from typing import Annotated

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Publisher
from paani.clock import Clock
from paani_services.dashboard.hub import Event

ANSWER_S = 2.0


class ProposeRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What to try; the advisor judges the values."""

    changes: Annotated[tuple[m.Change, ...], msgspec.Meta(min_length=1, max_length=32)]


class ProposalRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which proposal to promote or to take back."""

    proposal: Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9]{1,32}$")]


class Tuner:
    """One request at a time; each is repeated on the bus until the next, and obeyed once."""

    def __init__(self, publisher: Publisher[m.Tuning], clock: Clock) -> None:
        self._publisher, self._clock = publisher, clock
        self._request = m.Tuning(source_us=clock.now_us())
        self._asking = asyncio.Lock()
        self._heard = asyncio.Event()
        self.shadow: m.Shadow | None = None

    async def speak_always(self) -> None:
        """Repeat the last request at the rate of its topic."""
        while True:
            self._publisher.put(self._request)
            await asyncio.sleep(1.0 / keys.TUNING.rate_hz)

    @property
    def is_asking(self) -> bool:
        """Whether a request waits for the advisor: what is in force may be about to change."""
        return self._asking.locked()

    async def propose(self, changes: tuple[m.Change, ...]) -> m.Shadow | None:
        """Ask for a trial under a new name; the advisor's answer, None when it gives none."""
        return await self._ask(m.TuningAct.PROPOSE, secrets.token_hex(2), changes)

    async def name(self, act: m.TuningAct, proposal: str) -> m.Shadow | None:
        """Ask to promote or take back a proposal; the advisor's answer, None when it gives none."""
        return await self._ask(act, proposal, ())

    def hear(self, shadow: m.Shadow) -> Event | None:
        """The advisor's report; an event when what is in force has changed."""
        before, self.shadow = self.shadow, shadow
        self._heard.set()
        self._heard = asyncio.Event()
        return event_of(before, shadow, self._clock.now_us())

    async def _ask(self, act: m.TuningAct, proposal: str, changes: tuple[m.Change, ...]) -> m.Shadow | None:
        async with self._asking:
            self._request = m.Tuning(
                source_us=self._clock.now_us(),
                act=act,
                request=self._request.request + 1,
                proposal=proposal,
                changes=changes,
            )
            sent = self._publisher.put(self._request)
            try:
                async with asyncio.timeout(ANSWER_S):
                    while not is_answer(self.shadow, sent):
                        await self._heard.wait()
            except TimeoutError:
                return None
            return self.shadow


def is_answer(shadow: m.Shadow | None, sent: m.Tuning) -> bool:
    """Whether the advisor had heard this request when it reported."""
    return shadow is not None and (shadow.answered_epoch, shadow.answered) == (sent.epoch, sent.request)


def event_of(before: m.Shadow | None, now: m.Shadow, now_us: int) -> Event | None:
    """A line for the page's log when what is in force or what is tried has changed."""
    was = (before.active, before.proposal, before.epoch) if before is not None else ("", "", now.epoch)
    if was == (now.active, now.proposal, now.epoch):
        return None
    if now.active != was[0]:
        if now.epoch != was[2]:
            return Event(now_us, "warn", f"the advisor restarted: back at its configuration, {was[0]} is forgotten")
        return Event(now_us, "warn", f"in force: {now.active or 'the configuration'}")
    if now.proposal != was[1]:
        return Event(now_us, "info", f"tried beside: {now.proposal or 'nothing'}")
    return None
