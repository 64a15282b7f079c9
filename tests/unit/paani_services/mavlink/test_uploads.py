"""Uploads: what a station sends becomes legs and areas, or is refused with the protocol's own result."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.geometry import enu_from_geodetic
from paani.map_origin import map_origin_deg
from paani.mission_client import MissionAnswer
from paani_services.mavlink.commands import mission_result
from paani_services.mavlink.mission_items import Item, ItemError, areas_of_items, legs_of_items
from paani_services.mavlink.missions import FENCE, MISSION, RALLY, plan_of
from tests.mavlink_peer import HEARTBEAT, NOW_US, Peer, Port, in_order, kinds, odometry, only

POINTS = tuple(m.Waypoint(x_m=x, y_m=y) for x, y in ((0.0, 0.0), (60.0, 0.0), (60.0, -40.0)))
PLACES = ((501_072_000, 86_928_000), (501_072_000, 86_938_000), (501_082_000, 86_938_000))
HOME_FRAME = 0
FOLLOW, HOLD = m.LegKind.FOLLOW_ROUTE, m.LegKind.HOLD_STATION


def on_map(place_e7: tuple[int, int]) -> m.Waypoint:
    return m.Waypoint(x_m=place_e7[1] * 1e-3, y_m=place_e7[0] * 1e-3)


def waypoint(place: int, hold_s: float = 0.0, frame: int = 3) -> Item:
    return Item(16, (hold_s, 0.0, 0.0, math.nan), PLACES[place], frame)


def made() -> tuple[Port, Peer]:
    port = Port(in_order())
    return port, Peer(port.gateway)


def message_of(seq: int, item: Item, kind: int = MISSION) -> Any:
    return common.MAVLink_mission_item_int_message(
        1, 1, seq, item.frame, item.command, 0, 1, *item.parameters, *item.place_e7, 0.0, kind
    )


def upload(peer: Peer, items: list[Item], kind: int = MISSION) -> list[Any]:
    """What the port says to each message of an upload."""
    answers = peer.send(common.MAVLink_mission_count_message(1, 1, len(items), kind))
    for seq, item in enumerate(items):
        assert only(answers[-1:], "MISSION_REQUEST_INT").seq == seq
        answers += peer.send(message_of(seq, item, kind))
    return answers


def test_what_the_boat_offers_comes_back_as_the_same_legs() -> None:
    """Of a download, and of an upload of it: names apart, nothing is lost."""
    legs = (
        m.MissionLeg(kind=HOLD, waypoints=POINTS[:1], radius_m=3.0, duration_s=20.0),
        m.MissionLeg(kind=FOLLOW, waypoints=POINTS, repeat=True, laps=3, speed_mps=0.4),
        m.MissionLeg(kind=HOLD, radius_m=2.0, speed_mps=0.4),
        m.MissionLeg(kind=m.LegKind.RETURN_HOME, waypoints=POINTS[1:2], speed_mps=0.4),
        m.MissionLeg(kind=HOLD, waypoints=POINTS[:1], radius_m=3.0, duration_s=20.0),
        m.MissionLeg(kind=m.LegKind.STOP),
    )
    plan = plan_of(in_order(mission=m.Mission(source_us=1, name="a", legs=legs)))
    origin_deg = map_origin_deg(odometry())

    def to_map(place_e7: tuple[int, int]) -> m.Waypoint:
        x_m, y_m = enu_from_geodetic(place_e7[0] * 1e-7, place_e7[1] * 1e-7, *origin_deg)
        return m.Waypoint(x_m=round(x_m, 1), y_m=round(y_m, 1))

    # A single-precision number of the protocol is the nearest one.
    assert legs_of_items(plan.items[MISSION], to_map).legs == legs
    seq_of = legs_of_items(plan.items[MISSION], to_map).seq_of
    assert {key: seq_of[key] for key in seq_of} == {key: plan.seq_of[key] for key in seq_of}


def test_waypoints_in_a_row_are_a_route_and_a_speed_or_a_stay_ends_it() -> None:
    """The next begins where it ended; MAVSDK sends the speed after its waypoint."""
    speed = Item(178, (1.0, 0.5, -1.0, 0.0), frame=2)
    items = [waypoint(0), waypoint(1), speed, waypoint(2), waypoint(0, 7.0), waypoint(1), Item(20)]
    legs, seq_of = legs_of_items(items, on_map)
    assert [leg.kind for leg in legs] == [FOLLOW, FOLLOW, HOLD, FOLLOW, m.LegKind.RETURN_HOME]
    assert [(leg.speed_mps, len(leg.waypoints)) for leg in legs] == [(0.0, 2), (0.5, 3), (0.5, 1), (0.5, 2), (0.5, 0)]
    assert (legs[2].duration_s, seq_of[1, 0], seq_of[1, 2], seq_of[3, 1]) == (7.0, 1, 4, 5)


def test_a_speed_is_kept_or_given_back_where_the_protocol_says_so() -> None:
    speeds = [Item(178, (1.0, speed_mps, -1.0, 0.0), frame=2) for speed_mps in (0.5, -1.0, math.nan, -2.0)]
    first, *others = (step for at, speed in zip((0, 1, 2, 0), speeds, strict=True) for step in (speed, waypoint(at)))
    legs, _ = legs_of_items([first, *others, waypoint(1)], on_map)
    assert [(leg.speed_mps, len(leg.waypoints)) for leg in legs] == [(0.5, 3), (0.0, 3)]


def test_home_comes_first_in_a_frame_of_its_own_and_one_waypoint_alone_is_passed() -> None:
    home = waypoint(2, frame=HOME_FRAME)
    (there, back), _ = legs_of_items([home, waypoint(0), Item(20)], on_map)
    assert (there.kind, there.waypoints) == (HOLD, (on_map(PLACES[0]),))
    assert 0.0 < there.duration_s < 1.0
    assert back.waypoints == (on_map(PLACES[2]),)
    (route,), _ = legs_of_items([waypoint(0), waypoint(1)], on_map)
    assert len(route.waypoints) == 2, "MAVSDK sends no home"


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (Item(22), common.MAV_MISSION_UNSUPPORTED),
        (Item(177, (1.0, 2.0, 0.0, 0.0)), common.MAV_MISSION_UNSUPPORTED),
        (Item(177, (0.0, math.nan, 0.0, 0.0)), common.MAV_MISSION_UNSUPPORTED),
        (Item(16, place_e7=(5, 5), frame=1), common.MAV_MISSION_UNSUPPORTED_FRAME),
        (Item(16), common.MAV_MISSION_INVALID_PARAM5_X),
        (Item(16, place_e7=(910_000_000, 0)), common.MAV_MISSION_INVALID_PARAM5_X),
        (Item(19, (math.nan, 0.0, 0.0, 0.0)), common.MAV_MISSION_INVALID_PARAM1),
        (Item(178, (1.0, 0.0, -1.0, 0.0)), common.MAV_MISSION_INVALID_PARAM2),
        (Item(178, (1.0, -3.0, -1.0, 0.0)), common.MAV_MISSION_INVALID_PARAM2),
    ],
)
def test_an_item_that_the_boat_cannot_do_is_refused_and_named(item: Item, result: int) -> None:
    port, peer = made()
    answers = upload(peer, [waypoint(0), waypoint(1), item])
    assert only(answers, "MISSION_ACK").type == result
    assert only(answers, "STATUSTEXT").text.startswith("item 2: ")
    assert (port.sent, port.counted) == ([], ["mavlink_refused"])


def test_an_upload_is_asked_of_the_operators_process_and_acknowledged_by_it_alone() -> None:
    port, peer = made()
    answers = upload(peer, [waypoint(0), waypoint(1)])
    assert "MISSION_ACK" not in kinds(answers)
    (order,) = port.sent
    assert (order.station, order.kind, order.fence) == (peer.station, MISSION, None)
    assert order.legs is not None
    first = order.legs[0].waypoints[0]
    origin_deg = map_origin_deg(odometry())
    assert (first.x_m, first.y_m) == pytest.approx(enu_from_geodetic(50.1072, 8.6928, *origin_deg), abs=0.02)
    # Once it is in force, the items come back as they were sent, and progress counts in them.
    mission = m.Mission(source_us=1, name="uploaded", legs=order.legs, accepted_us=5)
    port.gateway.tick(in_order(mission=mission, now_us=NOW_US + 20_000))
    assert only(peer.send(common.MAVLink_mission_request_list_message(1, 1, 0)), "MISSION_COUNT").count == 2
    item = only(peer.send(common.MAVLink_mission_request_int_message(1, 1, 1, 0)), "MISSION_ITEM_INT")
    assert (item.x, item.y) == PLACES[1]
    # One that is refused after it changes nothing.
    upload(peer, [waypoint(2), waypoint(1), waypoint(0)])
    port.gateway.tick(in_order(mission=mission, now_us=NOW_US + 40_000))
    peer.received()
    assert only(peer.send(common.MAVLink_mission_request_list_message(1, 1, 0)), "MISSION_COUNT").count == 2


def test_an_item_that_is_missing_is_asked_for_again_and_then_no_more() -> None:
    port, peer = made()
    peer.send(HEARTBEAT)
    peer.send(common.MAVLink_mission_count_message(1, 1, 3, 0))
    peer.send(message_of(0, waypoint(0)))
    heard: list[Any] = []
    for second in range(1, 9):
        peer.send(HEARTBEAT, NOW_US + second * 1_000_000)
        port.gateway.tick(in_order(now_us=NOW_US + second * 1_000_000 + 500_000))
        heard += peer.received()
    asked = [each.seq for each in heard if each.get_type() == "MISSION_REQUEST_INT"]
    assert asked == [1] * 4
    assert only(heard, "MISSION_ACK").type == common.MAV_MISSION_OPERATION_CANCELLED
    assert port.counted == ["mavlink_refused"]
    assert only(peer.send(message_of(1, waypoint(1))), "MISSION_ACK").type == common.MAV_MISSION_INVALID_SEQUENCE
    assert port.sent == []


def test_an_item_out_of_order_ends_the_upload_and_a_repeated_one_does_not() -> None:
    port, peer = made()
    peer.send(common.MAVLink_mission_count_message(1, 1, 3, 0))
    peer.send(message_of(0, waypoint(0)))
    assert peer.send(message_of(0, waypoint(0))) == []
    assert only(peer.send(message_of(2, waypoint(1))), "MISSION_ACK").type == common.MAV_MISSION_INVALID_SEQUENCE
    assert only(peer.send(message_of(1, waypoint(1))), "MISSION_ACK").type == common.MAV_MISSION_INVALID_SEQUENCE
    assert port.sent == []
    assert port.counted == ["mavlink_refused"] * 2


@pytest.mark.parametrize(
    ("command", "place"),
    [
        (16, (math.nan, 8.6928)),
        (16, (50.1072, math.nan)),
        (16, (50.1072, math.inf)),
        (17, (1e30, 8.6928)),  # which without a place means here
    ],
)
def test_a_place_that_is_no_number_is_refused(command: int, place: tuple[float, float]) -> None:
    """Of the old kind of item, whose places are floating point."""
    port, peer = made()
    peer.send(common.MAVLink_mission_count_message(1, 1, 1, 0))
    item = common.MAVLink_mission_item_message(1, 1, 0, 3, command, 0, 1, 0.0, 0.0, 0.0, math.nan, *place, 0.0, 0)
    answers = peer.send(item)
    assert only(answers, "MISSION_ACK").type == common.MAV_MISSION_INVALID_PARAM5_X
    assert (port.sent, port.counted) == ([], ["mavlink_refused"])


def test_frames_that_lie_about_their_number_are_taken_as_they_come() -> None:
    """The number of a frame says what a link has lost, and nothing about what the frame asks."""
    port, peer = made()
    liar = common.MAVLink(None, 255, 190)
    for number in (7, 7, 200, 3, 3):
        liar.seq = number
        answers = peer.send_bytes(bytes(common.MAVLink_ping_message(1, number, 0, 0).pack(liar)))
        assert only(answers, "PING").seq == number
    assert port.counted == []


def test_two_stations_upload_at_once_and_do_not_disturb_each_other() -> None:
    port, one = made()
    other = Peer(port.gateway, 1)
    for peer in (one, other):
        peer.send(common.MAVLink_mission_count_message(1, 1, 2, 0))
    for seq, places in enumerate(((0, 2), (1, 1))):
        for peer, place in zip((one, other), places, strict=True):
            peer.send(message_of(seq, waypoint(place)))
    assert [order.station for order in port.sent] == [one.station, other.station]
    ours, theirs = (order.legs for order in port.sent)
    assert ours != theirs


def test_two_behind_one_link_upload_at_once_and_mix_nothing() -> None:
    port, peer = made()
    for system in (255, 254):
        peer.send_bytes(peer.pack(common.MAVLink_mission_count_message(1, 1, 2, MISSION), system))
    for seq in range(2):
        for system, place in ((255, 0), (254, 1)):
            peer.send_bytes(peer.pack(message_of(seq, waypoint(place + seq)), system))
    assert [(order.target, len(order.legs[0].waypoints)) for order in port.sent if order.legs] == [
        ((255, 190), 2), ((254, 190), 2),
    ]  # fmt: skip
    first, second = (order.legs for order in port.sent)
    assert first != second


def test_too_many_items_and_what_a_stranger_sends_are_refused_at_once() -> None:
    port, peer = made()
    ack = only(peer.send(common.MAVLink_mission_count_message(1, 1, 10_201, 0)), "MISSION_ACK")
    assert ack.type == common.MAV_MISSION_NO_SPACE
    stranger = Peer(port.gateway, 1, local=False)
    for message in (
        common.MAVLink_mission_count_message(1, 1, 2, 0),
        common.MAVLink_mission_count_message(1, 1, 0, 1),
        common.MAVLink_mission_clear_all_message(1, 1, 255),
    ):
        assert only(stranger.send(message), "MISSION_ACK").type == common.MAV_MISSION_DENIED
    assert port.sent == []


def test_clearing_takes_the_mission_the_fence_the_rally_points_or_all() -> None:
    port, peer = made()
    for kind in (MISSION, FENCE, RALLY, 255):
        assert peer.send(common.MAVLink_mission_clear_all_message(1, 1, kind)) == []
    assert [(order.legs, order.fence, order.rally) for order in port.sent] == [
        ((), None, None), (None, (), None), (None, None, ()), ((), (), ()),
    ]  # fmt: skip


def rally_point(place_e7: tuple[int, int], command: int = 5100) -> Item:
    return Item(command, (0.0, 0.0, 0.0, 0.0), place_e7)


def test_rally_points_are_asked_of_the_operators_process_and_come_back() -> None:
    port, peer = made()
    assert "MISSION_ACK" not in kinds(upload(peer, [rally_point(place) for place in PLACES[:2]], RALLY))
    (order,) = port.sent
    assert (order.kind, order.legs, order.fence) == (RALLY, None, None)
    assert order.rally is not None
    origin_deg = map_origin_deg(odometry())
    assert [(at.x_m, at.y_m) for at in order.rally] == [
        pytest.approx(enu_from_geodetic(place[0] * 1e-7, place[1] * 1e-7, *origin_deg), abs=0.02)
        for place in PLACES[:2]
    ]
    mission = m.Mission(source_us=1, name="", legs=(), rally=order.rally, accepted_us=5)
    port.gateway.tick(in_order(mission=mission, now_us=NOW_US + 20_000))
    peer.received()
    assert only(peer.send(common.MAVLink_mission_request_list_message(1, 1, 2)), "MISSION_COUNT").count == 2
    item = only(peer.send(common.MAVLink_mission_request_int_message(1, 1, 1, 2)), "MISSION_ITEM_INT")
    assert (item.command, item.mission_type, item.x, item.y) == (5100, RALLY, *PLACES[1])
    port.gateway.tick(in_order(mission=replace(mission, rally=order.rally[:1]), now_us=NOW_US + 40_000))
    assert only(peer.send(common.MAVLink_mission_request_list_message(1, 1, 2)), "MISSION_COUNT").count == 1


@pytest.mark.parametrize(
    ("items", "result"),
    [
        ([rally_point(PLACES[0]), rally_point((0, 0))], common.MAV_MISSION_INVALID_PARAM5_X),
        ([rally_point((910_000_000, 0))], common.MAV_MISSION_INVALID_PARAM5_X),
        ([rally_point(PLACES[0], 16)], common.MAV_MISSION_UNSUPPORTED),
        ([rally_point(PLACES[0])._replace(frame=1)], common.MAV_MISSION_UNSUPPORTED_FRAME),
        ([rally_point(PLACES[0])] * 21, common.MAV_MISSION_NO_SPACE),
    ],
)
def test_what_is_no_rally_point_is_refused_and_asks_nothing(items: list[Item], result: int) -> None:
    port, peer = made()
    if len(items) > 20:
        answers = peer.send(common.MAVLink_mission_count_message(1, 1, len(items), RALLY))
    else:
        answers = upload(peer, items, RALLY)
    ack = only(answers, "MISSION_ACK")
    assert (ack.type, ack.mission_type, port.sent) == (result, RALLY, [])


def test_a_fence_of_polygons_and_circles() -> None:
    corners = [Item(5002, (3.0, 0.0, 0.0, math.nan), place, 0) for place in PLACES]
    inner, outer = (Item(command, (50.0, 0.0, 0.0, 0.0), PLACES[0], 0) for command in (5003, 5004))
    polygon, inside, outside = areas_of_items([*corners, inner, outer], on_map)
    assert (polygon.keep, polygon.corners) == (m.Keep.OUT, tuple(map(on_map, PLACES)))
    middle = on_map(PLACES[0])
    distances_m = [
        [math.dist((at.x_m, at.y_m), (middle.x_m, middle.y_m)) for at in area.corners] for area in (inside, outside)
    ]
    assert distances_m[0] == pytest.approx([50.0] * 32)
    # The edges of one that keeps out lie at the circle, and its corners beyond.
    assert distances_m[1] == pytest.approx([50.0 / math.cos(math.pi / 32)] * 32)


@pytest.mark.parametrize(
    "items",
    [
        [Item(5001, (4.0, 0.0, 0.0, 0.0), place, 0) for place in PLACES],
        [Item(5001, (math.nan, 0.0, 0.0, 0.0), place, 0) for place in PLACES],
        [Item(5001, (3.0, 0.0, 0.0, 0.0), place, 0) for place in PLACES[:2]] + [waypoint(2)],
        [Item(5003, (math.nan, 0.0, 0.0, 0.0), PLACES[0], 0)],
        [Item(5000, (0.0, 0.0, 0.0, 0.0), PLACES[0], 0)],
    ],
)
def test_a_fence_that_is_not_whole_is_refused(items: list[Item]) -> None:
    with pytest.raises(ItemError, match="item 0: "):
        areas_of_items(items, on_map)


def test_what_the_operators_process_answers() -> None:
    assert mission_result(MissionAnswer(m.MissionRefusal.NONE)) == (common.MAV_MISSION_ACCEPTED, "")
    assert mission_result(MissionAnswer(m.MissionRefusal.INVALID, "legs[0]: x")) == (
        common.MAV_MISSION_INVALID,
        "legs[0]: x",
    )
    assert mission_result(None)[0] == common.MAV_MISSION_ERROR
    for refusal in m.MissionRefusal:
        result, text = mission_result(MissionAnswer(refusal))
        assert (result == common.MAV_MISSION_ACCEPTED) is (refusal is m.MissionRefusal.NONE)
        assert len(text) <= 50


def test_an_order_is_shown_once_a_download_gives_it() -> None:
    """The mission in force is heard later than the answer of the operator's process."""
    port, peer = made()
    for kind, part in ((MISSION, "legs"), (RALLY, "rally")):
        upload(peer, [waypoint(0) if kind == MISSION else Item(5100, place_e7=PLACES[1])], kind)
        order = port.sent[-1]
        assert not port.gateway.missions.shows(order)
        port.gateway.tick(in_order())
        assert not port.gateway.missions.shows(order)
        port.gateway.tick(
            in_order(mission=m.Mission(source_us=1, name="a", **{"legs": (), part: getattr(order, part)}))
        )
        assert port.gateway.missions.shows(order)


def test_the_same_mission_uploaded_once_more_is_shown_when_the_plan_has_its_items() -> None:
    port, peer = made()
    upload(peer, [waypoint(0)])
    in_force = in_order(mission=m.Mission(source_us=1, name="a", legs=port.sent[-1].legs or ()))
    port.gateway.tick(in_force)
    upload(peer, [waypoint(0)])
    assert not port.gateway.missions.shows(port.sent[-1])
    port.gateway.tick(in_force)
    assert port.gateway.missions.shows(port.sent[-1])


def test_nothing_is_shown_before_the_mission_is_known() -> None:
    port, peer = made()
    upload(peer, [waypoint(0)])
    port.gateway.tick(in_order(route=None, mission=None))
    assert not port.gateway.missions.shows(port.sent[-1])
