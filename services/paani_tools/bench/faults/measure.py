"""One fault, once: how soon there was no thrust, how soon there was again, and who had to help."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Sequence

import msgspec

from paani_tools.bench.faults.fault import Expected, Fault
from paani_tools.bench.faults.running import MONOTONIC, Loop, Report, until

SILENCE_S = 0.15  # three of the adapter's reports
BACK_S = 15.0
STAYS_S = 1.5
ANSWER_S = 0.5  # from the end of a hold to a report that the boat is armed
HISTORY = 20  # reports of the second before


class FaultRun(msgspec.Struct, frozen=True, kw_only=True):
    """`zero_s`, `back_s`: seconds to no thrust from the fault's beginning, and to thrust from its end; None: never.

    `moved`: there was thrust again while the fault lasted. `rearmed`: there was thrust before a hand armed that had
    to. `hands`: a hand had to arm; `back_s` is from the end of its first hold. `blind_s`: the longest time without a
    decision. `problem`: why it says nothing.
    """

    fault: str
    zero_s: float | None = None
    back_s: float | None = None
    moved: bool = False
    rearmed: bool = False
    hands: bool = False
    blind_s: float = 0.0
    problem: str = ""


def keeps_bars(fault: Fault, run: FaultRun) -> bool:
    """Whether the boat did what is expected of it."""
    if run.problem or run.rearmed or run.back_s is None:
        return False
    if fault.expected is Expected.MAY_STAND:
        return True
    if fault.expected is Expected.GOES_ON:
        return not run.hands
    stopped = run.zero_s is not None and run.zero_s <= fault.zero_s and not run.moved
    return stopped and run.hands is (fault.expected is Expected.HAND)


async def measure(fault: Fault, loop: Loop) -> FaultRun:
    """Hurt a drive that is under way, and follow it until it is again."""
    if not await loop.settle():
        return FaultRun(fault=fault.name, problem=f"not under way before: {loop.watch.reports[-1:]}")
    watch, first = loop.watch, max(0, len(loop.watch.reports) - HISTORY)
    try:
        await fault.begin(loop)
        await asyncio.sleep(fault.lasts_s)
        await fault.end(loop)
    except (OSError, TimeoutError) as error:
        return FaultRun(fault=fault.name, problem=f"{type(error).__name__}: {error}")
    ended_us = MONOTONIC.now_us()
    hands, rearmed = False, False
    if fault.expected is Expected.HAND or not await _until(lambda: _moves_after(loop, ended_us), BACK_S):
        hands = await _until(loop.is_unarmed, BACK_S)
        if hands:
            unarmed_us = MONOTONIC.now_us()
            await asyncio.sleep(STAYS_S)
            rearmed = _moves_after(loop, unarmed_us)
            ended_us = await _arm_until_taken(loop)
        await _until(lambda: _moves_after(loop, ended_us), BACK_S)
    reports = watch.reports[first:]
    zero_s = zero_after_s(reports, loop.hit_us, loop.hit_wall_us, adapter_away=fault.hurts_adapter)
    limit_us = loop.hit_us + round(fault.zero_s * 1e6)
    back_us = next((report.at_us for report in reports if report.moves and report.at_us > ended_us), None)
    decided = [at_us for at_us in watch.decided_us if at_us >= loop.hit_us]
    return FaultRun(
        fault=fault.name,
        zero_s=zero_s,
        back_s=None if back_us is None else (back_us - ended_us) * 1e-6,
        moved=any(each.moves and limit_us < each.at_us < loop.hit_us + fault.lasts_s * 1e6 for each in reports),
        rearmed=rearmed,
        hands=hands,
        blind_s=longest_gap_s([loop.hit_us, *decided]),
    )


async def _arm_until_taken(loop: Loop) -> int:
    """When the first hold ended [us, monotonic]; a hand that is refused holds again, for `BACK_S` in all."""
    await loop.arm()
    ended_us = MONOTONIC.now_us()
    while not await _until(lambda: not loop.is_unarmed(), ANSWER_S) and MONOTONIC.now_us() - ended_us < BACK_S * 1e6:
        await loop.arm()
    return ended_us


def zero_after_s(
    reports: Sequence[Report], hit_us: int, hit_wall_us: int, *, adapter_away: bool = False
) -> float | None:
    """Seconds from the hit to no thrust; None where thrust was never zero.

    The adapter says since when there is none, in its first report without thrust: at the hit already where it says a
    moment before, of which no report came through. One that was away itself (dead, or not running: the simulator's
    time stands still with it) has applied nothing after its last word.
    """
    before: Report | None = None
    for report in reports:
        if report.at_us < hit_us:
            before = report
            continue
        silent = before is not None and report.at_us - before.at_us > SILENCE_S * 1e6
        if not report.moves and before is not None and silent and adapter_away:
            return max(0.0, (before.at_us - hit_us) * 1e-6)
        if not report.moves:
            since_s, heard_s = (report.zero_since_us - hit_wall_us) * 1e-6, (report.at_us - hit_us) * 1e-6
            was_clock_set = not -SILENCE_S <= since_s <= heard_s
            return heard_s if was_clock_set else max(0.0, since_s)
        before = report
    return None


def longest_gap_s(times_us: Sequence[int]) -> float:
    """The longest time between two that follow each other."""
    return max((later - earlier for earlier, later in itertools.pairwise(times_us)), default=0) * 1e-6


def _moves_after(loop: Loop, at_us: int) -> bool:
    return any(report.moves and report.at_us > at_us for report in reversed(loop.watch.reports[-400:]))


async def _until(condition: Callable[[], bool], limit_s: float) -> bool:
    try:
        await until(condition, limit_s)
    except TimeoutError:
        return False
    return True
