"""How far a mission has come, on disk: a navigator that is restarted under way goes on with the leg it was in.

Only for the same mission under the same run of the operator's process: where either is new, the mission begins anew.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from pathlib import Path

import msgspec

from paani.bus import Latest
from paani.messages import Arming, Mission
from paani.runtime import write_private
from paani_services.navigator.guidance.mission import Progress

LOG = logging.getLogger(__name__)
FILE = "mission-progress.json"


class Entry(msgspec.Struct, frozen=True):
    """`operator_epoch` is that of the arming heard, `mission` the digest of its legs."""

    operator_epoch: int
    mission: str
    progress: Progress


class Logbook:
    """Keeps the newest entry on disk; a disk that fails or stalls holds nobody up."""

    def __init__(self, folder: Path, mission: Mission) -> None:
        self._path, self._mission = folder / FILE, digest(mission)
        self._progress = Progress()
        self._epoch = 0
        self._changed = asyncio.Event()

    async def restore(self, arming: Latest[Arming]) -> Progress:
        """What an earlier run of this process left. Where it left anything, waits until the operator is heard."""
        entry = await asyncio.to_thread(read, self._path)
        if entry is not None and entry.mission == self._mission:
            heard = await arming.next()
            if heard.epoch == entry.operator_epoch:
                self._progress = entry.progress
        return self._progress

    def note(self, progress: Progress, arming: Arming | None) -> None:
        """The state after a step."""
        if arming is not None and progress is not self._progress and progress != self._progress:
            self._progress, self._epoch = progress, arming.epoch
            self._changed.set()

    async def keep(self) -> None:
        """Write what changes, for ever."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            entry = Entry(self._epoch, self._mission, self._progress)
            try:
                await asyncio.to_thread(write_private, self._path, msgspec.json.encode(entry).decode())
            except OSError as error:
                LOG.warning("%s: %s; a restart would begin the mission anew", self._path, error.strerror)


def digest(mission: Mission) -> str:
    """Of the legs: another route, place or order is another mission."""
    return hashlib.sha256(msgspec.json.encode(mission.legs)).hexdigest()


def read(path: Path) -> Entry | None:
    """The entry; None where there is none, or none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Entry)
    except (OSError, msgspec.MsgspecError):
        return None
