"""Link loss: a boat that was armed from here is not left alone; and what the settings refuse."""

from __future__ import annotations

import pytest

from paani import messages as m
from paani.config import load_config
from paani.errors import UserError
from paani_services.mavlink.acts import is_link_lost, is_repeated
from paani_services.mavlink.commands import Act
from paani_services.mavlink.gateway import Request
from tests.mavlink_peer import NOW_US, Peer, Port, armed, in_order

OURS = m.OperatorState(source_us=NOW_US, armed=True, stopped=False, by="mavlink")


@pytest.mark.parametrize(
    ("silent_s", "is_lost"), [(0.0, False), (4.9, False), (5.1, True), (3600.0, True), (-0.1, True)]
)
def test_a_boat_armed_from_here_is_stopped_when_nobody_is_heard(silent_s: float, is_lost: bool) -> None:
    """A clock that was set back is silence too."""
    heard_us = NOW_US - round(silent_s * 1e6)
    assert is_link_lost(armed(operator=OURS), "mavlink", heard_us, 5.0) is is_lost


def test_a_boat_that_somebody_else_armed_goes_on() -> None:
    assert not is_link_lost(armed(), "mavlink", 0, 5.0)  # by the page
    assert not is_link_lost(in_order(), "mavlink", 0, 5.0)
    assert not is_link_lost(armed(operator=None), "mavlink", 0, 5.0)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("mavlink.udp=nowhere", "mavlink.*'nowhere' is no HOST:PORT"),
        ("mavlink.udp=127.0.0.1:14540;127.0.0.1:14550", "mavlink"),
        ("mavlink.tcp=127.0.0.1", "mavlink.*is no HOST:PORT"),
        ("mavlink.udp=" + ",".join(["127.0.0.1:1"] * 9), "mavlink.udp: more than 8 addresses"),
        ("mavlink.link_loss_s=0", "mavlink.link_loss_s"),
        ("mavlink.link_loss_s=61", "mavlink.link_loss_s"),
    ],
)
def test_settings_that_cannot_work_are_refused(setting: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        load_config(sets=(setting,))


def test_several_addresses() -> None:
    config = load_config(sets=("mavlink.udp=127.0.0.1:14540, [::1]:14550",))
    assert config.mavlink.udp_addresses == (("127.0.0.1", 14540), ("::1", 14550))
    assert load_config(sets=('mavlink.udp=""',)).mavlink.udp_addresses == ()


def test_a_mode_that_is_asked_for_once_more_is_answered_once() -> None:
    station = Peer(Port(in_order()).gateway).station
    asked = Request(Act.MODE, station, 176, (255, 190), m.DriveMode.IDLE)
    assert is_repeated(asked._replace(target=(255, 191)), asked)
    for other in (
        asked._replace(mode=m.DriveMode.RETURN),
        asked._replace(command=11),
        asked._replace(act=Act.WHEEL),
    ):
        assert not is_repeated(other, asked)
