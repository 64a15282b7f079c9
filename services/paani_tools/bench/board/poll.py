"""Polls the dashboard's status once a second, and reads the machine's counters with each poll."""

from __future__ import annotations

import asyncio
import http.client
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Protocol

import msgspec

from paani.board_status import STATUS_PATH, BoardStatus
from paani.clock import Clock
from paani.undecodable import UNDECODABLE
from paani_tools.bench.board.host_counters import HostSample

PERIOD_S = 1.0  # U10
MAX_BYTES = 4 << 20
FIRST_RESULT_S = 60.0

Fetch = Callable[[], bytes]
Show = Callable[[int], None]


class Counters(Protocol):
    def read(self) -> HostSample: ...


class Poll(msgspec.Struct, frozen=True, kw_only=True):
    """One request. `status` is None where it failed; `failure` then says why."""

    at_us: int
    answer_ms: float
    host: HostSample
    status: BoardStatus | None = None
    failure: str = ""


def http_fetch(url: str) -> Fetch:
    """Reads the status of the dashboard at this address. The call raises OSError, HTTPException or ValueError."""

    def fetch() -> bytes:
        with urllib.request.urlopen(url + STATUS_PATH, timeout=PERIOD_S) as answer:
            data: bytes = answer.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise ValueError(f"an answer of more than {MAX_BYTES} bytes")
        return data

    return fetch


async def await_first_result(fetch: Fetch, clock: Clock) -> str:
    """Return when the board's first result is there: "", or why there is none after `FIRST_RESULT_S`."""
    deadline_us, failure = clock.now_us() + round(FIRST_RESULT_S * 1e6), ""
    while clock.now_us() < deadline_us:
        status, failure = await _fetch_status(fetch)
        if status is not None and status.evidence is not None:
            return ""
        await asyncio.sleep(0.2)
    return failure or f"no result from perception within {FIRST_RESULT_S:.0f} s"


async def poll_board(fetch: Fetch, counters: Counters, clock: Clock, polls: int, done: list[Poll], show: Show) -> None:
    """Append `polls` polls to `done`, one each `PERIOD_S`; a cancelled call leaves those it has finished."""
    due_us = clock.now_us()
    while len(done) < polls:
        await asyncio.sleep(max(0.0, (due_us - clock.now_us()) * 1e-6))
        due_us = max(due_us + round(PERIOD_S * 1e6), clock.now_us())
        at_us = clock.now_us()
        status, failure = await _fetch_status(fetch)
        answer_ms = (clock.now_us() - at_us) * 1e-3
        host = await asyncio.to_thread(counters.read)
        done.append(Poll(at_us=at_us, answer_ms=answer_ms, host=host, status=status, failure=failure))
        show(len(done))


async def _fetch_status(fetch: Fetch) -> tuple[BoardStatus | None, str]:
    try:
        return msgspec.json.decode(await asyncio.to_thread(fetch), type=BoardStatus), ""
    except urllib.error.HTTPError as error:
        return None, f"HTTP {error.code}"
    except urllib.error.URLError as error:
        return None, str(error.reason)
    except (OSError, http.client.HTTPException) as error:
        return None, str(error) or type(error).__name__
    except UNDECODABLE as error:
        return None, f"not a status: {error}"
