"""Steering by hand: whose stick is heard, and that its silence is heard as well."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani_services.mavlink.commands import Act
from tests.mavlink_peer import HEARTBEAT, NOW_US, STATION, Peer, Port, armed, in_order, kinds


def made() -> tuple[Port, Peer]:
    port = Port(in_order())
    return port, Peer(port.gateway)


def manual(z: int, y: int, target: int = 1) -> Any:
    return common.MAVLink_manual_control_message(target, 0, y, z, 0, 0)


def in_manual(peer: Peer, mode: m.DriveMode = m.DriveMode.MANUAL, hand: int = 0) -> Any:
    operator = m.OperatorState(
        source_us=NOW_US, armed=True, stopped=False, mode=mode, wheel_by="mavlink",
        wheel_hand=hand or peer.station.hand_of(STATION),
    )  # fmt: skip
    return armed(operator=operator, now_us=NOW_US + 20_000)


def test_the_hand_at_the_wheel_drives_in_manual() -> None:
    """z is ahead and y to starboard; the newest of a tick is said once, so that silence lets the stick go."""
    port, peer = made()
    snapshot = in_manual(peer)
    port.gateway.tick(snapshot)
    for z, y in ((100, 0), (500, 250)):
        peer.send(manual(z, y))
    assert port.driven == []
    port.gateway.tick(snapshot)
    port.gateway.tick(snapshot)
    assert port.driven == [(0.5, -0.25, peer.station.hand_of(STATION))]


@pytest.mark.parametrize("stick", [(0x7FFF, 0), (0, 0x7FFF), (1001, 0), (0, -1001)])
def test_a_stick_beyond_its_range_is_none(stick: tuple[int, int]) -> None:
    port, peer = made()
    port.gateway.tick(in_manual(peer))
    peer.send(manual(*stick))
    port.gateway.tick(in_manual(peer))
    assert port.driven == []


def test_nobody_else_drives_and_nobody_in_another_mode() -> None:
    port, peer = made()
    other, elsewhere = Peer(port.gateway, 1), Peer(port.gateway, 2, local=False)
    for snapshot, driver in (
        (in_manual(peer), other),
        (in_manual(peer, hand=elsewhere.station.hand_of(STATION)), elsewhere),
        (in_manual(peer, m.DriveMode.ROUTE), peer),
        (in_manual(peer, m.DriveMode.IDLE), peer),
        (armed(operator=None), peer),
    ):
        port.gateway.tick(snapshot)
        driver.received()
        driver.station._texts_us.clear()
        answers = [message for _ in range(50) for message in driver.send(manual(500, 0))]
        assert kinds(answers) == ["STATUSTEXT"]  # now and then, not with each
        port.gateway.tick(snapshot)
    port.gateway.tick(in_manual(peer))
    peer.send(manual(500, 0, target=2))
    port.gateway.tick(in_manual(peer))
    assert port.driven == []


def test_of_two_systems_behind_one_link_the_one_at_the_wheel_drives() -> None:
    port, peer = made()
    snapshot = in_manual(peer)
    port.gateway.tick(snapshot)
    peer.send(manual(0, 0))
    for system in (254, 2):
        peer.send_bytes(peer.pack(manual(1000, 0), system))
    port.gateway.tick(snapshot)
    assert port.driven == [(0.0, 0.0, peer.station.hand_of(STATION))]


def test_the_wheel_is_taken_on_purpose_and_not_given_back() -> None:
    port, peer = made()
    assert peer.send(common.MAVLink_change_operator_control_message(1, 0, 0, b"")) == []
    assert [(request.act, request.station) for request in port.asked] == [(Act.WHEEL, peer.station)]
    (answer,) = peer.send(common.MAVLink_change_operator_control_message(1, 1, 0, b""))
    assert (answer.get_type(), answer.ack, answer.gcs_system_id) == ("CHANGE_OPERATOR_CONTROL_ACK", 2, 255)
    elsewhere = Peer(port.gateway, 1, local=False)
    (answer,) = elsewhere.send(common.MAVLink_change_operator_control_message(1, 0, 0, b""))
    assert answer.ack == 2
    assert len(port.asked) == 1


def test_a_station_that_is_gone_has_no_hand() -> None:
    port, peer = made()
    peer.send(HEARTBEAT)
    hand = peer.station.hand_of(STATION)
    assert port.gateway.hands(NOW_US) == {hand}
    assert port.gateway.hands(NOW_US + 5_100_000) == frozenset()
    port.gateway.remove(peer.station)
    assert port.gateway.hands(NOW_US) == frozenset()
