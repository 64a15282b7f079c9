"""Settings of the bridge to the microcontroller."""

from __future__ import annotations

import pytest

from paani import keys
from paani.config import load_config
from paani.decider import decider_of
from paani.errors import UserError

LINE = "bridge.line=serial:/dev/ttyACM0@115200"


@pytest.mark.parametrize("profile", ["paani", "paper", "hil"])
def test_a_bridge_runs_where_there_is_a_line(profile: str) -> None:
    assert "bridge" not in load_config(profile=profile).services
    assert "bridge" in load_config(profile=profile, sets=(LINE,)).services


@pytest.mark.parametrize(
    "setting", ["bridge.line=ttyACM0", "bridge.rate_hz=4.9", "bridge.rate_hz=10.1", "bridge.lease_ms=4001"]
)
def test_what_cannot_be_is_refused_with_its_field(setting: str) -> None:
    with pytest.raises(UserError, match=r"^--set bridge[^\n]*: bridge[^\n]*$"):
        load_config(sets=(setting,))


def test_the_loop_waits_for_no_bridge() -> None:
    """O5: the lights are no interlock. No thrust asks for the bridge's pulse, and no process reads what it writes."""
    assert "bridge" not in keys.VITAL_SERVICES
    for profile in ("paani", "paper"):
        config = load_config(profile=profile, sets=(LINE,))
        assert "bridge" not in {*config.plant.adapter.require_pulses, *config.adapter.require_pulses}
    for service in keys.DECIDING_SERVICES:
        assert keys.BRIDGE_STATE not in decider_of(service).inputs
