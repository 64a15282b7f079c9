"""Reads the recordings that ground stations ask for, off the event loop."""

from __future__ import annotations

import asyncio
import os
import stat
from pathlib import Path

from paani.clock import Clock, has_passed
from paani.logs.folder import is_being_written, recordings, start_us
from paani_services.mavlink.fields import U32_MAX
from paani_services.mavlink.log_transfers import ListRequest, LogFile, LogTransfers

TURN_S = 0.02
LIST_AGE_S = 1.0  # the folder is not looked through more often, however often it is asked for


def list_logs(folder: str) -> tuple[LogFile, ...]:
    """The recordings of the recorder's folder, oldest first; empty folder: nothing is recorded.

    Left out are the one that is being written, links, empty files, and what the protocol has no number for.
    """
    if not folder:
        return ()
    return tuple(
        LogFile(each.path, start_us(each.path.name), each.size_bytes)
        for each in recordings(Path(folder))
        if 0 < each.size_bytes <= U32_MAX and not each.path.is_symlink() and not is_being_written(each.path)
    )


def read_log(path: Path, offset: int, count: int) -> bytes:
    """These bytes of a recording, fewer at its end; none of what is gone, or no longer a file of the folder's own."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return b""
    try:
        return os.pread(descriptor, count, offset) if stat.S_ISREG(os.fstat(descriptor).st_mode) else b""
    except OSError:
        return b""
    finally:
        os.close(descriptor)


async def serve_logs(transfers: LogTransfers, folder: str, clock: Clock) -> None:
    """One piece of work each turn, for whoever's turn it is."""
    files: tuple[LogFile, ...] = ()
    listed_us: int | None = None
    while True:
        await asyncio.sleep(TURN_S)
        if (turn := transfers.next_request()) is None:
            continue
        station, request = turn
        if not isinstance(request, ListRequest):
            data = await asyncio.to_thread(read_log, request.file.path, request.offset, request.turn_bytes)
            transfers.send_data(station, request, data)
        elif request.is_known:
            transfers.send_entries(station, request, None)
        else:
            if listed_us is None or has_passed(listed_us, LIST_AGE_S * 1e6, clock.now_us()):
                files, listed_us = await asyncio.to_thread(list_logs, folder), clock.now_us()
            transfers.send_entries(station, request, files)
