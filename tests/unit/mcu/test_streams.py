"""The core under streams that nobody would send on purpose: random, damaged, cut, across the wrap of its clock."""

from __future__ import annotations

import random

import pytest

from paani.messages import Direction, McuState, McuVerdict
from paani.microcontroller.payloads import EscSettings, Guide, McuStatus
from paani.microcontroller.rpc import Request, Response, encode_request, encode_response
from tests.firmware.streams import corrupted
from tests.unit.mcu.core import (
    CLOCK,
    INDICATION_LINE,
    THRUST_LINE,
    Core,
    Script,
    guide,
    notification,
    request,
    statuses,
    thrust,
)

RUNS, FRAMES = 100, 300


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_30_000_random_frames_across_the_wrap_and_no_motion_past_its_lease(part: int) -> None:
    """A model of the rule, beside the core: an advice that moves, and live thrust, are younger than their lease."""
    moving = {Direction.STRAIGHT, Direction.LEFT, Direction.RIGHT, Direction.SLIGHT_LEFT, Direction.SLIGHT_RIGHT}
    advised = driven = 0
    for run in range(part, RUNS, 4):
        rng = random.Random(run)
        core = Core(CLOCK - rng.randrange(1, 60_000))
        core.set_pins()
        core.call(EscSettings(session=9, slew_per_s=10.0))
        core.call(thrust(0, armed=False))
        ends = {INDICATION_LINE: 0, THRUST_LINE: 0}  # of the newest accepted lease, in milliseconds since the start
        age_ms = 0
        for seq in range(1, FRAMES + 1):
            line = rng.randrange(2)
            lease_ms = rng.randint(50, 300 if line else 4000)
            sent_age_ms = rng.randrange(lease_ms + 20)
            late = seq - rng.choice((0, 0, 0, 1, 50))
            if line:
                armed = rng.random() > 0.2
                status = core.call(thrust(max(late, 0), armed=armed, lease_ms=lease_ms, age_ms=sent_age_ms))
            else:
                frame = guide(max(late, 0), rng.choice(list(Direction)), lease_ms=lease_ms, age_ms=sent_age_ms)
                status = core.call(frame)
            if status.verdict == "accepted":
                ends[line] = age_ms + lease_ms - sent_age_ms
            for _ in range(rng.choice((1, 1, 3))):
                step_ms = rng.choice((1, 7, 60, 400, 1500)) if rng.random() < 0.3 else rng.randrange(1, 40)
                core.wait(step_ms)
                age_ms += step_ms
                is_moving = core.status().display in moving
                is_driven = core.status(THRUST_LINE).enabled
                assert not is_moving or age_ms < ends[INDICATION_LINE]
                assert not is_driven or age_ms < ends[THRUST_LINE]
                if not is_driven:
                    assert core.status(THRUST_LINE).pulse_left_us == 1500
                advised += is_moving
                driven += is_driven
        core.close()
    assert advised > 1000
    assert driven > 500


@pytest.mark.slow
def test_20_000_damaged_frames_and_none_acted_on(core: Core) -> None:
    """Between good frames, which all arrive. What a damaged one would show differs from what every good one does."""
    rng = random.Random(1)
    for seq in range(1, 20_001):
        core.receive(0, corrupted(request(guide(seq, Direction.RIGHT, lease_ms=4000)), rng))
        if seq % 4 == 0:
            core.receive(0, request(guide(seq, Direction.STRAIGHT, lease_ms=4000)))
        status = core.status()
        assert status.display in {Direction.STRAIGHT, Direction.NO_DATA}, seq
        assert status.accepted == seq // 4
        if seq % 100 == 0:
            core.wait(1)
    assert core.status().refusals.crc > 8000
    assert core.status().refusals.framing > 1500


@pytest.mark.slow
def test_random_bytes_are_no_frames(core: Core) -> None:
    core.receive(0, random.Random(2).randbytes(1 << 20))
    core.receive(1, random.Random(3).randbytes(1 << 20))
    assert core.status().accepted == core.status(THRUST_LINE).accepted == 0


def test_a_call_cut_into_single_bytes_is_one_call(core: Core) -> None:
    for byte in request(guide(), call_id=0xFFFF_FFFF):
        core.receive(0, bytes([byte]))
    assert core.status().state is McuState.FRESH


@pytest.mark.parametrize("call_id", [0, 127, 128, 255, 256, 0xFFFF, 0x10000, 0xFFFF_FFFF])
def test_the_answer_has_the_identifier_of_the_request(core: Core, call_id: int) -> None:
    core.take(0)
    core.receive(0, request(guide(), call_id))
    answer = core.take(0)[0]
    assert getattr(answer, "id", None) == call_id
    assert statuses([answer])[0].seq == 1


def test_a_notification_is_judged_and_not_answered(core: Core) -> None:
    core.take(0)
    core.receive(0, notification(guide()))
    assert core.status().accepted == 1
    assert core.take(0) == []


def test_a_head_inside_a_payload_ends_the_call_before_it(core: Core) -> None:
    frame = request(guide())
    core.receive(0, frame[:-16] + frame)
    status = core.status()
    assert (status.accepted, status.refusals.framing, status.refusals.crc) == (1, 1, 0)


def test_a_call_that_was_cut_off_is_answered_under_its_own_identifier(core: Core) -> None:
    core.take(0)
    core.receive(0, request(guide(), 300)[:-16] + request(guide(), 7))
    answers = [message for message in core.take(0) if isinstance(message, Response)]
    assert [(answer.id, statuses([answer])[0].verdict) for answer in answers] == [
        (300, McuVerdict.FRAMING),
        (7, McuVerdict.ACCEPTED),
    ]


def test_silence_ends_a_call_that_was_cut_off(core: Core) -> None:
    core.receive(0, request(guide())[:-1])
    core.wait(99)
    assert core.status().refusals.framing == 0
    core.wait(1)
    assert core.status().refusals.framing == 1
    core.receive(0, request(guide()))
    assert core.status().accepted == 1


def test_a_peer_that_reads_nothing_stops_nothing(core: Core) -> None:
    for seq in range(1, 100):
        core.receive(0, request(guide(seq)))
    core.wait(10)
    assert core.status().accepted == 99
    answers = core.take(0)
    assert 5 <= len(answers) <= 10
    core.receive(0, request(guide(100)))
    assert len(statuses(core.take(0))) == 1
    assert core.junk_bytes(0) == 0  # what found no room went out whole or not at all


def test_it_registers_as_a_client_of_the_boards_router_has_to(core: Core) -> None:
    def requests() -> list[tuple[int, str, tuple[object, ...]]]:
        return [(m.id, m.method, m.params) for m in core.take(THRUST_LINE) if isinstance(m, Request)]

    assert requests() == [(1, "$/reset", ())]
    core.wait(1000)
    assert requests() == [(1, "$/reset", ())]
    core.receive(THRUST_LINE, encode_response(1, True))
    names = {call_id: params for call_id, method, params in requests() if method == "$/register"}
    assert set(names.values()) == {("paani_thrust",), ("paani_esc",), ("paani_status",)}
    for call_id, params in names.items():
        if params == ("paani_esc",):
            core.receive(THRUST_LINE, b"\x94\x01" + bytes([call_id]) + b"\x92\x05\xa6exists\xc0")
        elif params == ("paani_thrust",):
            core.receive(THRUST_LINE, b"\x94\x01" + bytes([call_id]) + b"\x92\x04\xa6failed\xc0")
        else:
            core.receive(THRUST_LINE, encode_response(call_id, True))
    core.wait(1000)
    assert [params for _, _, params in requests()] == [("paani_thrust",)]
    core.receive(THRUST_LINE, encode_response(next(i for i, p in names.items() if p == ("paani_thrust",)), None))
    core.wait(7000)
    assert requests() == []
    core.wait(1100)
    assert requests() == [(1, "$/reset", ())]


def test_refused_frames_confirm_no_route(core: Core) -> None:
    """Whoever sends them may be somebody else's."""
    for call_id in (1, 2, 3, 4, 5):
        core.wait(1)
        core.receive(THRUST_LINE, encode_response(call_id, True))
    core.take(THRUST_LINE)
    for seq in range(10):
        core.receive(THRUST_LINE, notification(thrust(seq + 1)))
        core.wait(1000)
    assert core.status(THRUST_LINE).refusals.not_ready == 10
    assert [m.method for m in core.take(THRUST_LINE) if isinstance(m, Request)] == ["$/reset"]


class RecordedSession:
    """A core, and all bytes that it sends."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.lines = [b"", b""]

    def receive(self, line: int, data: bytes) -> None:
        self._core.receive(line, data)
        self._keep()

    def wait(self, duration_ms: int) -> None:
        self._core.wait(duration_ms)
        self._keep()

    def _keep(self) -> None:
        for line in range(2):
            self.lines[line] += self._core.take_bytes(line)


def scenario(script: Script | RecordedSession) -> None:
    """A stream with everything in it: good, damaged and random bytes, silence, the wrap of the clock."""
    rng = random.Random(4)
    script.receive(1, encode_request(1, "paani_esc", EscSettings(session=9).encode()))
    script.receive(1, request(thrust(0, armed=False)))
    for seq in range(1, 800):
        script.receive(0, request(guide(seq, rng.choice(list(Direction)), risks=(seq % 101, 255, 0)), seq))
        script.receive(0, corrupted(request(guide(seq)), rng))
        script.receive(1, request(thrust(seq, rng.uniform(-1, 1), rng.uniform(-1, 1)), seq))
        script.receive(rng.randrange(2), rng.randbytes(rng.randrange(40)))
        script.wait(rng.randrange(1, 700 if rng.random() < 0.1 else 60))


@pytest.mark.slow
def test_addresses_are_watched_and_both_builds_say_the_same() -> None:
    """The program under AddressSanitizer plays what the library lives through, and sends the same bytes."""
    script = Script()
    scenario(script)
    played = script.play()
    assert played.returncode == 0, played.stderr.decode()[-2000:]

    core = Core(steps_at_once=False)
    core.set_pins(battery_mv=0)
    sent = RecordedSession(core)
    scenario(sent)
    lights = bytes(int(light) for row in core.lights() for light in row)
    assert played.stdout == sent.lines[0] + sent.lines[1] + lights
    assert len(played.stdout) > 100_000
    core.close()


@pytest.mark.slow
def test_the_watch_over_addresses_is_awake() -> None:
    script = Script()
    script.read_behind_memory()
    played = script.play()
    assert played.returncode != 0
    assert b"AddressSanitizer: heap-buffer-overflow" in played.stderr


def test_every_payload_has_its_own_size() -> None:
    assert [len(p.encode()) for p in (guide(), thrust(1), EscSettings(session=1))] == [20, 18, 26]
    assert McuStatus.decode(McuStatus(kind=1, state=McuState.BOOT).encode()) is not None
    assert Guide.decode(guide().encode()) == guide()
