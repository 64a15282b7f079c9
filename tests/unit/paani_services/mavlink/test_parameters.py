"""Parameters: names that fit, values that are in force, types that clients of ArduPilot read."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE
from paani_services.mavlink.parameters import NAME_BYTES, Parameter, number_of, parameters_of, tunable_name
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
