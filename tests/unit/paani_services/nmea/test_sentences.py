"""NMEA 0183 out, read back by pynmeagps: places, courses, targets, and nothing of what is not known."""

from __future__ import annotations

import math
from datetime import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pynmeagps import NMEAReader

from paani import messages as m
from paani_services.nmea.sentences import degrees_text, position_sentences, target_sentences

AT_US = 1_767_323_045_600_000  # 2026-01-02 03:04:05.6 UTC
METRES_PER_NAUTICAL_MILE = 1852.0


def odometry(**changes: object) -> m.Odometry:
    fields = {
        "source_us": AT_US, "x_m": 10.0, "y_m": 20.0, "yaw_rad": math.pi / 2, "surge_mps": 1.0, "healthy": True,
        "latitude_deg": 50.1072, "longitude_deg": -8.5,
    }  # fmt: skip
    return m.Odometry(**{**fields, **changes})  # type: ignore[arg-type]


def obstacle(**changes: object) -> m.MovingObstacle:
    fields = {"track_id": 7, "x_m": 10.0, "y_m": 57.04, "radius_m": 0.5, "east_mps": 0.5, "north_mps": 0.0}
    return m.MovingObstacle(**{**fields, **changes})  # type: ignore[arg-type]


def read(lines: list[str]) -> dict[str, object]:
    """By sentence; the reader checks checksums and fields."""
    found = [NMEAReader.parse(line.encode("ascii"), validate=1) for line in lines]
    return {message.msgID: message for message in found if message is not None}


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0))
def test_every_place_is_read_back(latitude_deg: float, longitude_deg: float) -> None:
    rmc = read(position_sentences(odometry(latitude_deg=latitude_deg, longitude_deg=longitude_deg)))["RMC"]
    assert rmc.lat == pytest.approx(latitude_deg, abs=1e-7)  # type: ignore[attr-defined]
    assert rmc.lon == pytest.approx(longitude_deg, abs=1e-7)  # type: ignore[attr-defined]


@given(st.floats(0.0, 179.9999999))
def test_no_minute_is_written_as_sixty(angle_deg: float) -> None:
    text, _ = degrees_text(angle_deg, "EW", 3)
    assert len(text) == len("00000.00000")
    assert float(text[3:]) < 60.0


def test_the_estimate_in_the_units_of_the_standard() -> None:
    found = read(position_sentences(odometry()))
    rmc, gga, hdt = found["RMC"], found["GGA"], found["HDT"]
    assert (rmc.status, rmc.posMode, rmc.time) == ("A", "E", time(3, 4, 5, 600_000))  # type: ignore[attr-defined]
    assert rmc.spd == pytest.approx(1.0 / 0.514444, abs=0.01)  # type: ignore[attr-defined]
    assert rmc.cog == hdt.headingT == 0.0  # type: ignore[attr-defined]  # north
    assert gga.quality == 6  # type: ignore[attr-defined]


def test_course_and_heading_differ_in_a_current() -> None:
    found = read(position_sentences(odometry(yaw_rad=0.0, surge_mps=1.0, sway_mps=1.0)))
    assert found["HDT"].headingT == 90.0  # type: ignore[attr-defined]
    assert found["RMC"].cog == 45.0  # type: ignore[attr-defined]


def test_a_boat_that_stands_has_no_course() -> None:
    assert position_sentences(odometry(stopped=True))[0].split(",")[8] == ""


@pytest.mark.parametrize("estimate", [None, odometry(healthy=False)])
def test_without_an_estimate_there_is_no_position_no_heading_and_no_target(estimate: m.Odometry | None) -> None:
    lines = position_sentences(estimate)
    assert [line[:6] for line in lines] == ["$IIRMC", "$IIGGA"]
    assert lines[0].split(",")[2] == "V"
    assert lines[1].split(",")[6] == "0"
    assert not any(
        digit in field for line in lines for field in line.split("*")[0].split(",")[3:6] for digit in "123456789"
    )
    assert target_sentences(estimate, m.Prediction(source_us=AT_US, obstacles=(obstacle(),))) == []


def test_a_target_by_bearing_distance_and_motion() -> None:
    line = target_sentences(odometry(), m.Prediction(source_us=AT_US, obstacles=(obstacle(),)))[0]
    ttm = read([line])["TTM"]
    assert ttm.targetnum == 7  # type: ignore[attr-defined]
    assert ttm.targetdist * METRES_PER_NAUTICAL_MILE == pytest.approx(37.04, abs=0.1)  # type: ignore[attr-defined]
    assert ttm.targetbearing == 0.0  # type: ignore[attr-defined]
    assert ttm.targetcourse == 90.0  # type: ignore[attr-defined]
    assert ttm.targetspeed == pytest.approx(0.97, abs=0.005)  # type: ignore[attr-defined]
    assert ttm.targetstatus == "T"  # type: ignore[attr-defined]
    unseen = target_sentences(odometry(), m.Prediction(source_us=AT_US, obstacles=(obstacle(age_s=1.5),)))[0]
    assert read([unseen])["TTM"].targetstatus == "Q"  # type: ignore[attr-defined]


@given(st.lists(st.integers(0, 1000), max_size=120))
def test_no_two_targets_have_one_number(track_ids: list[int]) -> None:
    """What is known by AIS alone has no track, and tracks go on beyond 99."""
    found = m.Prediction(source_us=AT_US, obstacles=tuple(obstacle(track_id=each) for each in track_ids))
    lines = target_sentences(odometry(), found)
    numbers = [line.split(",")[1] for line in lines]
    assert len(numbers) == len(set(numbers)) == min(len(track_ids), 99)
    if track_ids:
        assert int(numbers[0]) == track_ids[0] % 100


@pytest.mark.parametrize(("longitude_deg", "text"), [(180.001, "17959.94000,W"), (-180.001, "17959.94000,E")])
def test_a_place_beyond_the_antimeridian_has_its_own_longitude(longitude_deg: float, text: str) -> None:
    assert text in position_sentences(odometry(longitude_deg=longitude_deg))[0]
