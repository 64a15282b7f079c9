"""The conversation with ground stations, over the parser that they use."""

from __future__ import annotations

import math
import os
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani_services.mavlink import commands
from paani_services.mavlink.commands import Act
from paani_services.mavlink.station import BURST_BYTES
from tests.mavlink_peer import HEARTBEAT, NOW_US, Peer, Port, armed, in_order, kinds, odometry, only

ASKING = {
    common.MAVLINK_MSG_ID_COMMAND_LONG,
    common.MAVLINK_MSG_ID_COMMAND_INT,
    common.MAVLINK_MSG_ID_SET_MODE,
    common.MAVLINK_MSG_ID_CHANGE_OPERATOR_CONTROL,
}
ARM = common.MAV_CMD_COMPONENT_ARM_DISARM
POINTS = tuple(m.Waypoint(x_m=float(x), y_m=0.0) for x in range(4))
ROUTE = m.Route(source_us=NOW_US, name="r", waypoints=POINTS)


def made(snapshot: Any = None) -> tuple[Port, Peer]:
    port = Port(snapshot or in_order(route=ROUTE))
    return port, Peer(port.gateway)


def test_a_station_is_sent_the_heartbeat_alone_until_it_speaks_and_again_when_it_is_silent() -> None:
    port, peer = made()
    port.gateway.tick(in_order(now_us=NOW_US + 20_000))
    assert kinds(peer.received()) == ["HEARTBEAT"]
    peer.send(HEARTBEAT, NOW_US + 30_000)
    port.gateway.tick(in_order(now_us=NOW_US + 2_100_000))
    assert {"SYS_STATUS", "GLOBAL_POSITION_INT", "ATTITUDE", "MISSION_CURRENT"} <= set(kinds(peer.received()))
    for second in range(13, 16):
        port.gateway.tick(in_order(now_us=NOW_US + second * 1_000_000))
    assert set(kinds(peer.received())) == {"HEARTBEAT"}


@pytest.mark.slow
def test_telemetry_at_its_default_rates() -> None:
    """Ten seconds at 50 Hz; nothing is made up for after a pause."""
    port, peer = made()
    peer.send(HEARTBEAT)
    counts: dict[str, int] = {}
    for step in range(500):
        now_us = NOW_US + step * 20_000
        if step % 50 == 0:
            peer.send(HEARTBEAT, now_us)
        port.gateway.tick(in_order(now_us=now_us))
        for kind in kinds(peer.received()):
            counts[kind] = counts.get(kind, 0) + 1
    assert counts["HEARTBEAT"] == counts["SYS_STATUS"] == 10
    assert counts["GPS_RAW_INT"] == 50
    assert counts["GLOBAL_POSITION_INT"] == counts["ATTITUDE"] == 100


def test_what_was_late_is_not_made_up_for() -> None:
    """After five seconds without a look, ten messages a second are ten a second again."""
    port, peer = made()
    peer.send(HEARTBEAT)
    port.gateway.tick(in_order())
    peer.received()
    for step in range(10):
        port.gateway.tick(in_order(now_us=NOW_US + 5_000_000 + step * 20_000))
    assert kinds(peer.received()).count("ATTITUDE") <= 4


def test_a_new_station_is_told_what_holds() -> None:
    stopped = m.OperatorState(source_us=NOW_US, armed=False, stopped=True, by="stop")
    port, peer = made(in_order(operator=stopped))
    peer.send(HEARTBEAT)
    port.gateway.tick(in_order(operator=stopped, now_us=NOW_US + 20_000))
    text = only(peer.received(), "STATUSTEXT").text
    assert text == "STOP by stop: release it on the page"


def test_arming_asks_the_operators_process_for_this_station_alone() -> None:
    port, peer = made()
    other = Peer(port.gateway, 1)
    assert peer.command(ARM, 1.0) == []  # the answer comes when it is done
    (request,) = port.asked
    assert (request.act, request.station, request.command, request.target) == (Act.ARM, peer.station, ARM, (255, 190))
    request.station.acknowledge(request.command, commands.DENIED, request.target, NOW_US, "arm: a STOP holds")
    assert kinds(peer.received()) == ["STATUSTEXT", "COMMAND_ACK"]  # the reason first
    assert other.received() == []


def test_a_broadcast_stops_and_never_arms() -> None:
    port, peer = made()
    assert only(peer.command(ARM, 1.0, target=0), "COMMAND_ACK").result == commands.DENIED
    peer.command(ARM, 0.0, target=0)
    assert [request.act for request in port.asked] == [Act.STOP]


@pytest.mark.parametrize(("target", "component"), [(2, 1), (1, 100), (255, 0)])
def test_what_is_for_somebody_else_is_passed_over(target: int, component: int) -> None:
    port, peer = made()
    command = common.MAVLink_command_long_message(target, component, ARM, 0, 0, 0, 0, 0, 0, 0, 0)
    assert peer.send(command) == []
    assert port.asked == []


def test_our_own_frames_that_come_back_are_passed_over() -> None:
    port, peer = made()
    echo = common.MAVLink(None, 1, 1)
    peer.send_bytes(common.MAVLink_command_long_message(1, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0).pack(echo))
    assert port.asked == []


def test_the_base_mode_of_a_mode_never_arms() -> None:
    port, peer = made()
    peer.send(common.MAVLink_set_mode_message(1, 129, 4))
    peer.command(common.MAV_CMD_DO_SET_MODE, 129.0, 10.0)
    assert [(request.act, request.mode) for request in port.asked] == [
        (Act.MODE, m.DriveMode.IDLE),
        (Act.MODE, m.DriveMode.ROUTE),
    ]
    elsewhere = Peer(port.gateway, 1, local=False)
    assert only(elsewhere.send(common.MAVLink_set_mode_message(1, 129, 4)), "COMMAND_ACK").result == commands.DENIED
    assert len(port.asked) == 2


@pytest.mark.parametrize("base_mode", [0, 128, 220])
def test_a_number_is_no_mode_where_the_base_mode_does_not_say_so(base_mode: int) -> None:
    port, peer = made()
    assert only(peer.send(common.MAVLink_set_mode_message(1, base_mode, 10)), "COMMAND_ACK").result == commands.DENIED
    peer.station._texts_us.clear()
    answers = peer.command(common.MAV_CMD_DO_SET_MODE, float(base_mode), 10.0)
    assert only(answers, "COMMAND_ACK").result == commands.DENIED
    assert port.asked == []


def others(peer: Peer) -> list[bytes]:
    """What else may come through a link, of others and of the station itself."""
    command = common.MAVLink_command_long_message(2, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0)
    vessel = common.MAVLink_heartbeat_message(11, 3, 0, 0, 0, 3)
    return [
        peer.pack(command), peer.pack(vessel, 2), peer.pack(HEARTBEAT, 254),
        peer.pack(common.MAVLink_radio_status_message(0, 0, 0, 0, 0, 0, 0), 51),
    ]  # fmt: skip


def test_the_heartbeat_of_who_armed_alone_says_that_it_is_there() -> None:
    """Not a radio, another boat, another station behind the same router, nor what the station says to others."""
    port, peer = made()
    peer.command(ARM, 1.0)
    for frame in others(peer):
        peer.send_bytes(frame, NOW_US + 1_000_000)
    assert port.gateway.commander_us == NOW_US
    peer.send(HEARTBEAT, NOW_US + 2_000_000)
    assert port.gateway.commander_us == NOW_US + 2_000_000


def test_who_takes_the_wheel_is_the_one_that_must_be_there() -> None:
    port, peer = made()
    peer.command(ARM, 1.0)
    other = Peer(port.gateway, 1)
    other.send_bytes(other.pack(common.MAVLink_change_operator_control_message(1, 0, 0, b""), 254), NOW_US)
    peer.send(HEARTBEAT, NOW_US + 1_000_000)
    assert port.gateway.commander_us == NOW_US
    other.send_bytes(other.pack(HEARTBEAT, 254), NOW_US + 2_000_000)
    assert port.gateway.commander_us == NOW_US + 2_000_000


def test_until_somebody_has_asked_any_ground_station_will_do() -> None:
    """As after a start of this process while the boat is armed by an earlier one."""
    port, peer = made()
    for frame in others(peer)[:2]:
        peer.send_bytes(frame)
    assert port.gateway.commander_us is None
    peer.send_bytes(peer.pack(HEARTBEAT, 254))
    assert port.gateway.commander_us == NOW_US


@pytest.mark.parametrize("kind", [0, 1, 33, 42, 148])
def test_a_message_is_sent_on_request_before_the_ack(kind: int) -> None:
    _, peer = made()
    message, ack = peer.command(common.MAV_CMD_REQUEST_MESSAGE, float(kind))
    assert message.get_msgId() == kind
    assert (ack.get_type(), ack.result, ack.target_system, ack.target_component) == ("COMMAND_ACK", 0, 255, 190)


@pytest.mark.parametrize(("kind", "result"), [(269.0, 3), (435.0, 3), (math.nan, 3), (242.0, 1)])
def test_what_is_not_known_is_not_sent_on_request(kind: float, result: int) -> None:
    _, peer = made()
    (ack,) = peer.command(common.MAV_CMD_REQUEST_MESSAGE, kind)
    assert ack.result == result


def test_a_station_sets_its_own_rates() -> None:
    port, peer = made()
    other = Peer(port.gateway, 1)
    interval = common.MAV_CMD_SET_MESSAGE_INTERVAL
    assert only(peer.command(interval, 33.0, -1.0), "COMMAND_ACK").result == 0
    assert only(peer.command(interval, 30.0, 1.0), "COMMAND_ACK").result == 0  # as often as this process looks
    for refused in ((0.0, -1.0), (9999.0, 1e5), (33.0, math.nan), (math.inf, 1e5)):
        assert only(peer.command(interval, *refused), "COMMAND_ACK").result == commands.DENIED
    other.send(HEARTBEAT)
    for step in range(50):
        port.gateway.tick(in_order(now_us=NOW_US + step * 20_000))
    mine, theirs = kinds(peer.received()), kinds(other.received())
    assert (mine.count("GLOBAL_POSITION_INT"), theirs.count("GLOBAL_POSITION_INT")) == (0, 10)
    assert (mine.count("ATTITUDE"), theirs.count("ATTITUDE")) == (50, 10)
    assert only(peer.command(common.MAV_CMD_GET_MESSAGE_INTERVAL, 30.0), "MESSAGE_INTERVAL").interval_us == 20_000
    peer.command(interval, 33.0, 0.0)
    assert only(peer.command(common.MAV_CMD_GET_MESSAGE_INTERVAL, 33.0), "MESSAGE_INTERVAL").interval_us == 100_000


def test_pings_are_answered_and_answers_are_not() -> None:
    _, peer = made()
    (answer,) = peer.send(common.MAVLink_ping_message(123, 4, 0, 0))
    assert (answer.time_usec, answer.seq, answer.target_system, answer.target_component) == (123, 4, 255, 190)
    assert peer.send(common.MAVLink_ping_message(123, 4, 1, 1)) == []
    assert only(peer.send(common.MAVLink_timesync_message(0, 77)), "TIMESYNC").ts1 == 77
    assert peer.send(common.MAVLink_timesync_message(5, 77)) == []


def test_a_file_is_refused_at_once() -> None:
    _, peer = made()
    payload = [5, 0, 9, 4, 3, 0, 0, 0, 0, 0, 0, 0, *b"@PARAM/param.pck"]
    request = common.MAVLink_file_transfer_protocol_message(0, 1, 1, payload + [0] * (251 - len(payload)))
    (nak,) = peer.send(request)
    assert nak.payload[:7] == [6, 0, 9, 129, 1, 4, 0]
    assert nak.payload[12] == 10
    assert peer.send(common.MAVLink_file_transfer_protocol_message(0, 1, 1, nak.payload)) == []  # no ping-pong


def test_the_whole_list_of_parameters_and_no_more() -> None:
    port, peer = made()
    peer.send(common.MAVLink_param_request_list_message(1, 1))
    values = []
    for step in range(1, 100):
        port.gateway.tick(in_order(now_us=NOW_US + step * 20_000))
        values += [each for each in peer.received() if each.get_type() == "PARAM_VALUE"]
    assert [each.param_index for each in values] == list(range(values[0].param_count))


def test_a_parameter_is_read_by_name_or_number() -> None:
    _, peer = made()
    (value,) = peer.send(common.MAVLink_param_request_read_message(1, 1, b"CRUISE_SPEED", -1))
    assert value.param_value == pytest.approx(0.6)
    (same,) = peer.send(common.MAVLink_param_request_read_message(1, 1, b"", 0))
    assert same.param_index == 0
    (unknown,) = peer.send(common.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1))
    assert (unknown.param_id, unknown.error) == ("NO_SUCH", common.MAV_PARAM_ERROR_DOES_NOT_EXIST)
    assert peer.send(common.MAVLink_param_request_read_message(1, 1, b"", 9999)) == []


def test_the_mission_is_downloaded_item_by_item() -> None:
    _, peer = made()
    count = only(peer.send(common.MAVLink_mission_request_list_message(1, 1, 0)), "MISSION_COUNT").count
    assert count == 6
    requests = [common.MAVLink_mission_request_int_message(1, 1, seq, 0) for seq in range(6)]
    items = [only(peer.send(request), "MISSION_ITEM_INT") for request in requests]
    assert [item.seq for item in items] == list(range(6))
    assert [item.command for item in items] == [16, 16, 16, 16, 16, 177]
    beyond = only(peer.send(common.MAVLink_mission_request_int_message(1, 1, 6, 0)), "MISSION_ACK")
    assert beyond.type == common.MAV_MISSION_INVALID_SEQUENCE
    for kind in (1, 2):
        assert only(peer.send(common.MAVLink_mission_request_list_message(1, 1, kind)), "MISSION_COUNT").count == 0
    for kind in (3, 255):
        ack = only(peer.send(common.MAVLink_mission_request_list_message(1, 1, kind)), "MISSION_ACK")
        assert ack.type == common.MAV_MISSION_UNSUPPORTED


def test_a_mission_stays_as_it_is_while_it_is_downloaded() -> None:
    """The estimate moves meanwhile, and is lost for a moment."""
    port, peer = made()
    request = common.MAVLink_mission_request_int_message(1, 1, 3, 0)
    first = only(peer.send(request), "MISSION_ITEM_INT")
    for pose in (odometry(x_m=10.001, latitude_deg=50.2), None):
        port.gateway.tick(in_order(route=ROUTE, odometry=pose))
        peer.received()
        again = only(peer.send(request), "MISSION_ITEM_INT")
        assert (again.x, again.y) == (first.x, first.y)
    port.gateway.tick(in_order())
    peer.received()
    assert only(peer.send(request), "MISSION_ACK").type == common.MAV_MISSION_INVALID_SEQUENCE


def test_a_part_of_a_mission_is_not_taken() -> None:
    port, peer = made()
    answers = peer.send(common.MAVLink_mission_write_partial_list_message(1, 1, 0, 3, 0))
    assert kinds(answers) == ["STATUSTEXT", "MISSION_ACK"]
    assert answers[1].type == common.MAV_MISSION_UNSUPPORTED
    assert (port.asked, port.sent) == ([], [])


def test_nothing_jumps_to_an_item_and_a_station_that_asks_on_gets_no_answer_to_each() -> None:
    """MAVSDK asks again whenever it hears of another item than it has asked for."""
    port, peer = made(armed(route=ROUTE))
    answers = [message for _ in range(50) for message in peer.send(common.MAVLink_mission_set_current_message(1, 1, 2))]
    assert kinds(answers) == ["STATUSTEXT", "MISSION_CURRENT"]
    assert (answers[0].text, answers[1].seq) == (commands.NO_JUMP, 1)
    elsewhere = Peer(port.gateway, 1)
    text, ack = elsewhere.command(common.MAV_CMD_DO_SET_MISSION_CURRENT, 2.0)
    assert (text.text, ack.result) == (commands.NO_JUMP, commands.DENIED)
    assert (port.asked, port.sent) == ([], [])


def test_progress_is_told_when_it_is_made() -> None:
    port, peer = made(armed(route=ROUTE))
    peer.send(HEARTBEAT)

    def order(waypoint: int, reached: int) -> m.NavCommand:
        return m.NavCommand(source_us=0, enable=True, heading_rad=0.0, speed_mps=0.5, waypoint_index=waypoint,
                            waypoints_reached=reached)  # fmt: skip

    port.gateway.tick(armed(route=ROUTE, command=order(1, 0)))
    peer.received()
    port.gateway.tick(armed(route=ROUTE, command=order(2, 1)))
    messages = peer.received()
    assert only(messages, "MISSION_ITEM_REACHED").seq == 2
    assert only(messages, "MISSION_CURRENT").seq == 3


@pytest.mark.slow
def test_a_station_that_floods_is_not_heard_and_is_again_later() -> None:
    port, peer = made()
    frame = peer.pack(HEARTBEAT)
    for _ in range(BURST_BYTES // len(frame) + 1):
        peer.send_bytes(frame)
    assert port.counted == ["mavlink_flood"]
    assert peer.command(ARM, 0.0) == []
    assert port.asked == []
    other = Peer(port.gateway, 1)
    other.command(ARM, 0.0)
    assert [request.station for request in port.asked] == [other.station]
    peer.command(ARM, 0.0, now_us=NOW_US + 1_000_000)
    assert len(port.asked) == 2


@given(st.binary(max_size=600), st.integers(1, 40))
@pytest.mark.slow
def test_bytes_of_any_kind_do_nothing_and_the_next_frame_is_read(noise: bytes, chunk: int) -> None:
    """In pieces of any size. What looks like the beginning of a frame takes at most 280 bytes with it."""
    port, peer = made()
    for at in range(0, len(noise), chunk):
        peer.send_bytes(noise[at : at + chunk])
    assert port.asked == []
    for _ in range(20):
        peer.send(HEARTBEAT)
    peer.command(ARM, 0.0)
    assert [request.act for request in port.asked] == [Act.STOP]


def test_what_a_parser_keeps_of_noise_is_less_than_a_frame() -> None:
    _, peer = made()
    for _ in range(50):
        peer.send_bytes(b"\xfd\xff" + os.urandom(100))
    assert len(peer.station._codec._parser.buf) <= 300


@given(st.data())
def test_any_message_of_the_dialect_is_survived(data: st.DataObject) -> None:
    """With numbers of any kind in its fields: nothing is raised, and nothing but a command asks for anything."""
    port, peer = made()
    kind = data.draw(st.sampled_from(sorted(common.mavlink_map)))
    length = common.mavlink_map[kind].unpacker.size
    payload = data.draw(st.binary(min_size=length, max_size=length))
    message = common.MAVLink_message(kind, "any")
    frame = bytes(_packed(message, common.mavlink_map[kind].crc_extra, payload))
    peer.send_bytes(frame)
    port.gateway.tick(in_order(now_us=NOW_US + 20_000))
    peer.received()
    if kind not in ASKING:
        assert port.asked == []


def _packed(message: Any, crc_extra: int, payload: bytes) -> bytes:
    """The frame of a payload of raw bytes."""
    sender = common.MAVLink(None, 255, 190)
    return bytes(common.MAVLink_message._pack(message, sender, crc_extra, payload))
