"""Mission journal on disk: a navigator that is restarted under way goes on with the leg it was in.

The journal holds only for the same mission under the same run of the operator's process. Where either is another
one, the mission begins anew.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from pathlib import Path

import msgspec

from paani.messages import Arming, Mission
from paani.runtime import write_private
from paani.undecodable import UNREADABLE
from paani_services.navigator.guidance.mission_progress import MissionProgress

LOG = logging.getLogger(__name__)
FILE = "mission-progress.json"


class JournalEntry(msgspec.Struct, frozen=True):
    """`operator_epoch` is that of the newest arming received, `mission` the digest of its legs."""

    operator_epoch: int
    mission: str
    progress: MissionProgress


class MissionJournal:
    """Keeps the newest progress on disk. A disk that fails or stalls delays no step of the navigator."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._mission = ""
        self._progress = MissionProgress()
        self._epoch = 0
        self._changed = asyncio.Event()

    async def read(self) -> JournalEntry | None:
        """What an earlier run of this process left; None where there is nothing that can be read."""
        return await asyncio.to_thread(read_entry, self._path)

    def follow(self, mission: Mission, progress: MissionProgress) -> None:
        """From now on the progress is that of this mission, and has come so far."""
        self._mission, self._progress = digest_mission(mission), progress

    def record(self, progress: MissionProgress, arming: Arming | None) -> None:
        """Take the progress after a step in the mission that is followed; it is written later by `write_changes`."""
        if self._mission and arming is not None and progress is not self._progress and progress != self._progress:
            self._progress, self._epoch = progress, arming.epoch
            self._changed.set()

    async def write_changes(self) -> None:
        """Write each change to disk, for ever."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            entry = JournalEntry(self._epoch, self._mission, self._progress)
            try:
                await asyncio.to_thread(write_private, self._path, msgspec.json.encode(entry).decode())
            except OSError as error:
                LOG.warning(
                    "%s: %s; if the navigator restarts now, the mission begins anew", self._path, error.strerror
                )


def digest_mission(mission: Mission) -> str:
    """Digest of the legs: another route, place or order is another mission."""
    return hashlib.sha256(msgspec.json.encode(mission.legs)).hexdigest()


def read_entry(path: Path) -> JournalEntry | None:
    """The entry on disk; None where there is none, or none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=JournalEntry)
    except UNREADABLE:
        return None
