"""What goes on beside the body of a test, and ends with it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Coroutine
from typing import Any


@contextlib.asynccontextmanager
async def at_work(*works: Coroutine[Any, Any, object]) -> AsyncIterator[None]:
    """These go on beside what follows, and none may have ended by then.

    At its end, also where it fails, they are cancelled and awaited. What is wrong with one is raised, or noted in the
    error of what follows: that it failed, ended by itself, or did not end by being cancelled.
    """
    tasks = [asyncio.create_task(work) for work in works]
    try:
        yield
    except BaseException as error:
        for fault in await _end(tasks):
            error.add_note(f"beside it: {fault!r}")
        raise
    for fault in await _end(tasks):
        raise fault


async def _end(tasks: list[asyncio.Task[object]]) -> list[Exception]:
    """What was wrong with those that did not end by being cancelled."""
    were_at_work = [task.cancel() for task in tasks]
    ends = await asyncio.gather(*tasks, return_exceptions=True)
    faults: list[Exception] = []
    for task, was_at_work, end in zip(tasks, were_at_work, ends, strict=True):
        if isinstance(end, Exception):
            faults.append(end)
        elif not (was_at_work and isinstance(end, asyncio.CancelledError)):
            faults.append(AssertionError(f"ended by itself: {task}"))
    return faults
