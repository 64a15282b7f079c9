"""What stations write is asked to be tried, and answered by the value in force; nothing is in force by it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani_services.mavlink import commands
from tests.mavlink_peer import HEARTBEAT, NOW_US, Peer, Port, in_order, kinds, only

NAME, PATH = b"POL_CEN_BLO_RIS", "advisor.policy.center_block_risk"
REAL = common.MAV_PARAM_TYPE_REAL32
TRIED = m.Shadow(source_us=NOW_US, proposal="mavlink7f3a", changes=(m.Change(path=PATH, value="0.46"),))
PROMOTED = m.Shadow(source_us=NOW_US, active="mavlink7f3a", active_changes=TRIED.changes)


def writing(name: bytes, value: float) -> Any:
    return common.MAVLink_param_set_message(1, 1, name, value, REAL)


def made(shadow: m.Shadow | None = None, *, local: bool = True) -> tuple[Port, Peer]:
    port = Port(in_order(shadow=shadow or m.Shadow(source_us=NOW_US)))
    return port, Peer(port.gateway, local=local)


def test_a_tunable_parameter_is_asked_to_be_tried() -> None:
    port, peer = made()
    assert peer.send(writing(NAME, 0.46)) == []  # the answer comes when it is on trial
    (write,) = port.written
    assert (write.station, write.target, write.path, write.text) == (peer.station, (255, 190), PATH, "0.46")
    port.gateway.parameters.answer(write, common.MAV_PARAM_ERROR_PERMISSION_DENIED, "on trial")
    text, error, value = peer.received()
    assert text.text == "on trial"
    assert (error.param_id, error.error) == (NAME.decode(), common.MAV_PARAM_ERROR_PERMISSION_DENIED)
    assert (error.target_system, error.target_component, error.param_index) == (255, 190, -1)
    assert value.param_value == pytest.approx(0.48)  # in force
    assert port.asked == []


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        (b"CRUISE_SPEED", 3.0, common.MAV_PARAM_ERROR_READ_ONLY),
        (b"SYSID_THISMAV", 2.0, common.MAV_PARAM_ERROR_READ_ONLY),
        (b"FENCE_ENABLE", 0.0, common.MAV_PARAM_ERROR_READ_ONLY),
        (NAME, math.nan, common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
        (NAME, math.inf, common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
        (b"MOT_MIN_SAM", 4.5, common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
    ],
)
def test_what_cannot_be_tried_is_refused_with_the_value_that_holds(name: bytes, value: float, error: int) -> None:
    port, peer = made()
    answers = [message for _ in range(6) for message in peer.send(writing(name, value))]
    assert kinds(answers).count("STATUSTEXT") == 1  # however often it is tried
    assert {each.error for each in answers if each.get_type() == "PARAM_ERROR"} == {error}
    old = only(peer.send(common.MAVLink_param_request_read_message(1, 1, name, -1)), "PARAM_VALUE").param_value
    assert [each.param_value for each in answers if each.get_type() == "PARAM_VALUE"] == [old] * 6
    assert port.counted == ["mavlink_refused"] * 6
    assert port.written == []


def test_an_unknown_name_does_not_exist() -> None:
    port, peer = made()
    (error,) = peer.send(writing(b"NO_SUCH", 1.0))
    assert error.error == common.MAV_PARAM_ERROR_DOES_NOT_EXIST
    assert port.written == []


def test_stations_elsewhere_do_not_write_without_a_signature() -> None:
    port, peer = made(local=False)
    text, error, value = peer.send(writing(NAME, 0.46))
    assert (text.text, error.error) == (commands.NOT_TRUSTED, common.MAV_PARAM_ERROR_PERMISSION_DENIED)
    assert value.param_value == pytest.approx(0.48)
    assert port.written == []


def test_writing_what_holds_changes_nothing_but_takes_it_off_a_trial() -> None:
    port, peer = made()
    (value,) = peer.send(writing(NAME, 0.48))
    assert value.get_type() == "PARAM_VALUE"
    assert port.written == []
    port, peer = made(TRIED)
    assert peer.send(writing(NAME, 0.48)) == []
    assert [write.text for write in port.written] == ["0.48"]


def test_every_station_is_told_what_is_in_force_when_that_changes() -> None:
    port = Port(in_order())
    peer, other = Peer(port.gateway), Peer(port.gateway, 1)
    for station in (peer, other):
        station.send(HEARTBEAT)

    def values(shadow: m.Shadow | None) -> list[list[tuple[str, Any]]]:
        port.gateway.tick(in_order(shadow=shadow))
        sent = [station.received() for station in (peer, other)]
        return [[(v.param_id, v.param_value) for v in each if v.get_type() == "PARAM_VALUE"] for each in sent]

    assert values(m.Shadow(source_us=NOW_US)) == [[], []]  # heard for the first time
    assert values(TRIED) == [[], []]
    changed = [(NAME.decode(), pytest.approx(0.46))]
    assert values(PROMOTED) == [changed, changed]
    assert values(replace(PROMOTED, frames=5)) == [[], []]
    assert values(None) == [[], []]  # silent
    back = [(NAME.decode(), pytest.approx(0.48))]
    assert values(m.Shadow(source_us=NOW_US)) == [back, back]
