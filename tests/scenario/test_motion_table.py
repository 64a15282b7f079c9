"""The bars of apparent motion, on encounters whose truth is known. Counts, not times."""

from __future__ import annotations

import pytest

from paani_sim.studies.encounters import EncounterFamily
from paani_sim.studies.motion_table import MotionRow, motion_table

CLOSING = (EncounterFamily.APPROACH, EncounterFamily.APPROACH_TURNING)


@pytest.fixture(scope="module")
def rows() -> list[MotionRow]:
    return motion_table(1, 20, ("paani",), (1.0, 4.0, 5.0, 10.0))


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("rate_hz", "bar"), [(1.0, 0.6), (4.0, 0.8), (5.0, 0.8), (10.0, 0.8)])
def test_closing_things_are_known_at_every_rate(rows: list[MotionRow], rate_hz: float, bar: float) -> None:
    """At least 80 % from 4 Hz on and 60 % at 1 Hz, of tracks and of moments; the boat turning or not."""
    for row in rows:
        if row.rate_hz == rate_hz and row.family in CLOSING:
            assert row.tracks >= 10
            assert row.known_tracks >= bar * row.tracks
            assert row.known >= bar * row.closing


@pytest.mark.timeout(300)
@pytest.mark.parametrize("rate_hz", [1.0, 4.0, 5.0, 10.0])
def test_at_most_one_state_in_a_hundred_is_wrong(rows: list[MotionRow], rate_hz: float) -> None:
    """Over all families together, late ones included."""
    (row,) = [row for row in rows if row.rate_hz == rate_hz and row.family is None]
    assert row.judged > 100
    assert row.wrong + row.late <= 0.01 * row.judged
