"""The emulated microcontroller, and callers on its lines."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import pytest

from paani.microcontroller.caller import CallError, McuCaller
from tests.at_work import at_work
from tests.firmware.emulator import Emulator, open_emulator

CONNECT_TIMEOUT_S = 10.0


@contextlib.asynccontextmanager
async def open_caller(address: str, kind: int) -> AsyncIterator[McuCaller]:
    """A caller on the line, once the microcontroller answers it."""
    caller = McuCaller(address, kind)
    async with at_work(caller.run()):
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            while caller.status is None or caller.answered == 0:
                with contextlib.suppress(CallError):
                    await caller.call("paani_status")
                await asyncio.sleep(0.01)
        yield caller


@pytest.fixture(params=["tcp", "pty"])
async def mcu(request: pytest.FixtureRequest) -> AsyncIterator[Emulator]:
    """A freshly started microcontroller, its lines by TCP and by pseudo-terminals."""
    async with open_emulator(pty=request.param == "pty") as emulator:
        yield emulator
