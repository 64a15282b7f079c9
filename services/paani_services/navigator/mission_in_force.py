"""The mission that the navigator follows: that of its files, or the one that the operator's order names."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from pathlib import Path

import msgspec

from paani import keys
from paani.bus import Bus, Latest
from paani.messages import Arming, Mission, OperatorOrder, Route
from paani_services.navigator.files.mission_file import next_route
from paani_services.navigator.files.mission_journal import JournalEntry, MissionJournal, digest_mission
from paani_services.navigator.guidance.mission_progress import MissionProgress

LOG = logging.getLogger(__name__)
RESUME_S = 3.0  # for which a navigator that died under way waits for the mission it was in: it is said twice in 4 s


class MissionInForce:
    """`route`: the route to show. `mission`: None for a boat that has a route alone, or neither.

    A mission of the operator's process is taken when the order names it, and not before: it has been checked, and
    accepted where it moves nothing. Land stays as the files name it.
    """

    def __init__(self, bus: Bus, folder: Path, route: Route | None, mission: Mission | None) -> None:
        self.route, self.mission = route, mission
        self.journal = MissionJournal(folder)
        self._ordered = bus.latest(keys.ORDERED_MISSION)
        self._land = () if mission is None else mission.land

    @property
    def accepted_us(self) -> int:
        """Stamp of the mission that is followed; 0: that of the files."""
        return 0 if self.mission is None else self.mission.accepted_us

    @property
    def legs_us(self) -> int:
        """Stamp of its legs."""
        return 0 if self.mission is None else self.mission.legs_us

    async def resume(self, arming: Latest[Arming], order: Latest[OperatorOrder]) -> MissionProgress:
        """The progress that an earlier run of this process left under the same run of the operator's.

        It is that of the mission of the files, or of the one that the operator's order names now.
        """
        entry, progress = await self.journal.read(), MissionProgress()
        if entry is not None and self._is_of(entry):
            newest = await arming.next()
            if newest.epoch == entry.operator_epoch:
                progress = entry.progress
        elif entry is not None:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(RESUME_S):
                    newest = await arming.next()
                    while newest.epoch == entry.operator_epoch and not self.take_ordered(order.value):
                        await order.next()
            if self._is_of(entry):
                progress = entry.progress
        if self.mission is not None:
            self.journal.follow(self.mission, progress)
        return progress

    def take_ordered(self, order: OperatorOrder | None) -> bool:
        """Take the mission that the order names, if that is another one and was heard; whether it was taken."""
        ordered = self._ordered.value
        if order is None or ordered is None or order.mission_us in {0, self.accepted_us}:
            return False
        if ordered.accepted_us != order.mission_us:
            return False
        LOG.info("another mission: %s, %d legs", ordered.name or "without a name", len(ordered.legs))
        self.mission, self.route = msgspec.structs.replace(ordered, land=self._land), next_route(ordered)
        self.journal.follow(ordered, MissionProgress())
        return True

    def _is_of(self, entry: JournalEntry) -> bool:
        return self.mission is not None and digest_mission(self.mission) == entry.mission
