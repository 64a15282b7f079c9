"""What a test has at work beside it ends with it, and says what became of it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from tests.at_work import at_work


class Work:
    def __init__(self) -> None:
        self.has_ended = False

    async def go_on(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(0)
            self.has_ended = True


async def fail_at_once() -> None:
    raise OSError("no bus")


async def fail_when_told_to_end() -> None:
    try:
        await asyncio.Event().wait()
    finally:
        raise OSError("no bus")


async def end() -> None:
    pass


async def end_as_if_told_to() -> None:
    raise asyncio.CancelledError


async def end_in_peace_when_told_to() -> None:
    with contextlib.suppress(asyncio.CancelledError):
        await asyncio.Event().wait()


Begin = Callable[[], Coroutine[Any, Any, None]]
FAILS = pytest.mark.parametrize("begin", [fail_at_once, fail_when_told_to_end])


async def test_what_goes_on_ends_with_what_it_goes_on_beside() -> None:
    first, second = Work(), Work()
    async with at_work(first.go_on(), second.go_on()):
        await asyncio.sleep(0)
        assert not first.has_ended
    assert (first.has_ended, second.has_ended) == (True, True)


async def test_it_has_ended_before_a_failure_is_told() -> None:
    work = Work()
    with pytest.raises(ValueError, match="of the body") as found:  # noqa: PT012  # raised within
        async with at_work(work.go_on()):
            await asyncio.sleep(0)
            raise ValueError("of the body")
    assert work.has_ended
    assert not hasattr(found.value, "__notes__")


@FAILS
async def test_what_it_fails_of_is_raised(begin: Begin) -> None:
    work = Work()
    with pytest.raises(OSError, match="no bus"):
        async with at_work(work.go_on(), begin()):
            await asyncio.sleep(0)
    assert work.has_ended


@FAILS
async def test_what_it_fails_of_is_noted_where_the_body_fails_too(begin: Begin) -> None:
    with pytest.raises(ValueError, match="of the body") as found:  # noqa: PT012  # raised within
        async with at_work(begin()):
            await asyncio.sleep(0)
            raise ValueError("of the body")
    assert found.value.__notes__ == ["beside it: OSError('no bus')"]


@pytest.mark.parametrize("begin", [end, end_as_if_told_to, end_in_peace_when_told_to])
async def test_one_that_ends_by_itself_is_named(begin: Begin) -> None:
    with pytest.raises(AssertionError, match=rf"^ended by itself: .*{begin.__name__}\(\)"):
        async with at_work(Work().go_on(), begin()):
            await asyncio.sleep(0)
