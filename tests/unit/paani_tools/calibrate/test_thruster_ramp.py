"""The dead-man key, the ramp, and what follows from where a thruster began to turn."""

from __future__ import annotations

import tomllib

import pytest

from paani.config import EscConfig, load_config
from paani.errors import UserError
from paani_tools.calibrate.thrusters.ramp import DeadMan, Ramp, fit_esc, settings_toml


def test_a_key_is_held_while_it_repeats() -> None:
    key = DeadMan()
    assert not key.is_held(0.0)
    key.press(0.0)
    assert not key.is_held(0.0), "a single press drives nothing"
    for tenths in range(5, 15):
        key.press(tenths / 10)
        assert key.is_held(tenths / 10)
        assert key.is_held(tenths / 10 + 0.2)
    assert not key.is_held(1.4 + 0.26)
    key.press(3.0)
    assert not key.is_held(3.0), "after a release it is a first press again"


def test_single_presses_one_after_the_other_drive_nothing() -> None:
    key = DeadMan()
    for second in range(5):
        key.press(float(second))
        assert not key.is_held(float(second))


def test_the_ramp_is_slow_and_ends() -> None:
    ramp = Ramp(400)
    ramp.advance(1.0)
    assert ramp.offset_us == 20.0
    for _ in range(100):
        ramp.advance(1.0)
    assert ramp.offset_us == 250.0
    small = Ramp(100)
    small.advance(60.0)
    assert small.offset_us == 100.0
    ramp.restart()
    ramp.release()
    assert ramp.offset_us == 0.0


def test_a_release_goes_back_to_where_the_key_was_last_sent() -> None:
    ramp = Ramp(400)
    ramp.advance(1.0)
    ramp.mark()
    ramp.advance(0.25)
    ramp.release()
    assert ramp.offset_us == 20.0


def test_rest_lies_in_the_middle_of_what_does_not_turn() -> None:
    assert fit_esc("left", 40.0, 20.0, is_reversed=False) == EscConfig(trim_us=10, deadband_us=30)
    assert fit_esc("left", 20.0, 40.0, is_reversed=True) == EscConfig(reversed=True, trim_us=-10, deadband_us=30)


@pytest.mark.parametrize(("longer_us", "shorter_us"), [(120.0, 100.0), (250.0, 10.0)])
def test_what_no_setting_holds_is_refused(longer_us: float, shorter_us: float) -> None:
    with pytest.raises(UserError, match=r"right: began to turn .* a deadband of 1\d\d us, more than 100"):
        fit_esc("right", longer_us, shorter_us, is_reversed=False)


def test_what_is_written_is_what_is_read(tmp_path: object) -> None:
    left, right = EscConfig(reversed=True, trim_us=-12, deadband_us=33), EscConfig(trim_us=5, deadband_us=21)
    text = settings_toml("serial:/dev/ttyACM1@115200", 1500, 400, left, right)
    tree = tomllib.loads(text)["thrusters"]
    sets = [f"thrusters.{name}={tree[name]!r}".replace("'", '"') for name in ("line", "neutral_us", "span_us")]
    for side in ("left", "right"):
        sets += [f"thrusters.{side}.{name}={str(value).lower()}" for name, value in tree[side].items()]
    thrusters = load_config(profile="hull", sets=sets).thrusters
    assert (thrusters.left, thrusters.right, thrusters.line) == (left, right, "serial:/dev/ttyACM1@115200")
