"""DPT and DBT sentences in, soundings out; what cannot be is refused and counted."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import SensorDevicesConfig, SonarConfig
from paani.messages import Depth, SensorDevice, SensorRole, SensorStatus
from paani_services.sensors.suite import SensorSuite
from tests.unit.paani_services.sensors.written import sentence

LINE = "serial:/dev/sonar@4800"
START_US = 1_700_000_000_000_000


class Sounder:
    """A line with a sounder, and a clock that the test moves."""

    def __init__(self, transducer_m: float = 0.25) -> None:
        self.now_us = START_US
        self.suite = SensorSuite(SensorDevicesConfig(sonar=SonarConfig(line=LINE, transducer_m=transducer_m)))
        self.suite.opened(LINE, self.now_us)

    def say(self, *bodies: str) -> tuple[Depth, ...]:
        self.now_us += 500_000
        return self.suite.take(LINE, "".join(sentence(body) for body in bodies).encode(), self.now_us).depths

    def device(self) -> SensorDevice:
        return next(each for each in self.suite.report(self.now_us) if each.role is SensorRole.SONAR)


@given(st.floats(0.01, 500.0), st.floats(0.0, 2.0))
def test_the_depth_counts_from_the_surface_whatever_offset_the_device_states(depth_m: float, deep_m: float) -> None:
    written = f"{depth_m:.3f}"
    for body in (f"SDDPT,{written},0.4,100.0", f"SDDPT,{written},-0.9,", f"SDDBT,,f,{written},M,,F"):
        [sounding] = Sounder(deep_m).say(body)
        assert sounding.available
        assert sounding.depth_m == pytest.approx(float(written) + deep_m)
        assert sounding.source_us == START_US + 500_000


def test_feet_count_where_there_are_no_metres() -> None:
    [sounding] = Sounder(0.0).say("SDDBT,10.0,f,,M,,F")
    assert sounding.depth_m == pytest.approx(3.048)


@pytest.mark.parametrize("body", ["SDDPT,,0.0,", "SDDPT,0.0,0.0,", "SDDBT,,f,,M,,F"])
def test_without_an_echo_there_is_no_depth(body: str) -> None:
    sounder = Sounder()
    [sounding] = sounder.say(body)
    assert (sounding.available, sounding.depth_m) == (False, 0.0)
    assert sounder.suite.drops == {"sonar_no_echo": 1}


@pytest.mark.parametrize(
    ("body", "cause"),
    [
        ("SDDPT,-0.5,0.0,", "sonar_negative"),
        ("SDDPT,13000.0,0.0,", "sonar_too_deep"),
        ("SDDPT,nan,0.0,", "nmea_damaged"),
        ("SDDPT,1e3,0.0,", "nmea_damaged"),
        ("SDDBT,3.0,f", "nmea_damaged"),
    ],
)
def test_what_cannot_be_is_refused_by_cause(body: str, cause: str) -> None:
    sounder = Sounder()
    assert sounder.say(body) == ()
    assert sounder.suite.drops == {cause: 1}


def test_a_sounder_that_writes_both_sentences_is_read_once() -> None:
    sounder = Sounder(0.0)
    assert [each.depth_m for each in sounder.say("SDDBT,,f,2.0,M,,F", "SDDPT,2.0,0.0,")] == [2.0]
    sounder.suite.opened(LINE, sounder.now_us)
    assert len(sounder.say("SDDPT,2.0,0.0,", "SDDBT,,f,2.0,M,,F")) == 1


def test_the_device_is_named_with_what_it_does() -> None:
    sounder = Sounder()
    for _ in range(8):
        sounder.say("SDDPT,2.0,0.0,")
    assert sounder.device().status is SensorStatus.OK
    assert sounder.device().rate_hz == pytest.approx(2.0)
    for _ in range(8):
        sounder.say("SDVLW,1.0,N,1.0,N")
    assert sounder.device().status is SensorStatus.INCOMPLETE
    assert "DPT or DBT" in sounder.device().note
    sounder.now_us += 4_000_000
    assert sounder.device().status is SensorStatus.SILENT
