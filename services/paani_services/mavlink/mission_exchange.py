"""Mission, fence and rally points, to and from ground stations. No input or output of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from paani import messages as m
from paani.clock import has_passed
from paani.geometry import enu_from_geodetic
from paani.map_origin import map_origin_deg
from paani.missions import MAX_RALLY
from paani_services.mavlink import commands, missions
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.mission_items import (
    Item,
    ItemError,
    Legs,
    WaypointOf,
    areas_of_items,
    legs_of_items,
    points_of_items,
)
from paani_services.mavlink.missions import ALL, EMPTY, FENCE, MISSION, RALLY, Uploaded, plan_of
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Source, Station
from paani_services.mavlink.uploads import MAX_ITEMS, NO_SPACE, Completed, Uploads, acknowledge

ACCEPTED, UNSUPPORTED = dialect.MAV_MISSION_ACCEPTED, dialect.MAV_MISSION_UNSUPPORTED
INVALID_SEQUENCE, DENIED = dialect.MAV_MISSION_INVALID_SEQUENCE, dialect.MAV_MISSION_DENIED
NO_PARTS = "mission: whole or not at all"
NO_PLACE = "mission: the boat does not know its place yet"
NO_NAVIGATOR = "mission: not known, the navigator is silent"
LISTENS_S = 5.0  # after which a navigator that publishes no mission has none: it says one twice in this time
NO_LEGS = Legs((), {})
NO_KEY = ((object(),) * 3, object(), 0, 0)  # of a plan of nothing: no mission is equal to it


class MissionOrder(NamedTuple):
    """What a station asks the operator's process to put in force; None: as it is. It is acknowledged by this type."""

    station: Station
    target: Source
    kind: int
    legs: tuple[m.MissionLeg, ...] | None = None
    fence: tuple[m.FenceArea, ...] | None = None
    rally: tuple[m.Waypoint, ...] | None = None


class MissionExchange:
    """send: asks the operator's process. count: something refused, by its cause. is_trusted: whether it may command."""

    def __init__(
        self,
        send: Callable[[MissionOrder], None],
        count: Callable[[str], None],
        is_trusted: Callable[[Station, Any], bool],
    ) -> None:
        self._send, self._count, self._is_trusted = send, count, is_trusted
        self._snapshot = Snapshot(now_us=0)
        self._plan, self._plan_key = EMPTY, NO_KEY
        self._uploaded: Uploaded | None = None  # whose legs were in force
        self._newest: Uploaded | None = None  # which may be refused
        self._uploads, self._upload_count = Uploads(count), 0
        self._current = self._reached = self._leg_index = 0
        self._asked_us: dict[tuple[Station, Source, int], int] = {}  # for a list of a type that is not known yet
        self._heard_us: int | None = None  # since when the navigator gives orders
        self.handlers: dict[str, Callable[[Station, Any, Source], None]] = {
            "MISSION_REQUEST_LIST": self._request_list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request,
            "MISSION_COUNT": self._begin,
            "MISSION_ITEM_INT": self._take,
            "MISSION_ITEM": self._take,
            "MISSION_CLEAR_ALL": self._clear,
            "MISSION_ACK": self._end,
            "MISSION_WRITE_PARTIAL_LIST": self._refuse_part,
        }

    @property
    def current(self) -> Any:
        """MISSION_CURRENT."""
        return missions.mission_current(self._snapshot, self._plan)

    def follow(self, snapshot: Snapshot) -> list[Any]:
        """Take what is known now: MISSION_CURRENT where another item is steered for, MISSION_ITEM_REACHED for the last.

        The plan is made anew where the mission, home or the map has changed, and only then: downloads take a while.
        """
        self._snapshot = snapshot
        self._uploads.tick(snapshot.now_us)
        legs, prediction = snapshot.legs, snapshot.prediction
        if legs is None:
            self._plan, self._plan_key = EMPTY, NO_KEY
        elif snapshot.pose is not None:
            home = prediction.home if prediction is not None else self._plan_key[1]
            key = ((legs, snapshot.fence, snapshot.rally), home, snapshot.pose.epoch, self._upload_count)
            if key != self._plan_key:
                if self._newest is not None and self._newest.legs.legs == legs:
                    self._uploaded = self._newest
                self._plan, self._plan_key = plan_of(snapshot, self._uploaded), key
        if snapshot.command is None:
            self._heard_us = None
        elif self._heard_us is None:
            self._heard_us = snapshot.now_us
        self._answer_lists()
        return self._news(snapshot)

    def shows(self, order: MissionOrder) -> bool:
        """Whether a station that downloads now is given what this order asked for."""
        parts, _, _, upload_count = self._plan_key
        asked = (order.legs, order.fence, order.rally)
        is_planned = all(part is None or part == planned for part, planned in zip(asked, parts, strict=True))
        return is_planned and upload_count == self._upload_count

    def forget(self, station: Station) -> None:
        """A station whose link has ended."""
        self._uploads.forget(station)
        self._asked_us = {asked: us for asked, us in self._asked_us.items() if asked[0] is not station}

    def _news(self, snapshot: Snapshot) -> list[Any]:
        command = snapshot.command
        if command is None:
            return []
        news: list[Any] = []
        current = missions.current_seq(snapshot, self._plan)
        if command.waypoints_reached > self._reached or command.leg_index > self._leg_index:
            news.append(dialect.MAVLink_mission_item_reached_message(self._current))
        if current != self._current:
            self._current = current
            news.append(self.current)
        self._reached, self._leg_index = command.waypoints_reached, command.leg_index
        return news

    # Downloads

    def _request_list(self, station: Station, message: Any, source: Source) -> None:
        if message.mission_type in {MISSION, FENCE, RALLY}:
            self._asked_us.setdefault((station, source, message.mission_type), self._snapshot.now_us)
            self._answer_lists()
        else:
            self._refuse(station, UNSUPPORTED, message, source, "")

    def _answer_lists(self) -> None:
        """A count of none would be that of an empty mission: what is not known is waited for, and then refused."""
        snapshot = self._snapshot
        for (station, source, kind), asked_us in tuple(self._asked_us.items()):
            if self._is_known(kind):
                station.send(missions.mission_count(self._plan, kind, source), snapshot.now_us)
            elif has_passed(max(asked_us, self._heard_us or 0), LISTENS_S * 1e6, snapshot.now_us):
                self._count("mavlink_refused")
                text = NO_NAVIGATOR if snapshot.legs is None else NO_PLACE
                acknowledge(station, source, DENIED, kind, snapshot.now_us, text)
            else:
                continue
            del self._asked_us[station, source, kind]

    def _is_known(self, kind: int) -> bool:
        """Whether the plan says what there is of this type: with its places, or because there is none."""
        snapshot = self._snapshot
        if snapshot.legs is None:
            return self._heard_us is not None and has_passed(self._heard_us, LISTENS_S * 1e6, snapshot.now_us)
        places = {MISSION: snapshot.legs, FENCE: snapshot.fence, RALLY: snapshot.rally}
        return self._plan_key is not NO_KEY or not places[kind]

    def _request(self, station: Station, message: Any, source: Source) -> None:
        kind = message.mission_type
        item = None
        if kind in {MISSION, FENCE, RALLY}:
            item = missions.mission_item(self._plan, kind, message.seq, self._current, source)
        if item is None:
            self._refuse(station, INVALID_SEQUENCE, message, source, "")
        else:
            station.send(item, self._snapshot.now_us)

    # Uploads

    def _begin(self, station: Station, message: Any, source: Source) -> None:
        kind = message.mission_type
        if not self._is_trusted(station, message):
            self._refuse(station, DENIED, message, source, commands.NOT_TRUSTED)
        elif kind == RALLY and message.count > MAX_RALLY:
            self._refuse(station, NO_SPACE, message, source, f"rally: more than {MAX_RALLY} points")
        elif kind not in {MISSION, FENCE, RALLY}:
            self._refuse(station, UNSUPPORTED, message, source, "")
        elif message.count > MAX_ITEMS:
            self._refuse(station, NO_SPACE, message, source, f"mission: more than {MAX_ITEMS} items")
        elif message.count == 0:
            self._empty(station, message, source)
        else:
            self._uploads.begin(station, message, source, self._snapshot.now_us)

    def _take(self, station: Station, message: Any, source: Source) -> None:
        whole = self._uploads.take(station, message, source, self._snapshot.now_us)
        if whole is None:
            return
        pose = self._snapshot.pose
        if pose is None:
            self._refuse(station, DENIED, message, source, NO_PLACE)
            return
        origin_deg = map_origin_deg(pose)

        def waypoint_of(place_e7: tuple[int, int]) -> m.Waypoint:
            x_m, y_m = enu_from_geodetic(place_e7[0] * 1e-7, place_e7[1] * 1e-7, *origin_deg)
            return m.Waypoint(x_m=x_m, y_m=y_m)

        try:
            self._send(self._order_of(whole, waypoint_of))
        except ItemError as error:
            self._refuse(station, error.result, message, source, str(error))

    def _order_of(self, whole: Completed, waypoint_of: WaypointOf) -> MissionOrder:
        """Raises ItemError for the first item that the boat cannot do."""
        order = MissionOrder(whole.station, whole.target, whole.kind)
        match whole.kind:
            case missions.FENCE:
                return order._replace(fence=areas_of_items(whole.items, waypoint_of))
            case missions.RALLY:
                return order._replace(rally=points_of_items(whole.items, waypoint_of))
            case _:
                legs = legs_of_items(whole.items, waypoint_of)
                self._keep(whole.items, legs)
                return order._replace(legs=legs.legs)

    def _keep(self, items: tuple[Item, ...], legs: Legs) -> None:
        self._newest, self._upload_count = Uploaded(items, legs), self._upload_count + 1

    def _clear(self, station: Station, message: Any, source: Source) -> None:
        if not self._is_trusted(station, message):
            self._refuse(station, DENIED, message, source, commands.NOT_TRUSTED)
        elif message.mission_type not in {MISSION, FENCE, RALLY, ALL}:
            self._refuse(station, UNSUPPORTED, message, source, "")
        else:
            self._empty(station, message, source)

    def _empty(self, station: Station, message: Any, source: Source) -> None:
        kind = message.mission_type
        self._uploads.cancel(station, source)
        if kind in {MISSION, ALL}:
            self._keep((), NO_LEGS)
        parts = [() if kind in {part, ALL} else None for part in (MISSION, FENCE, RALLY)]
        self._send(MissionOrder(station, source, kind, *parts))

    def _end(self, station: Station, message: Any, source: Source) -> None:
        """A station that will not go on with its upload; after a download it is thanks."""
        if message.type != ACCEPTED:
            self._uploads.cancel(station, source)

    def _refuse_part(self, station: Station, message: Any, source: Source) -> None:
        self._refuse(station, UNSUPPORTED, message, source, NO_PARTS)

    def _refuse(self, station: Station, result: int, message: Any, source: Source, text: str) -> None:
        self._count("mavlink_refused")
        acknowledge(station, source, result, message.mission_type, self._snapshot.now_us, text)
