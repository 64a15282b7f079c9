"""Changes of direction, counted."""

from __future__ import annotations

import itertools

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.statistics.dithering import Dithering, dithering

D = m.Direction


def advisories(directions: list[m.Direction], period_s: float = 1.0, epoch: int = 1) -> list[m.Advisory]:
    return [
        m.Advisory(source_us=round(i * period_s * 1e6), direction=d, reason=m.Reason.CENTER_CLEAR, epoch=epoch)
        for i, d in enumerate(directions)
    ]


def test_each_kind_by_hand() -> None:
    """Thirty-one advisories in half a minute: 5 changes, one side flip through a STOP, two stop-go flips."""
    run = [D.STRAIGHT] * 10 + [D.SLIGHT_LEFT] * 5 + [D.STOP] * 5 + [D.RIGHT] * 5 + [D.STRAIGHT] * 3 + [D.LEFT] * 3
    found = dithering(advisories(run))
    assert found == Dithering(
        seconds=30.0, changes=5, side_flips=1, stop_go_flips=2,
        changes_per_min=10.0, side_flips_per_min=2.0, stop_go_flips_per_min=4.0,
    )  # fmt: skip


def test_nothing_said_and_one_thing_said_is_no_dithering() -> None:
    assert dithering([]) == dithering(advisories([D.LEFT])) == Dithering()


def test_slight_and_full_of_one_side_are_no_side_flip() -> None:
    found = dithering(advisories([D.LEFT, D.SLIGHT_LEFT] * 5))
    assert (found.changes, found.side_flips, found.stop_go_flips) == (9, 0, 0)


def test_a_republish_is_dated_by_its_age() -> None:
    """A stale STOP follows from the same evidence, later."""
    first = advisories([D.LEFT])[0]
    late = msgspec.structs.replace(first, direction=D.STOP, reason=m.Reason.STALE_EVIDENCE, evidence_age_s=2.0)
    found = dithering([first, late])
    assert (found.seconds, found.changes, found.interruptions, found.stop_go_flips) == (2.0, 1, 1, 1)


def test_a_pause_a_restart_and_time_going_back_begin_again() -> None:
    before, after = advisories([D.LEFT] * 3), advisories([D.RIGHT] * 3)
    paused = [msgspec.structs.replace(a, source_us=a.source_us + 60_000_000) for a in after]
    restarted = [msgspec.structs.replace(a, source_us=a.source_us + 3_000_000, epoch=2) for a in after]
    for rest in (paused, restarted, after):
        found = dithering([*before, *rest])
        assert (found.seconds, found.changes) == (4.0, 0)


@given(st.lists(st.sampled_from(D), max_size=40))
def test_no_kind_exceeds_the_changes(run: list[m.Direction]) -> None:
    found = dithering(advisories(run))
    assert found.changes == sum(a is not b for a, b in itertools.pairwise(run))
    assert max(found.side_flips, found.stop_go_flips) <= found.changes
