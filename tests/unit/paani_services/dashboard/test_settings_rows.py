"""The settings as the page shows them: where each value comes from."""

from __future__ import annotations

import pytest

from paani.config import PROFILES, load_config
from paani_services.dashboard.settings_rows import SettingRow, setting_rows


def rows_of(profile: str, sets: tuple[str, ...] = (), environ: dict[str, str] | None = None) -> dict[str, SettingRow]:
    config = load_config(profile=profile, sets=sets, environ=environ)
    return {row.path: row for row in setting_rows(config, environ or {})}


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.slow
def test_a_profile_alone_gives_no_value_of_another_origin(profile: str) -> None:
    assert {row.origin for row in rows_of(profile).values()} <= {"default", "profile"}


def test_every_value_says_where_it_comes_from() -> None:
    rows = rows_of("paper", ("navigator.cruise_mps=0.2",), {"PAANI_ADVISOR__POLICY__CENTER_BLOCK_RISK": "0.46"})
    given = rows["navigator.cruise_mps"]
    assert (given.value, given.default, given.origin, given.unit) == ("0.2", "0.15", "file or --set", "m/s")
    by_environment = rows["advisor.policy.center_block_risk"]
    assert (by_environment.value, by_environment.origin, by_environment.tunable) == ("0.46", "environment", True)
    assert (by_environment.limits, rows["dashboard.port"].limits) == ("0 to 1", "1 to 65535")
    assert rows["bus.vessel"].limits == "^[a-z0-9_]{1,32}$"
    assert rows["advisor.policy.dry"].origin == "profile"
    untouched = rows["dashboard.port"]
    assert (untouched.value, untouched.default, untouched.origin, untouched.tunable) == (
        "8043",
        "8043",
        "default",
        False,
    )
