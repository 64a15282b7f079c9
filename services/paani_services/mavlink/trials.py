"""Has parameters tried that ground stations write, by the page's process: one proposal at a time.

A trial changes nothing that is in force: see `paani_services.advisor.shadow`.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Iterable

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, has_passed
from paani_services.mavlink.parameter_exchange import DENIED, RANGE, ParameterWrite

REPEAT_S = 1.0
POLL_S = 0.02
TIMEOUT_S = 3.0  # the page's process waits 2 s for the advisor
MAX_CHANGES = 32  # of a proposal
MAX_WAITING = 64  # writes, of all stations

NO_ADVISOR = "parameter: the advisor is silent"
NO_ANSWER = "parameter: neither page nor advisor answers"
TOO_MANY = f"parameter: more than {MAX_CHANGES} are on trial"


class Trials:
    """read_shadow: the advisor's report, None while it is silent. answer: tells a station how its write has ended."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        read_shadow: Callable[[], m.Shadow | None],
        answer: Callable[[ParameterWrite, int, str], None],
    ) -> None:
        self._name, self._clock = bus.user, clock
        self._read_shadow, self._answer = read_shadow, answer
        self._proposals = bus.publisher(keys.TUNING_PROPOSALS[bus.user])
        self._requests = bus.latest(keys.TUNING)
        self._waiting: dict[ParameterWrite, None] = {}
        self._under_way: tuple[ParameterWrite, ...] = ()
        self._task: asyncio.Task[None] | None = None

    def ask(self, write: ParameterWrite) -> None:
        """Begin; stations that repeat what is under way have one answer."""
        if write in self._under_way or len(self._waiting) >= MAX_WAITING:
            return
        self._waiting[write] = None
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._work(), name="trials")

    def close(self) -> None:
        """End what is under way."""
        if self._task is not None:
            self._task.cancel()

    async def _work(self) -> None:
        while self._waiting:
            self._under_way, self._waiting = tuple(self._waiting), {}
            for write, error, text in await self._try(self._under_way):
                self._answer(write, error, text)
            self._under_way = ()

    async def _try(self, writes: tuple[ParameterWrite, ...]) -> list[tuple[ParameterWrite, int, str]]:
        """Each write with its answer. One that the advisor refuses does not take the others with it."""
        answers = []
        while writes:
            error, text, refused_path = await self._propose(writes)
            ended = tuple(write for write in writes if write.path == refused_path) or writes
            answers += [(write, error, text) for write in ended]
            writes = tuple(write for write in writes if write not in ended)
        return answers

    async def _propose(self, writes: tuple[ParameterWrite, ...]) -> tuple[int, str, str]:
        """Propose these together; error, text and the path of a refusal, empty where it is of all."""
        shadow = self._read_shadow()
        if shadow is None:
            return DENIED, NO_ADVISOR, ""
        changes = changes_on_trial(shadow, self._name, writes)
        if shadow.proposal and not shadow.proposal.startswith(self._name):
            return DENIED, f"parameter: the page tries {shadow.proposal} now", ""
        if len(changes) > MAX_CHANGES:
            return DENIED, TOO_MANY, ""
        if shadow.proposal and changes == changes_on_trial(shadow, self._name, ()):
            return DENIED, trial_text(shadow.proposal), ""
        proposal = f"{self._name}{secrets.token_hex(2)}"
        return judge_answer(await self._request(proposal, changes), proposal, {each.path for each in writes})

    async def _request(self, proposal: str, changes: tuple[m.Change, ...]) -> m.Shadow | None:
        """The advisor's report that answers this proposal; None where nobody has answered in time."""
        asked_us: int | None = None
        try:
            async with asyncio.timeout(TIMEOUT_S):
                while not is_answer(shadow := self._read_shadow(), self._requests.value, proposal):
                    now_us = self._clock.now_us()
                    if asked_us is None or has_passed(asked_us, REPEAT_S * 1e6, now_us):
                        self._proposals.put(m.TuningProposal(source_us=now_us, proposal=proposal, changes=changes))
                        asked_us = now_us
                    await asyncio.sleep(POLL_S)
        except TimeoutError:
            return None
        return shadow


def is_answer(shadow: m.Shadow | None, request: m.Tuning | None, proposal: str) -> bool:
    """Whether the report answers the request of the page's process to try this proposal."""
    if shadow is None:
        return False
    is_asked = request is not None and request.proposal == proposal
    answered = request is not None and (request.epoch, request.request) == (shadow.answered_epoch, shadow.answered)
    return shadow.proposal == proposal or (is_asked and answered)


def changes_on_trial(shadow: m.Shadow, name: str, writes: Iterable[ParameterWrite]) -> tuple[m.Change, ...]:
    """What a client would have tried with these writes: them, and what is on its trial now and not in force."""
    in_force = {change.path: change.value for change in shadow.active_changes}
    wanted = {change.path: change.value for change in shadow.changes if in_force.get(change.path) != change.value}
    if not shadow.proposal.startswith(name):
        wanted = {}
    wanted |= {write.path: write.text for write in writes}
    return tuple(m.Change(path=path, value=value) for path, value in sorted(wanted.items()))


def judge_answer(shadow: m.Shadow | None, proposal: str, paths: set[str]) -> tuple[int, str, str]:
    """Error, text and the path at fault, empty where it is none of these, of an answer to a proposal."""
    if shadow is None:
        return DENIED, NO_ANSWER, ""
    if shadow.proposal == proposal:
        return DENIED, trial_text(proposal), ""
    text = f"parameter: {shadow.refusal.replace('_', ' ').lower()}"
    is_range = shadow.refusal is m.TuningRefusal.INVALID_VALUE
    return RANGE if is_range else DENIED, text, shadow.refused_path if shadow.refused_path in paths else ""


def trial_text(proposal: str) -> str:
    """How a write ends that is on trial; of 50 characters at most."""
    return f"on trial as {proposal}: promote it on the page"
