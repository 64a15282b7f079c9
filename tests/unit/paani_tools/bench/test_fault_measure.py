"""How a fault's figures come from what was heard: the adapter's reports, gaps in them, and its restarts."""

from __future__ import annotations

import asyncio

import pytest

from paani import messages as m
from paani.errors import UserError
from paani_tools.bench.faults import measure as measuring
from paani_tools.bench.faults.command import ALL, choose
from paani_tools.bench.faults.fault import ZERO_S, Expected, Fault
from paani_tools.bench.faults.measure import FaultRun, keeps_bars, longest_gap_s, measure, zero_after_s
from paani_tools.bench.faults.running import MONOTONIC, Loop, Report, ShiftedClock
from paani_tools.bench.faults.table import fault_table

HIT_US, WALL_US = 10_000_000, 90_000_000_000


def report(at_s: float, *, moves: bool, since_s: float = 0.0) -> Report:
    """Heard so many seconds after the hit."""
    cause = m.ZeroCause.NONE if moves else m.ZeroCause.TIMEOUT
    at_us, wall_us = HIT_US + round(at_s * 1e6), WALL_US + round(at_s * 1e6)
    return Report(at_us, moves, cause, wall_us, WALL_US + round(since_s * 1e6))


async def nothing(loop: Loop) -> None:
    """No fault at all."""


def fault(expected: Expected) -> Fault:
    return Fault(name="fault", expected=expected, begin=nothing, end=nothing)


DRIVING = [report(-0.1, moves=True), report(-0.05, moves=True), report(0.02, moves=True)]


def test_zero_is_when_the_adapter_says_that_it_began() -> None:
    reports = [*DRIVING, report(0.07, moves=True), report(0.12, moves=False, since_s=0.1)]
    assert zero_after_s(reports, HIT_US, WALL_US) == pytest.approx(0.1)


def test_a_beginning_before_the_hit_is_a_clock_that_was_set_and_does_not_count() -> None:
    reports = [*DRIVING, report(0.12, moves=False, since_s=-3600.0)]
    assert zero_after_s(reports, HIT_US, WALL_US) == pytest.approx(0.12)
    reports = [*DRIVING, report(0.12, moves=False, since_s=3600.0)]
    assert zero_after_s(reports, HIT_US, WALL_US) == pytest.approx(0.12)


def test_thrust_that_was_never_zero_has_no_time() -> None:
    assert zero_after_s(DRIVING, HIT_US, WALL_US) is None


def test_after_silence_the_adapter_says_since_when() -> None:
    reports = [*DRIVING, report(1.4, moves=False, since_s=0.31)]
    assert zero_after_s(reports, HIT_US, WALL_US) == pytest.approx(0.31)


def test_thrust_that_went_between_the_last_report_and_the_hit_was_zero_at_the_hit() -> None:
    reports = [*DRIVING[:2], report(1.1, moves=False, since_s=-0.02)]
    assert zero_after_s(reports, HIT_US, WALL_US) == 0.0


def test_an_adapter_that_drives_on_in_silence_is_found_out() -> None:
    """It was moving until shortly before it was heard again."""
    reports = [*DRIVING, report(1.4, moves=False, since_s=1.3)]
    assert zero_after_s(reports, HIT_US, WALL_US) == pytest.approx(1.3)


def test_a_dead_adapter_applies_nothing_after_its_last_word() -> None:
    reports = [*DRIVING, report(2.0, moves=False, since_s=1.9)]
    assert zero_after_s(reports, HIT_US, WALL_US, adapter_away=True) == pytest.approx(0.02)


def test_what_was_zero_before_the_hit_says_nothing() -> None:
    reports = [report(-0.3, moves=False), *DRIVING]
    assert zero_after_s(reports, HIT_US, WALL_US) is None


def test_the_longest_gap() -> None:
    assert longest_gap_s([0, 200_000, 1_400_000, 1_500_000]) == pytest.approx(1.2)
    assert longest_gap_s([5]) == 0.0


@pytest.mark.parametrize(
    ("expected", "change", "kept"),
    [
        (Expected.STOPS, {}, True),
        (Expected.STOPS, {"zero_s": ZERO_S + 0.01}, False),
        (Expected.STOPS, {"zero_s": None}, False),
        (Expected.STOPS, {"moved": True}, False),
        (Expected.STOPS, {"back_s": None}, False),
        (Expected.STOPS, {"hands": True}, False),
        (Expected.STOPS, {"problem": "not under way"}, False),
        (Expected.HAND, {"hands": True}, True),
        (Expected.HAND, {}, False),
        (Expected.HAND, {"hands": True, "rearmed": True}, False),
        (Expected.GOES_ON, {"zero_s": None}, True),
        (Expected.GOES_ON, {"zero_s": 0.3}, True),
        (Expected.GOES_ON, {"hands": True}, False),
        (Expected.GOES_ON, {"back_s": None}, False),
        (Expected.MAY_STAND, {"hands": True}, True),
        (Expected.MAY_STAND, {"rearmed": True}, False),
    ],
)
def test_bars(expected: Expected, change: dict[str, object], kept: bool) -> None:
    values: dict[str, object] = {"fault": "fault", "zero_s": 0.3, "back_s": 1.0, **change}
    assert keeps_bars(fault(expected), FaultRun(**values)) is kept  # type: ignore[arg-type]


def test_the_table_has_the_worst_and_says_what_was_not_measured() -> None:
    runs = [FaultRun(fault="fault", zero_s=zero_s, back_s=1.0) for zero_s in (0.1, 0.2, 0.45)]
    text = fault_table([fault(Expected.STOPS)], runs, {"other": "needs a thing"})
    assert "| fault | stops | 3 | 0.5 | 0.20, 0.45 | 1.00, 1.00 | 0.0 | 0 | 3 |" in text
    assert "not measured: other: needs a thing" in text


def test_each_fault_has_one_name_and_can_be_chosen_by_a_word_of_it() -> None:
    assert len({each.name for each in ALL}) == len(ALL) >= 20
    assert {each.name for each in choose(["cut", "stalled"])} == {"link cut", "link stalled"}
    with pytest.raises(UserError, match="no such fault"):
        choose(["kraken"])


class SlowWatch:
    """What a drive has said, for a fault after which it is slow to come back."""

    def __init__(self) -> None:
        self.reports: list[Report] = []
        self.decided_us: list[int] = []


class SlowLoop(Loop):
    """An armed drive that moves again only some time after its fault has ended; nobody's hand is needed."""

    def __init__(self) -> None:
        self.watch, self.clock, self.armings = SlowWatch(), ShiftedClock(), 0  # type: ignore[assignment]

    async def settle(self) -> bool:
        return True

    async def arm(self) -> None:
        self.armings += 1


@pytest.mark.slow
async def test_a_drive_that_is_slow_to_come_back_has_not_armed_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was armed all the time: the time counts from the fault's end, and no hand is said to have helped."""
    monkeypatch.setattr(measuring, "BACK_S", 0.2)
    loop = SlowLoop()

    def hear(*, moves: bool) -> None:
        now_us = MONOTONIC.now_us()
        cause = m.ZeroCause.NONE if moves else m.ZeroCause.TIMEOUT
        loop.watch.reports.append(Report(now_us, moves, cause, now_us, now_us))

    async def begin(loop: Loop) -> None:
        loop.mark()
        hear(moves=False)
        asyncio.get_running_loop().call_later(0.5, lambda: hear(moves=True))

    async def end(loop: Loop) -> None:
        """At once."""

    run = await measure(Fault(name="slow", expected=Expected.STOPS, begin=begin, end=end), loop)
    assert (run.rearmed, run.hands, loop.armings) == (False, False, 0)
    assert run.back_s is not None
    assert run.back_s >= 0.4


@pytest.mark.parametrize(
    ("cause", "is_unarmed"),
    [(m.ZeroCause.NOT_ARMED, True), (m.ZeroCause.REARM, True), (m.ZeroCause.LINE_LOST, False)],
)
def test_a_hand_is_needed_where_the_boat_or_its_microcontroller_is_not_armed(
    cause: m.ZeroCause, is_unarmed: bool
) -> None:
    loop = SlowLoop()
    loop.watch.reports.append(Report(HIT_US, False, cause, WALL_US, WALL_US))
    assert loop.is_unarmed() is is_unarmed


class RefusingLoop(SlowLoop):
    """A drive that refuses the first hold and takes the second."""

    async def arm(self) -> None:
        await super().arm()
        if self.armings > 1:
            now_us = MONOTONIC.now_us()
            self.watch.reports.append(Report(now_us, True, m.ZeroCause.NONE, now_us, now_us))


@pytest.mark.slow
async def test_a_hand_that_is_refused_holds_again_and_the_time_counts_from_its_first_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(measuring, "STAYS_S", 0.0)
    monkeypatch.setattr(measuring, "ANSWER_S", 0.1)
    loop = RefusingLoop()

    async def begin(loop: Loop) -> None:
        loop.mark()
        now_us = MONOTONIC.now_us()
        loop.watch.reports.append(Report(now_us, False, m.ZeroCause.NOT_ARMED, now_us, now_us))

    async def end(loop: Loop) -> None:
        """At once."""

    run = await measure(Fault(name="refused", expected=Expected.HAND, begin=begin, end=end), loop)
    assert (run.rearmed, run.hands, loop.armings) == (False, True, 2)
    assert run.back_s is not None
    assert run.back_s >= 0.1
