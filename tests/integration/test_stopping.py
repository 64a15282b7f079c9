"""A deciding process told to stop in the very moment that a message wakes it stops all the same."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, WallClock
from paani.config import Config
from paani_services.advisor.service import run as advisor
from paani_services.controller.service import run as controller
from paani_services.navigator.service import run as navigator
from tests.at_work import at_work
from tests.conftest import OpenAs
from tests.unit.paani_services.advisor.advisor_evidence import CLEAR

pytestmark = pytest.mark.integration
Run = Callable[[Bus, Clock, Config], Coroutine[Any, Any, None]]
ADVICE = m.Advisory(source_us=1, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE)
ORDER = m.NavCommand(source_us=1, enable=False, heading_rad=0.0, speed_mps=0.0)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize(
    ("service", "run", "topic", "message"),
    [
        ("advisor", advisor, keys.EVIDENCE, CLEAR),
        ("navigator", navigator, keys.ADVISORY, ADVICE),
        ("controller", controller, keys.COMMAND, ORDER),
    ],
)
async def test_a_stop_is_not_lost_in_a_wake_up(
    service: str, run: Run, topic: keys.Topic[Any], message: m.Message, turns: int, open_as: OpenAs, config: Config
) -> None:
    bus = await open_as(service)
    async with asyncio.timeout(10.0), at_work(run(bus, WallClock(), config)):
        await asyncio.sleep(0.15)
        inbox = next(inbox for each, inbox in bus.inputs if each is topic)
        inbox.offer(message)  # type: ignore[attr-defined]  # a `Latest`
        for _ in range(turns):
            await asyncio.sleep(0)
