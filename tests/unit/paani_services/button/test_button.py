"""When a hardware button asks for STOP: a press however short, and whatever is not known to be up."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from paani import messages as m
from paani.config import load_config
from paani.errors import UserError
from paani_services.button.device import open_button
from paani_services.button.events import EV_KEY, EV_SYN, EVENT, SYN_DROPPED, has_press, is_any_held
from paani_services.button.request import Asking, answered, has_to_ask, look

FREE = m.OperatorState(source_us=1, armed=True, stopped=False)
STOPPED = replace(FREE, armed=False, stopped=True)
HELD = replace(STOPPED, hold_by="dashboard", held_ms=300.0)


def event(kind: int, code: int, value: int) -> bytes:
    return EVENT.pack(1, 2, kind, code, value)


@pytest.mark.parametrize(
    ("data", "is_press"),
    [
        (b"", False),
        (event(EV_KEY, 0x100, 1), True),
        (event(EV_KEY, 0x100, 2), True),
        (event(EV_KEY, 0x100, 0), False),
        (event(EV_SYN, 0, 0) + event(EV_KEY, 28, 1), True),
        (event(4, 4, 7) + event(EV_SYN, 0, 0), False),
        (event(EV_SYN, SYN_DROPPED, 0), True),
        (event(EV_SYN, 0, 0)[:-1], True),
    ],
)
def test_a_key_that_goes_down_or_may_have_is_a_press(data: bytes, is_press: bool) -> None:
    assert has_press(data) is is_press


def test_any_bit_of_the_held_keys_counts() -> None:
    assert not is_any_held(bytes(96))
    assert is_any_held(bytes(95) + b"\x80")


def test_a_press_waits_until_it_is_latched_however_soon_it_is_let_go() -> None:
    asking = look(look(Asking(), "pressed"), "")
    assert has_to_ask(asking, FREE)
    assert has_to_ask(asking, None)
    assert not has_to_ask(answered(asking), FREE)


def test_a_button_that_is_down_asks_again_only_where_something_could_move() -> None:
    down = answered(look(Asking(), "pressed"))
    assert has_to_ask(down, FREE)
    assert has_to_ask(down, HELD), "nobody arms past a button that is down"
    assert has_to_ask(down, None)
    assert not has_to_ask(look(down, "pressed"), STOPPED), "the log is not flooded"
    assert not has_to_ask(look(down, ""), FREE), "letting go stops nothing more"
    assert has_to_ask(look(look(down, ""), "pressed"), STOPPED), "another press is another STOP"


def test_a_level_says_whether_the_boat_may_move(tmp_path: Path) -> None:
    path = tmp_path / "value"
    button = open_button(f"level:{path}")
    assert "No such file" in button.look()
    for text, why in (
        ("1\n", ""),
        ("1", ""),
        ("0\n", "pressed"),
        ("", "neither"),
        ("11\n", "neither"),
        ("\xff", "neither"),
    ):
        path.write_text(text, encoding="latin-1")
        found = button.look()
        assert why in found, text
        assert bool(found) is bool(why), text
    path.unlink()
    path.mkdir()
    assert "directory" in button.look()
    path.rmdir()
    os.mkfifo(path)
    assert "neither" in button.look(), "a pipe that nobody writes blocks nothing"


def test_what_is_no_input_device_is_never_up(tmp_path: Path) -> None:
    path = tmp_path / "event0"
    button = open_button(f"input:{path}")
    assert "No such file" in button.look()
    path.write_bytes(b"")
    assert "Inappropriate ioctl" in button.look()
    path.write_bytes(event(EV_KEY, 1, 0))
    assert "Inappropriate ioctl" in button.look()
    path.unlink()
    with socket.socket(socket.AF_UNIX) as there:
        there.bind(str(path))
        assert "No such device" in button.look()
    button.close()
    button.close()


@given(st.binary(max_size=200))
def test_no_bytes_break_it(data: bytes) -> None:
    assert has_press(data) in {True, False}


def test_the_line_is_of_a_known_kind_and_absolute() -> None:
    for line in ("input:/dev/input/event3", "level:/sys/class/gpio/gpio17/value"):
        config = load_config(sets=(f"button.line={line}",))
        assert "button" in config.services
        assert config.adapter.require_pulses == (*load_config().adapter.require_pulses, "button")
    assert "button" not in load_config().services
    for line in ("/dev/input/event3", "input:event3", "serial:/dev/ttyS0", "level:"):
        with pytest.raises(UserError, match=r"button\.line"):
            load_config(sets=(f"button.line={line}",))
