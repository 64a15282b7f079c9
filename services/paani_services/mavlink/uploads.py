"""Uploads of missions and fences by ground stations, item by item. No input or output of its own."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from paani.clock import has_passed
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.mission_items import NOWHERE, Item
from paani_services.mavlink.station import Source, Station

MAX_ITEMS = 10_200  # the waypoints that a mission may have, and what stands between them
MAX_DEGREES = 200.0  # beyond every place, and within the field
REPEAT_S, ATTEMPTS = 1.0, 5  # an item that does not come is asked for again, and then no more
CANCELLED, NO_SPACE = dialect.MAV_MISSION_OPERATION_CANCELLED, dialect.MAV_MISSION_NO_SPACE
SEQUENCE = dialect.MAV_MISSION_INVALID_SEQUENCE


class Completed(NamedTuple):
    """All items of a type, from this station, to be acknowledged to this target."""

    station: Station
    target: Source
    kind: int
    items: tuple[Item, ...]


class Uploads:
    """One upload at a time for each who speaks; they do not disturb each other. count: a refusal, by its cause."""

    def __init__(self, count: Callable[[str], None]) -> None:
        self._count = count
        self._under_way: dict[tuple[Station, Source], _Upload] = {}

    def begin(self, station: Station, message: Any, source: Source, now_us: int) -> None:
        """A count: ask for the first item. Another upload of this source ends."""
        upload = _Upload(station, source, message.mission_type, message.count)
        self._under_way[station, source] = upload
        upload.ask(now_us)

    def take(self, station: Station, message: Any, source: Source, now_us: int) -> Completed | None:
        """One item; what is complete with it. One that was not asked for is refused, but for one that is repeated."""
        upload = self._under_way.get((station, source))
        if upload is None or message.mission_type != upload.kind:
            self._refuse(station, source, SEQUENCE, message.mission_type, now_us)
            return None
        wanted = len(upload.items)
        if message.seq != wanted:
            if message.seq > wanted:
                self._refuse(station, source, SEQUENCE, upload.kind, now_us)
                del self._under_way[station, source]
            return None
        upload.items.append(_item_of(message))
        if len(upload.items) < upload.count:
            upload.attempts = 0
            upload.ask(now_us)
            return None
        del self._under_way[station, source]
        return Completed(station, upload.target, upload.kind, tuple(upload.items))

    def tick(self, now_us: int) -> None:
        """Ask again for what has not come; give up after some attempts."""
        for (station, source), upload in tuple(self._under_way.items()):
            if has_passed(upload.asked_us, REPEAT_S * 1e6, now_us):
                if upload.attempts >= ATTEMPTS:
                    self._refuse(station, source, CANCELLED, upload.kind, now_us)
                    del self._under_way[station, source]
                else:
                    upload.ask(now_us)

    def forget(self, station: Station) -> None:
        """The station is gone."""
        self._under_way = {key: upload for key, upload in self._under_way.items() if key[0] is not station}

    def cancel(self, station: Station, source: Source) -> None:
        """This source goes on with none."""
        self._under_way.pop((station, source), None)

    def _refuse(self, station: Station, target: Source, result: int, kind: int, now_us: int) -> None:
        self._count("mavlink_refused")
        acknowledge(station, target, result, kind, now_us)


class _Upload:
    def __init__(self, station: Station, target: Source, kind: int, count: int) -> None:
        self.station, self.target, self.kind, self.count = station, target, kind, count
        self.items: list[Item] = []
        self.attempts = self.asked_us = 0

    def ask(self, now_us: int) -> None:
        self.attempts, self.asked_us = self.attempts + 1, now_us
        request = dialect.MAVLink_mission_request_int_message(*self.target, len(self.items), self.kind)
        self.station.send(request, now_us)


def acknowledge(station: Station, target: Source, result: int, kind: int, now_us: int, text: str = "") -> None:
    """The text first, then the result."""
    station.refuse(text, now_us)
    station.send(dialect.MAVLink_mission_ack_message(*target, result, kind), now_us)


def _item_of(message: Any) -> Item:
    """Both kinds of item; a place of which one number is none is none."""
    parameters = message.param1, message.param2, message.param3, message.param4
    place = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        degrees = [min(max(value, -MAX_DEGREES), MAX_DEGREES) for value in place]
        place = NOWHERE if any(map(math.isnan, place)) else (round(degrees[0] * 1e7), round(degrees[1] * 1e7))
    return Item(message.command, parameters, place, message.frame)
