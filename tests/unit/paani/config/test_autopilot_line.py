"""Where an autopilot is, in the settings: a line of its own that nobody else can write to."""

from __future__ import annotations

import pytest

from paani.config import load_config
from paani.errors import UserError


@pytest.mark.parametrize("line", ["serial:/dev/ttyACM0@57600", "socket://127.0.0.1:5760", "socket://localhost:5760"])
def test_a_line_to_an_autopilot_is_taken_on_a_hull(line: str) -> None:
    config = load_config(profile="hull", sets=(f"thrusters.autopilot.line={line}",))
    assert config.thrusters.is_connected
    assert not load_config(profile="hull").thrusters.is_connected


@pytest.mark.parametrize("profile", ["paani", "hil"])
def test_it_drives_a_real_boat_alone(profile: str) -> None:
    with pytest.raises(UserError, match=r"thrusters\.autopilot\.line .*--profile hull"):
        load_config(profile=profile, sets=("thrusters.autopilot.line=serial:/dev/ttyACM0",))


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (("line=socket://192.168.1.9:5760",), "its frames are not signed"),
        (("line=udp:127.0.0.1:14550",), "is no port"),
        (("line=/dev/ttyACM0",), "is no port"),
        (("system=7", "own_system=7"), "autopilot's own number"),
        (("own_system=0",), "own_system"),
        (("sistem=1",), "sistem"),
    ],
)
def test_what_cannot_be_is_refused_with_its_field(settings: tuple[str, ...], text: str) -> None:
    with pytest.raises(UserError, match=r"thrusters.*autopilot") as refusal:
        load_config(profile="hull", sets=tuple(f"thrusters.autopilot.{setting}" for setting in settings))
    assert text in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_thrust_goes_one_way() -> None:
    lines = ("thrusters.line=serial:/dev/ttyACM1", "thrusters.autopilot.line=serial:/dev/ttyACM0")
    with pytest.raises(UserError, match=r"a microcontroller or an autopilot"):
        load_config(profile="hull", sets=lines)
