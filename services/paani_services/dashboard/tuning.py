"""Publishes the operator's tuning requests and waits for the advisor's answer."""

from __future__ import annotations

import asyncio
import secrets
from typing import Annotated

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Publisher, Queue
from paani.clock import Clock
from paani_services.dashboard.hub import Event

ANSWER_TIMEOUT_S = 2.0


class ProposeRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Settings to try; the advisor checks the values."""

    changes: Annotated[tuple[m.Change, ...], msgspec.Meta(min_length=1, max_length=32)]


class ProposalRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The proposal to promote or to roll back."""

    proposal: Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9]{1,32}$")]


class Tuner:
    """Sends one request at a time; each is repeated on the bus until the next, and the advisor obeys it once."""

    def __init__(self, publisher: Publisher[m.Tuning], clock: Clock) -> None:
        self._publisher, self._clock = publisher, clock
        self._request = m.Tuning(source_us=clock.now_us())
        self._request_lock, self._changing_n = asyncio.Lock(), 0
        self._report_received = asyncio.Event()
        self.shadow: m.Shadow | None = None

    async def publish_forever(self) -> None:
        """Publish the last request at the rate of its topic."""
        while True:
            self._publisher.put(self._request)
            await asyncio.sleep(1.0 / keys.TUNING.rate_hz)

    @property
    def is_waiting(self) -> bool:
        """Whether a request waits for the advisor by which the parameters in force may be about to change."""
        return self._changing_n > 0

    async def propose(self, changes: tuple[m.Change, ...]) -> m.Shadow | None:
        """Propose changes under a new name; returns the advisor's answer, None when it gives none."""
        return await self._send_request(m.TuningAct.PROPOSE, secrets.token_hex(2), changes)

    async def send_act(self, act: m.TuningAct, proposal: str) -> m.Shadow | None:
        """Promote or roll back a proposal; returns the advisor's answer, None when it gives none."""
        self._changing_n += 1
        try:
            return await self._send_request(act, proposal, ())
        finally:
            self._changing_n -= 1

    async def relay_forever(self, client: str, inbox: Queue[m.TuningProposal]) -> None:
        """Have tried what a client asks to be tried, one after the other."""
        while True:
            await self.relay(client, await inbox.get())

    async def relay(self, client: str, asked: m.TuningProposal) -> None:
        """Propose what a client of the page asks to be tried, once however often it says so.

        Its own trials have its name, and no other trial has to make room for them.
        """
        trial = self.shadow.proposal if self.shadow is not None else ""
        is_known = asked.proposal == self._request.proposal
        if not is_known and asked.proposal.startswith(client) and (not trial or trial.startswith(client)):
            await self._send_request(m.TuningAct.PROPOSE, asked.proposal, asked.changes)

    def update(self, shadow: m.Shadow) -> Event | None:
        """Take the advisor's report; returns an event when the parameters in force or on trial have changed."""
        before, self.shadow = self.shadow, shadow
        self._report_received.set()
        self._report_received = asyncio.Event()
        return describe_change(before, shadow, self._clock.now_us())

    async def _send_request(self, act: m.TuningAct, proposal: str, changes: tuple[m.Change, ...]) -> m.Shadow | None:
        async with self._request_lock:
            self._request = m.Tuning(
                source_us=self._clock.now_us(),
                act=act,
                request=self._request.request + 1,
                proposal=proposal,
                changes=changes,
            )
            sent = self._publisher.put(self._request)
            try:
                async with asyncio.timeout(ANSWER_TIMEOUT_S):
                    while not is_answer(self.shadow, sent):
                        await self._report_received.wait()
            except TimeoutError:
                return None
            return self.shadow


def is_answer(shadow: m.Shadow | None, sent: m.Tuning) -> bool:
    """Whether the report answers this request."""
    return shadow is not None and (shadow.answered_epoch, shadow.answered) == (sent.epoch, sent.request)


def describe_change(before: m.Shadow | None, now: m.Shadow, now_us: int) -> Event | None:
    """A line for the page's log when the parameters in force or on trial have changed."""
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
