"""AIS sentences, as pyais writes them, in; vessels out. What lies adds none."""

from __future__ import annotations

import contextlib
import functools
import math
from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyais import encode_dict

from paani.config import AisConfig, SensorDevicesConfig
from paani.geometry import geodetic_from_enu
from paani.messages import SensorDevice, SensorRole, SensorStatus
from paani.messages.ais import MAX_VESSELS
from paani_services.sensors.ais_reports import MAX_SIZES, MEMORY_S, AisReports
from paani_services.sensors.suite import SensorSuite

START_US = 1_700_000_000_000_000
LINE = "serial:/dev/ais@38400"
ORIGIN_DEG = (51.44, -0.95)
BARGE, OWN = 235_000_001, 235_999_999


class Receiver:
    """Reports of vessels at places on a map, and a clock that the test moves."""

    def __init__(self) -> None:
        self.drops, self.now_us = Counter[str](), START_US
        self.reports = AisReports(self.drops, OWN)

    def wait(self, seconds: float) -> None:
        self.now_us += round(seconds * 1e6)

    def say(self, **fields: Any) -> bool:
        lines = encode_dict({"mmsi": BARGE, **fields}, sentence_type="VDM")
        return [self.reports.take_sentence(f"{line}\r\n".encode(), self.now_us) for line in lines][-1]

    def at(self, east_m: float, knots: float = 4.0, course: float = 90.0, kind: int = 1, mmsi: int = BARGE) -> bool:
        lat, lon = geodetic_from_enu(east_m, 0.0, *ORIGIN_DEG)
        return self.say(type=kind, mmsi=mmsi, lat=lat, lon=lon, speed=knots, course=course)

    def longitudes_deg(self) -> dict[int, float]:
        """Longitudes by vessel."""
        return {each.mmsi: each.longitude_deg for each in self.reports.vessels(self.now_us)}


@pytest.mark.parametrize("payload", ["13,0", "53,0", "B3,0", "C3,0", "H3,0", "1300000,0"])
def test_a_report_that_ends_too_soon_is_damage(payload: str) -> None:
    receiver, body = Receiver(), f"!AIVDM,1,1,,A,{payload}"
    checksum = functools.reduce(lambda found, byte: found ^ byte, body[1:].encode(), 0)
    with contextlib.suppress(ValueError):
        assert not receiver.reports.take_sentence(f"{body}*{checksum:02X}\r\n".encode(), START_US)
    assert receiver.reports.vessels(START_US) == ()


@pytest.mark.parametrize("kind", [1, 2, 3, 18, 19])
def test_a_position_report_of_either_class(kind: int) -> None:
    receiver = Receiver()
    assert receiver.at(0.0, knots=4.2, course=91.3, kind=kind)
    [vessel] = receiver.reports.vessels(receiver.now_us)
    assert (vessel.mmsi, vessel.fixed_us) == (BARGE, START_US)
    assert (vessel.latitude_deg, vessel.longitude_deg) == pytest.approx(ORIGIN_DEG, abs=1e-5)
    assert vessel.sog_mps == pytest.approx(4.2 * 0.514444, rel=1e-4)
    assert vessel.cog_rad == pytest.approx(math.radians(-1.3), abs=1e-6)


@pytest.mark.parametrize(("kind", "more"), [(5, {}), (24, {"partno": 1}), (19, {"lat": 51.0, "lon": 0.0})])
def test_the_size_is_that_of_a_report_before_or_after(kind: int, more: dict[str, float]) -> None:
    receiver = Receiver()
    receiver.at(0.0)
    receiver.say(type=kind, to_bow=9, to_stern=5, to_port=2, to_starboard=1, **more)
    [vessel] = receiver.reports.vessels(receiver.now_us)
    assert (vessel.to_bow_m, vessel.to_stern_m, vessel.to_port_m, vessel.to_starboard_m) == (9.0, 5.0, 2.0, 1.0)
    receiver.wait(MEMORY_S + 1.0)
    receiver.at(0.0)
    assert receiver.reports.vessels(receiver.now_us)[0].to_bow_m == 9.0


@pytest.mark.parametrize(
    ("fields", "cause"),
    [
        ({"speed": 100.0}, "ais_too_fast"),
        ({"mmsi": OWN}, "ais_own"),
        ({"lat": 91.0, "lon": 181.0}, "ais_incomplete"),
        ({"speed": 102.3}, "ais_incomplete"),
        ({"course": 360.0}, "ais_incomplete"),
    ],
)
def test_what_cannot_be_adds_no_vessel_and_is_counted(fields: dict[str, Any], cause: str) -> None:
    receiver = Receiver()
    whole: dict[str, Any] = {"type": 1, "lat": 51.44, "lon": -0.95, "speed": 4.0, "course": 90.0}
    assert not receiver.say(**{**whole, **fields})
    assert receiver.longitudes_deg() == {}
    assert receiver.drops == {cause: 1}


def test_a_vessel_that_jumps_is_believed_when_its_next_report_bears_that_out() -> None:
    receiver = Receiver()
    assert receiver.at(0.0)
    here = receiver.longitudes_deg()
    receiver.wait(10.0)
    assert not receiver.at(800.0)
    assert receiver.longitudes_deg() == here
    assert receiver.at(20.0), "the one that was known goes on"
    assert not receiver.at(800.0)
    receiver.wait(10.0)
    assert receiver.at(820.0)
    assert receiver.longitudes_deg() != here
    assert receiver.drops == {"ais_jumped": 2}


def test_a_vessel_that_is_silent_is_forgotten() -> None:
    receiver = Receiver()
    receiver.at(0.0)
    receiver.wait(MEMORY_S - 1.0)
    assert set(receiver.longitudes_deg()) == {BARGE}
    receiver.wait(2.0)
    assert receiver.longitudes_deg() == {}


@pytest.mark.slow
def test_a_crowd_is_bounded_and_its_newest_are_told() -> None:
    receiver = Receiver()
    for number in range(MAX_VESSELS + 10):
        receiver.wait(0.01)
        receiver.at(0.0, mmsi=1000 + number)
    assert set(receiver.longitudes_deg()) == set(range(1010, 1010 + MAX_VESSELS))
    for number in range(MAX_SIZES + 10):
        receiver.say(type=24, partno=1, mmsi=number, to_bow=1)
    assert len(receiver.reports._sizes) == MAX_SIZES


@given(st.lists(st.text(st.characters(codec="ascii", exclude_characters="\r\n"), max_size=80), max_size=30))
@pytest.mark.slow
def test_any_payload_is_survived_and_little_is_kept(payloads: list[str]) -> None:
    receiver = Receiver()
    for number, payload in enumerate(payloads):
        try:
            receiver.reports.take_sentence(f"!AIVDM,2,1,{number % 10},{number},{payload},0*00".encode(), START_US)
        except ValueError:
            continue
    assert len(receiver.reports._queue.buffer) <= 17
    assert len(receiver.reports.vessels(START_US)) <= MAX_VESSELS


def test_a_receiver_may_hear_nothing_and_says_what_it_hears() -> None:
    suite = SensorSuite(SensorDevicesConfig(ais=AisConfig(line=LINE)))
    suite.opened(LINE, START_US)
    now_us = START_US + 600_000_000

    def device() -> SensorDevice:
        return next(each for each in suite.report(now_us) if each.role is SensorRole.AIS)

    assert device().status is SensorStatus.OK
    assert suite.vessels(now_us) == ()
    report: dict[str, Any] = {"type": 1, "mmsi": BARGE, "lat": 51.44, "lon": -0.95, "speed": 4.0, "course": 0.0}
    [line] = encode_dict(report, sentence_type="VDM")
    suite.take(LINE, f"{line}\r\n".encode(), now_us)
    assert [each.mmsi for each in suite.vessels(now_us) or ()] == [BARGE]
    suite.take(LINE, line.replace("*", "x*").encode() + b"\r\n", now_us)
    assert (device().checksum_failures, device().frames) == (1, 1)
    suite.take(LINE, encode_dict(report)[0].encode() + b"\r\n", now_us)
    assert suite.drops == {"nmea_checksum": 1}, "what our own transponder says (VDO) is nobody else"
    now_us += 3_000_000
    suite.take(LINE, b"\x80\x81" * 40, now_us)
    assert device().status is SensorStatus.UNREADABLE
    suite.lost(LINE, "gone")
    assert suite.vessels(now_us) is None
    assert SensorSuite(SensorDevicesConfig()).vessels(START_US) is None
