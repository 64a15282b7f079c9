"""What comes from the other machine is never taken for younger than it is, whatever clocks and links do."""

from __future__ import annotations

import heapq
import itertools

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.bus.admission import Admission, since_sent
from paani.bus.other_machine import OtherMachine
from paani.clock import ManualClock

PULSE_US = 100_000
YEAR_US = 31_557_600 * 10**6
DRIVE_US = 20_000_000
WALL_US = 1_800_000_000_000_000


class Machine:
    """A machine by the true time `at_us`: its steady clock runs fast or slow, its wall clock is set at times.

    origin_us: above 0, as a message says by 0 that it has no such stamp.
    """

    def __init__(self, origin_us: int, rate: float, offset_us: int, sets: list[tuple[int, int]]) -> None:
        self._origin_us, self._rate, self._offset_us, self._sets = origin_us, rate, offset_us, sets

    def steady_us(self, at_us: int) -> int:
        return self._origin_us + round(at_us * (1.0 + self._rate))

    def wall_us(self, at_us: int) -> int:
        return WALL_US + at_us + self._offset_us + sum(by_us for set_us, by_us in self._sets if set_us <= at_us)


def machines() -> st.SearchStrategy[Machine]:
    sets = st.lists(st.tuples(st.integers(0, DRIVE_US), st.integers(-(10**10), 10**10)), max_size=3)
    return st.builds(
        Machine, st.integers(1, YEAR_US), st.floats(-7e-4, 7e-4), st.integers(-(10**10), 10**10), sets
    )  # fmt: skip


DELAYS_US = st.one_of(st.integers(0, 2_000), st.integers(0, 300_000), st.integers(0, 5_000_000))


class Listening:
    """A process of one machine that hears the other's pulses, its steady clock in hand."""

    def __init__(self, here: Machine) -> None:
        self.here, self.clock = here, ManualClock(0)
        self.other = OtherMachine(self.clock)

    def at(self, at_us: int) -> OtherMachine:
        self.clock.advance((self.here.steady_us(at_us) - self.clock.now_us()) * 1e-6)
        return self.other


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    here=machines(),
    there=machines(),
    data=st.data(),
    spoken=st.lists(st.tuples(st.integers(0, DRIVE_US), st.integers(0, 2_000_000)), min_size=1, max_size=8),
)
def test_nothing_is_taken_for_younger_than_it_is(
    here: Machine, there: Machine, data: st.DataObject, spoken: list[tuple[int, int]]
) -> None:
    """Offsets, drift, delays that differ and change, clocks that are set. spoken: evidence, when and how old."""
    mine, theirs = Listening(here), Listening(there)

    def delays() -> int:
        drawn: int = data.draw(DELAYS_US)
        return drawn

    order = itertools.count()
    events: list[tuple[int, int, str, object]] = []
    for k in range(0, DRIVE_US, 10 * PULSE_US):
        heapq.heappush(events, (k, next(order), "my pulse", None))
        heapq.heappush(events, (k + PULSE_US // 2, next(order), "their pulse", None))
    for said_us, age_us in spoken:
        evidence = m.Tracks(
            source_us=there.wall_us(said_us) - age_us,
            frame_seq=0,
            frame_epoch=0,
            epoch=there.wall_us(said_us) // 1000,
            producer="advisor",
            topic=keys.TRACKS.name,
            sent_us=there.wall_us(said_us),
            steady_us=there.steady_us(said_us),
        )
        heapq.heappush(events, (said_us + delays(), next(order), "evidence", (evidence, said_us, age_us)))
    while events:
        at_us, _, what, payload = heapq.heappop(events)
        match what, payload:
            case "my pulse", None:
                pulse = m.Pulse(source_us=0, steady_us=here.steady_us(at_us))
                heapq.heappush(events, (at_us + delays(), next(order), "heard there", pulse))
            case "heard there", m.Pulse() as pulse:
                theirs.at(at_us).note_pulse(pulse)
            case "their pulse", None:
                echo_us, heard_us = theirs.other.echo
                pulse = m.Pulse(source_us=0, steady_us=there.steady_us(at_us), echo_us=echo_us, heard_us=heard_us)
                heapq.heappush(events, (at_us + delays(), next(order), "heard here", pulse))
            case "heard here", m.Pulse() as pulse:
                mine.at(at_us).note_pulse(pulse)
            case "evidence", (m.Tracks() as evidence, int() as said_us, int() as age_us):
                is_known = mine.at(at_us)._bound is not None
                now_us = here.wall_us(at_us)
                judged = Admission(keys.TRACKS, 43, 1.0, mine.other.shift_us).judge(
                    msgspec.json.encode(evidence), now_us
                )
                if is_known:
                    assert isinstance(judged[0], m.Tracks), judged
                    assert now_us - judged[0].source_us >= age_us + at_us - said_us - 1


def heard(*, lead_us: int, there_us: int, delay_us: int) -> tuple[OtherMachine, ManualClock]:
    """After a pulse each way, with the other clock so far ahead. The way back takes no time."""
    clock = ManualClock(there_us - lead_us)
    other = OtherMachine(clock)
    other.note_pulse(m.Pulse(source_us=0, steady_us=there_us, echo_us=clock.now_us() - delay_us, heard_us=there_us))
    return other, clock


@pytest.mark.parametrize("lead_us", [0, 5_000_000, -5_000_000, YEAR_US])
@pytest.mark.parametrize("wall_s", [-3600, -5, 0, 5, 3600])
def test_a_message_is_at_most_as_much_too_old_as_a_pulse_took(lead_us: int, wall_s: int) -> None:
    """Common time is not needed to be let in, nor to be fresh."""
    other, _ = heard(lead_us=lead_us, there_us=2 * YEAR_US, delay_us=20_000)
    sent_us = WALL_US + wall_s * 10**6
    thrust = m.Tracks(
        source_us=sent_us - 100_000, frame_seq=0, frame_epoch=0, epoch=sent_us // 1000, producer="advisor",
        sent_us=sent_us, steady_us=2 * YEAR_US, topic=keys.TRACKS.name,
    )  # fmt: skip
    message, cause = Admission(keys.TRACKS, 43, 1.0, other.shift_us).judge(msgspec.json.encode(thrust), WALL_US)
    assert cause == ""
    assert message is not None
    assert WALL_US - message.source_us == pytest.approx(120_000, abs=200)


@pytest.mark.parametrize("delays_us", [(1_000, 80_000), (80_000, 1_000)])
def test_the_fastest_echo_counts(delays_us: tuple[int, int]) -> None:
    """A pulse that was held up makes nothing older."""
    clock = ManualClock(10**9)
    other = OtherMachine(clock)
    for delay_us in delays_us:
        now_us = clock.now_us()
        other.note_pulse(m.Pulse(source_us=0, steady_us=now_us, echo_us=now_us - delay_us, heard_us=now_us))
        clock.advance(0.1)
    said_now = m.Pulse(source_us=0, sent_us=WALL_US, steady_us=clock.now_us())
    assert -other.shift_us(said_now, WALL_US) == pytest.approx(1_000, abs=500)


def test_without_an_echo_stamps_are_judged_by_wall_clock() -> None:
    other = OtherMachine(ManualClock(10**9))
    assert other.shift_us(m.Pulse(source_us=0, sent_us=WALL_US, steady_us=5), WALL_US) == 0
    other.note_pulse(m.Pulse(source_us=0, steady_us=5))
    assert other.shift_us(m.Pulse(source_us=0, sent_us=WALL_US, steady_us=5), WALL_US) == 0
    known, _ = heard(lead_us=0, there_us=10**9, delay_us=0)
    assert known.shift_us(m.Pulse(source_us=0, sent_us=WALL_US), WALL_US + 7) == 0  # of a version without `steady_us`


@pytest.mark.parametrize("ago_us", [-1, 10_000_001])
def test_an_echo_of_before_a_restart_of_the_machine_says_nothing(ago_us: int) -> None:
    clock = ManualClock(10**9)
    other = OtherMachine(clock)
    other.note_pulse(m.Pulse(source_us=0, steady_us=5, echo_us=10**9 - ago_us, heard_us=4))
    assert other.shift_us(m.Pulse(source_us=0, sent_us=WALL_US, steady_us=5), WALL_US) == 0


def test_a_bound_that_a_message_refutes_is_forgotten() -> None:
    """This machine slept for a minute, which its clock did not count."""
    other, _ = heard(lead_us=0, there_us=10**9, delay_us=0)
    woken = m.Pulse(source_us=0, sent_us=WALL_US, steady_us=10**9 + 60_000_000)
    assert other.shift_us(woken, WALL_US) == 0
    assert other.shift_us(m.Pulse(source_us=0, sent_us=WALL_US, steady_us=10**9), WALL_US + 7) == 0


def test_the_bound_grows_while_nothing_is_echoed() -> None:
    other, clock = heard(lead_us=0, there_us=10**9, delay_us=0)
    clock.advance(100.0)
    said_now = m.Pulse(source_us=0, sent_us=WALL_US, steady_us=clock.now_us())
    assert -other.shift_us(said_now, WALL_US) == pytest.approx(200_000, rel=0.01)


def test_an_epoch_of_the_future_of_its_own_machine_is_refused() -> None:
    other, _ = heard(lead_us=0, there_us=10**9, delay_us=0)
    judge = Admission(keys.TRACKS, 43, 1.0, other.shift_us).judge

    def judged(sent_us: int, epoch: int, seq: int) -> str:
        tracks = m.Tracks(
            source_us=sent_us, frame_seq=0, frame_epoch=0, producer="advisor", epoch=epoch, seq=seq,
            sent_us=sent_us, steady_us=10**9, topic=keys.TRACKS.name,
        )  # fmt: skip
        return judge(msgspec.json.encode(tracks), WALL_US)[1]

    behind_us = WALL_US - 3_600_000_000
    assert judged(behind_us, 2**53, 0) == "future"
    assert judged(behind_us, behind_us // 1000 + 1500, 0) == "future"
    assert judged(WALL_US, WALL_US // 1000, 5) == ""
    assert judged(WALL_US, WALL_US // 1000, 5) == "duplicate"
    assert judged(behind_us, behind_us // 1000, 0) == ""  # its clock was set back by an hour, and it began again


def test_what_is_only_handed_on_keeps_its_stamps() -> None:
    ahead_us = WALL_US + 5_000_000
    header = m.PictureHeader(
        source_us=ahead_us, frame_seq=1, frame_epoch=1, width_px=1, height_px=1, media_type="image/jpeg",
        producer="camera", sent_us=ahead_us, steady_us=7, topic=keys.PICTURE.name,
    )  # fmt: skip
    data = msgspec.json.encode(header)
    assert Admission(keys.PICTURE, 43, 1.0, since_sent, as_sent=True).judge(data, WALL_US) == (header, "")
    assert Admission(keys.PICTURE, 43, 1.0).judge(data, WALL_US) == (None, "future")
