"""What a station is answered that asks for a list which the boat does not know, or not yet."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani_services.mavlink.mission_exchange import LISTENS_S, NO_NAVIGATOR, NO_PLACE
from paani_services.mavlink.missions import FENCE, MISSION, RALLY
from tests.mavlink_peer import NOW_US, Peer, Port, in_order, kinds, only

LEGS = (m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=(m.Waypoint(x_m=1.0, y_m=2.0),), radius_m=2.0),)
WHOLE = m.Mission(source_us=NOW_US, name="a", legs=LEGS)


def made(**changes: Any) -> tuple[Port, Peer]:
    port = Port(in_order(**changes))
    return port, Peer(port.gateway)


def ask(peer: Peer, kind: int = MISSION) -> list[Any]:
    return peer.send(common.MAVLink_mission_request_list_message(1, 1, kind))


def later(port: Port, peer: Peer, seconds: float, **changes: Any) -> list[Any]:
    """The answers that are sent at that time."""
    port.gateway.tick(in_order(now_us=NOW_US + round(seconds * 1e6), **changes))
    answers = "MISSION_COUNT", "MISSION_ACK"
    return [each for each in peer.received() if each.get_type() in answers or "mission:" in getattr(each, "text", "")]


def test_a_list_that_is_not_known_yet_is_told_once_it_is() -> None:
    port, peer = made()
    assert ask(peer) == []
    assert ask(peer) == []
    assert later(port, peer, 2.0) == []
    assert only(later(port, peer, 2.02, mission=WHOLE), "MISSION_COUNT").count == 2
    assert later(port, peer, 2.04, mission=WHOLE) == []


def test_a_boat_without_a_mission_says_so_at_once_when_it_has_listened() -> None:
    port, peer = made(odometry=None)
    assert ask(peer) == []
    assert only(later(port, peer, LISTENS_S, odometry=None), "MISSION_COUNT").count == 0
    assert only(ask(peer), "MISSION_COUNT").count == 0
    assert port.counted == []


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_an_empty_mission_needs_no_place(kind: int) -> None:
    _, peer = made(odometry=None, mission=m.Mission(source_us=NOW_US, name="", legs=()))
    assert only(ask(peer, kind), "MISSION_COUNT").count == 0


def test_a_mission_without_a_place_is_refused_and_what_there_is_none_of_is_told() -> None:
    port, peer = made(odometry=None, mission=WHOLE)
    assert only(ask(peer, FENCE), "MISSION_COUNT").count == 0
    assert ask(peer) == []
    assert later(port, peer, LISTENS_S - 0.1, odometry=None, mission=WHOLE) == []
    text, ack = later(port, peer, LISTENS_S, odometry=None, mission=WHOLE)
    assert (text.text, ack.type, ack.mission_type) == (NO_PLACE, common.MAV_MISSION_DENIED, MISSION)
    assert port.counted == ["mavlink_refused"]


def test_without_a_navigator_a_list_is_refused() -> None:
    port, peer = made()
    assert later(port, peer, LISTENS_S, command=None) == []
    assert ask(peer) == []
    text, ack = later(port, peer, 2.0 * LISTENS_S, command=None)
    assert (text.text, ack.type) == (NO_NAVIGATOR, common.MAV_MISSION_DENIED)


def test_a_navigator_that_has_just_come_is_listened_to() -> None:
    port, peer = made(command=None)
    ask(peer)
    assert later(port, peer, LISTENS_S - 1.0) == []
    assert later(port, peer, LISTENS_S) == []
    assert kinds(later(port, peer, LISTENS_S + 1.0, mission=WHOLE)) == ["MISSION_COUNT"]


def test_a_station_that_is_gone_is_answered_no_more() -> None:
    port, peer = made()
    ask(peer)
    port.gateway.remove(peer.station)
    assert later(port, peer, 1.0, mission=WHOLE) == []
