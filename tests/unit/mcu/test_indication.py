"""What the lights show, and what they refuse to show."""

from __future__ import annotations

import pytest

from paani.messages import Direction, McuState, McuVerdict
from paani.microcontroller.payloads import Guide, append_crc
from tests.unit.mcu.core import CLOCK, INDICATION_LINE, Core, guide, request, statuses


def patched(payload: bytes, at: int, value: int) -> bytes:
    """The payload with one byte changed, and a CRC that fits."""
    return append_crc(payload[:at] + bytes([value]) + payload[at + 1 : -2])


def test_advice_is_shown_while_its_lease_runs_and_then_stop(core: Core) -> None:
    assert core.call(guide(age_ms=100)).verdict is McuVerdict.ACCEPTED
    core.wait(399)
    assert core.status().display is Direction.LEFT
    assert core.status().lease_left_ms == 1
    core.wait(1)
    assert core.status().state is McuState.STALE
    assert core.status().display is Direction.STOP
    core.wait(999)
    assert core.status().state is McuState.STALE
    core.wait(1)
    assert core.status().state is McuState.SAFE
    core.wait(100_000)
    assert core.status().display is Direction.STOP
    assert core.call(guide(2)).state is McuState.FRESH


def test_the_lights_are_armed_from_power_up(core: Core) -> None:
    assert core.status().state is McuState.BOOT
    core.wait(999)
    assert core.status().state is McuState.BOOT
    core.wait(1)
    assert core.status().state is McuState.STALE
    assert core.status().display is Direction.STOP


def test_o4_the_papers_time_out_runs_only_after_a_stream_was_established() -> None:
    """The rule, on the core that the board runs; that the board's own clock keeps it needs the board."""
    core = Core(paper=True)
    core.wait(60_000)
    assert core.status().state is McuState.BOOT
    core.call(guide(lease_ms=50))
    core.wait(999)
    assert core.status().state is McuState.FRESH
    core.wait(1)
    assert core.status().state is McuState.STALE
    core.close()


@pytest.mark.parametrize(
    ("payload", "verdict", "counter"),
    [
        (guide(5).encode()[:-1] + b"\0", McuVerdict.CRC, "crc"),
        (patched(guide(5).encode(), 0, 2), McuVerdict.VERSION, "version"),
        (patched(guide(5).encode(), 1, 7), McuVerdict.RANGE, "range"),
        (patched(guide(5).encode(), 12, 101), McuVerdict.RANGE, "range"),
        (patched(guide(5).encode(), 14, 254), McuVerdict.RANGE, "range"),
        (patched(guide(5).encode(), 15, 1), McuVerdict.RANGE, "range"),
        (append_crc(patched(patched(guide(5).encode(), 2, 0), 3, 0)[:-2]), McuVerdict.RANGE, "range"),
        (guide(3).encode(), McuVerdict.REPLAYED, "replayed"),
        (guide(2).encode(), McuVerdict.REPLAYED, "replayed"),
        (guide(5, session=8).encode(), McuVerdict.FOREIGN_SESSION, "foreign_session"),
        (guide(5, age_ms=500).encode(), McuVerdict.EXPIRED, "expired"),
        (patched(patched(guide(5).encode(), 8, 49), 9, 0), McuVerdict.LEASE, "lease"),
        (patched(patched(guide(5).encode(), 8, 0xA1), 9, 0x0F), McuVerdict.LEASE, "lease"),
        (guide(5).encode() + b"\0", McuVerdict.FRAMING, "framing"),
        (guide(5).encode()[:-1], McuVerdict.FRAMING, "framing"),
    ],
)
def test_every_refusal_has_its_counter(core: Core, payload: bytes, verdict: McuVerdict, counter: str) -> None:
    core.call(guide(3, Direction.RIGHT))
    core.wait(10)
    status = core.call(payload, Guide)
    assert status.verdict is verdict
    assert [name for name in status.refusals.__struct_fields__ if getattr(status.refusals, name)] == [counter]
    assert (status.accepted, status.seq, status.lease_left_ms) == (1, 3, 490)
    assert status.display is Direction.RIGHT


@pytest.mark.slow
def test_a_refusal_counter_stays_at_its_highest(core: Core) -> None:
    for _ in range(65_600):
        core.receive(INDICATION_LINE, b"\x93\x02\xabpaani_guide\x00")
    assert core.status().refusals.framing == 65_535


def test_another_session_is_accepted_once_the_lease_is_over(core: Core) -> None:
    core.call(guide(1000))
    core.wait(500)
    assert core.call(guide(1, session=8)).verdict is McuVerdict.ACCEPTED
    assert core.status().session == 8


def test_a_late_frame_of_an_earlier_session_is_a_replay(core: Core) -> None:
    core.call(guide(1000))
    for session in (8, 9, 10):
        core.wait(500)
        core.call(guide(1, session=session))
    core.wait(500)
    assert core.call(guide(999)).verdict is McuVerdict.REPLAYED
    assert core.call(guide(1001)).verdict is McuVerdict.ACCEPTED


def test_the_sequence_goes_on_across_its_wrap(core: Core) -> None:
    assert core.call(guide(0xFFFF_FFFF)).verdict is McuVerdict.ACCEPTED
    assert core.call(guide(0)).verdict is McuVerdict.ACCEPTED
    assert core.call(guide(0xFFFF_FFFF)).verdict is McuVerdict.REPLAYED


def test_a_lease_runs_out_across_the_wrap_of_the_clock() -> None:
    core = Core(CLOCK - 700)
    core.call(guide(lease_ms=1000))
    core.wait(999)
    assert core.status().state is McuState.FRESH
    core.wait(1)
    assert (core.status().state, core.status().mcu_ms) == (McuState.STALE, 300)
    core.close()


def test_a_change_of_state_is_told_at_once(core: Core) -> None:
    core.take(INDICATION_LINE)
    core.receive(INDICATION_LINE, request(guide()))
    core.wait(600)
    reports = statuses(core.take(INDICATION_LINE))
    assert [status.state for status in reports] == [McuState.FRESH, McuState.FRESH, McuState.STALE]
    assert [status.verdict for status in reports] == [McuVerdict.ACCEPTED, McuVerdict.NONE, McuVerdict.NONE]
    assert reports[2].mcu_ms == 500


ARROWS = {
    Direction.STRAIGHT: "0007000",
    Direction.SLIGHT_LEFT: "7777000",
    Direction.SLIGHT_RIGHT: "0007777",
    Direction.LEFT: "0070000",
    Direction.RIGHT: "0000700",
    Direction.STOP: "7000007",
    Direction.NO_DATA: "0077700",
}


@pytest.mark.parametrize("direction", ARROWS)
def test_o3_each_direction_has_its_arrow_and_each_lane_its_bar(core: Core, direction: Direction) -> None:
    """O3 as far as a picture in memory proves it; that the lights of the board show it needs the board."""
    core.call(guide(1, direction, risks=(100, 1, 255)))
    core.wait(1)
    lights = core.lights()
    assert lights[0][:7] == ARROWS[direction]
    assert [row[8] for row in lights] == ["7"] * 8
    assert [row[10] for row in lights] == ["0"] * 7 + ["7"]
    assert [row[12] for row in lights] == ["2", "0"] * 4
    assert all(row[7] + row[9] + row[11] == "000" for row in lights)


def test_right_is_left_mirrored_and_no_two_arrows_are_alike(core: Core) -> None:
    pictures = {}
    for seq, direction in enumerate(ARROWS, start=1):
        core.call(guide(seq, direction))
        core.wait(1)
        pictures[direction] = [row[:7] for row in core.lights()]
    assert len({tuple(picture) for picture in pictures.values()}) == len(ARROWS)
    assert pictures[Direction.RIGHT] == [row[::-1] for row in pictures[Direction.LEFT]]
    assert pictures[Direction.SLIGHT_RIGHT] == [row[::-1] for row in pictures[Direction.SLIGHT_LEFT]]


def test_what_is_lost_shows_a_cross_that_blinks_once_it_is_safe(core: Core) -> None:
    core.call(guide())
    core.wait(500)
    assert core.lights()[0] == "7000007020202"[:7] + "020202"
    core.wait(1000)
    blinking = set()
    for _ in range(10):
        core.wait(100)
        blinking.add(core.lights()[0][:7])
    assert blinking == {"7000007", "0000000"}


def test_before_any_advice_only_the_corners_are_lit(core: Core) -> None:
    lights = core.lights()
    assert (lights[0][:7], lights[3][:7], lights[7][:7]) == ("7000007", "0000000", "7000007")
