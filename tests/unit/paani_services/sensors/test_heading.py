"""Headings of compasses and antenna pairs."""

from __future__ import annotations

import math

import pytest

from paani.messages import ImuSample
from paani_services.sensors.heading import Heading, YawKeeper, read_heading, true_yaw_rad
from paani_services.sensors.sentences import read_sentence
from tests.unit.paani_services.sensors.sensor_bench import HEADING, Bench
from tests.unit.paani_services.sensors.written import sentence


def read(body: str, variation_deg: float | None = None, offset_deg: float = 0.0) -> Heading:
    _, found = read_sentence(sentence(body).encode())
    assert found is not None
    return read_heading(found, variation_deg, offset_deg)


def heading_deg(body: str, variation_deg: float | None = None, offset_deg: float = 0.0) -> float:
    yaw_rad = read(body, variation_deg, offset_deg).yaw_rad
    assert yaw_rad is not None
    return round((90.0 - math.degrees(yaw_rad)) % 360.0, 6)


@pytest.mark.parametrize(
    ("body", "variation_deg", "true_deg"),
    [
        ("GNHDT,123.4,T", None, 123.4),
        ("GNTHS,123.4,A", None, 123.4),
        ("HCHDG,101.1,,,7.1,W", None, 94.0),
        ("HCHDG,101.1,2.0,E,7.1,E", None, 110.2),
        ("HCHDG,101.1,2.0,W,,", 5.0, 104.1),
        ("HCHDG,101.1,,,7.1,W", 5.0, 94.0),
        ("HCHDM,355.0,M", 10.0, 5.0),
        ("HCHDM,5.0,M", -10.0, 355.0),
    ],
)
def test_headings_become_true_ones(body: str, variation_deg: float | None, true_deg: float) -> None:
    assert heading_deg(body, variation_deg) == pytest.approx(true_deg)


def test_a_pair_of_antennas_across_the_boat_is_turned_ahead() -> None:
    assert heading_deg("GNHDT,100.0,T", offset_deg=90.0) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("HCHDM,355.0,M", "variation"),
        ("HCHDG,355.0,,,,", "variation"),
        ("IIHDT,,T", "HDT is empty"),
        ("IIHDM,,M", "HDM is empty"),
        ("GNTHS,,V", "mode 'V'"),
        ("GNTHS,12.0,E", "mode 'E'"),
    ],
)
def test_what_is_no_true_heading_says_why(body: str, problem: str) -> None:
    found = read(body)
    assert found.yaw_rad is None
    assert problem in found.problem


@pytest.mark.parametrize("body", ["GNHDT,361,T", "GNHDT,nan,T", "HCHDG,10,1,X,,", "HCHDG,10,,,5,", "GNHDT,-1,T"])
def test_an_impossible_heading_is_refused(body: str) -> None:
    with pytest.raises(ValueError, match="HD"):
        read(body)


def test_the_gyro_carries_a_heading_on_until_it_is_too_old() -> None:
    keeper = YawKeeper(max_age_s=1.5)
    assert keeper.take_sample(0.2, 1_000_000) is None
    keeper.take_heading(1.0, 1_010_000)
    yaws = [keeper.take_sample(0.2, 1_010_000 + 10_000 * step) for step in range(1, 152)]
    assert yaws[99] == pytest.approx(1.2)
    assert yaws[149] == pytest.approx(1.3)
    assert yaws[150] is None


def test_a_heading_is_not_carried_over_a_gap_of_the_gyro() -> None:
    keeper = YawKeeper(max_age_s=1.5)
    keeper.take_heading(1.0, 1_000_000)
    assert keeper.take_sample(0.0, 1_010_000) == pytest.approx(1.0)
    assert keeper.take_sample(0.0, 1_310_000) is None
    assert keeper.take_sample(0.0, 1_320_000) is None


def test_a_magnetic_yaw_is_used_with_the_variation_alone() -> None:
    assert true_yaw_rad(1.0, "true", None) == 1.0
    assert true_yaw_rad(1.0, "magnetic", None) is None
    assert true_yaw_rad(1.0, "magnetic", 10.0) == pytest.approx(1.0 - math.radians(10.0))
    assert true_yaw_rad(1.0, "none", 10.0) is None


def test_of_several_instruments_one_gives_the_heading_until_it_is_silent() -> None:
    """HDG reads 8 degrees less than both HDT, which differ by 30."""

    def headings(*bodies: str, rounds: int = 5) -> list[int]:
        found: list[ImuSample] = []
        for _ in range(rounds):
            bench.suite.take(HEADING, b"".join(sentence(body).encode() for body in bodies), bench.now_us)
            found += bench.run_imu(0.3)
        return [round(90.0 - math.degrees(each.yaw_rad)) for each in found if each.orientation_available]

    bench = Bench()
    compass, pair, other = "HCHDG,80.0,,,2.0,E", "HEHDT,90.0,T", "HCHDT,120.0,T"
    assert set(headings(compass)) == {82}
    assert set(headings(compass, pair)) == {90}  # it is preferred
    assert set(headings(other, compass, pair)) == {90}
    assert headings(other, compass, rounds=6) == [90] * 120 + [120] * 30  # none in between: the last is too old
    assert set(headings("HCHDT,,T", compass, rounds=6)[-30:]) == {82}
