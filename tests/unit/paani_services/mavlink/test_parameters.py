"""Parameters: names that fit, values that are in force, types that clients of ArduPilot read."""

from __future__ import annotations

import math
import struct

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE
from paani_services.mavlink.parameters import (
    NAME_BYTES,
    Parameter,
    number_of,
    parameters_of,
    path_of,
    tunable_name,
    written_text,
)
from paani_services.mavlink.snapshot import Snapshot
from tests.mavlink_peer import NOW_US, in_order

CONFIG = AdvisorConfig()


def by_name(snapshot: Snapshot) -> dict[str, Parameter]:
    return {each.name: each for each in parameters_of(snapshot, 0.6, CONFIG)}


def test_every_tunable_setting_has_a_name_of_its_own_that_fits() -> None:
    names = {tunable_name(path) for path in TUNABLE}
    assert len(names) == len(TUNABLE)
    assert all(0 < len(name) <= NAME_BYTES for name in names)
    assert not names & {"CRUISE_SPEED", "SYSID_THISMAV", "FENCE_ENABLE"}
    assert tunable_name("advisor.policy.center_block_risk") == "POL_CEN_BLO_RIS"


def test_the_list_is_sorted_and_says_what_is_in_force() -> None:
    found = parameters_of(in_order(), 0.6, CONFIG)
    assert [each.name for each in found] == sorted(each.name for each in found)
    assert by_name(in_order())["POL_CEN_BLO_RIS"].value == CONFIG.policy.center_block_risk
    change = m.Change(path="advisor.policy.center_block_risk", value="0.40")
    promoted = m.Shadow(source_us=NOW_US, active="a1", active_changes=(change,))
    assert by_name(in_order(shadow=promoted))["POL_CEN_BLO_RIS"].value == 0.4
    whole = m.Shadow(source_us=NOW_US, active="a1", active_changes=(m.Change(path=change.path, value="1"),))
    assert by_name(in_order(shadow=whole))["POL_CEN_BLO_RIS"][1:] == (1.0, common.MAV_PARAM_TYPE_REAL32)
    assert by_name(in_order())["CRUISE_SPEED"] == ("CRUISE_SPEED", 0.6, common.MAV_PARAM_TYPE_REAL32)
    assert by_name(in_order())["SYSID_THISMAV"].value == 1


def test_the_fence_is_enabled_where_there_is_one() -> None:
    corners = tuple(m.Waypoint(x_m=x, y_m=y) for x, y in ((0, 0), (9, 0), (9, 9)))
    fence = (m.FenceArea(keep=m.Keep.IN, corners=corners),)
    fenced = in_order(mission=m.Mission(source_us=0, name="a", legs=(), fence=fence))
    assert by_name(fenced)["FENCE_ENABLE"].value == 1
    assert by_name(in_order())["FENCE_ENABLE"].value == 0


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", (1.0, common.MAV_PARAM_TYPE_INT32)),
        ("false", (0.0, common.MAV_PARAM_TYPE_INT32)),
        ("5", (5.0, common.MAV_PARAM_TYPE_INT32)),
        ("5.0", (5.0, common.MAV_PARAM_TYPE_REAL32)),
        ("99999999999", (99999999999.0, common.MAV_PARAM_TYPE_REAL32)),  # no float32 holds each integer up to it
        ("null", None),
        ("nan", None),
        ("inf", None),
        ('"word"', None),
    ],
)
def test_a_setting_as_a_number(text: str, value: tuple[float, int] | None) -> None:
    assert number_of(text) == value


def test_the_name_of_a_setting_leads_back_to_it() -> None:
    assert all(path_of(tunable_name(path)) == path for path in TUNABLE)
    assert path_of("CRUISE_SPEED") is None


@pytest.mark.parametrize(
    ("value", "path", "text"),
    [
        (0.46000000834465027, "advisor.policy.center_block_risk", "0.46"),  # the float32 nearest to 0.46
        (1.0, "advisor.policy.center_block_risk", "1.0"),
        (0.3333333432674408, "advisor.policy.center_block_risk", "0.33333334"),
        (9.999999974752427e-07, "advisor.policy.center_block_risk", "1e-06"),
        (math.nan, "advisor.policy.center_block_risk", None),
        (-math.inf, "advisor.policy.center_block_risk", None),
        (6.0, "advisor.motion.min_samples", "6"),
        (6.5, "advisor.motion.min_samples", None),
        (1e20, "advisor.motion.min_samples", None),
        (1.0, "advisor.motion.compensate_rotation", "true"),
        (0.0, "advisor.motion.compensate_rotation", "false"),
        (0.5, "advisor.motion.compensate_rotation", None),
    ],
)
def test_a_written_value_is_text_of_the_kind_that_its_setting_has(value: float, path: str, text: str | None) -> None:
    assert written_text(value, path, CONFIG) == text


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_written_number_is_the_same_number_to_the_station(value: float) -> None:
    text = written_text(value, "advisor.policy.center_block_risk", CONFIG)
    assert text is not None
    assert struct.pack("<f", float(text)) == struct.pack("<f", value)
    msgspec.convert({"path": "a", "value": text}, m.Change)
