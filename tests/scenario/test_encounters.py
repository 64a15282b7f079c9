"""Encounters with known truth, and what the advisor makes of a few of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paani import messages as m
from paani_sim.eye.camera import Camera
from paani_sim.studies.encounters import (
    EncounterCourse,
    EncounterFamily,
    FrameObservation,
    boat_pose_at,
    draw_course,
    range_at_m,
    simulate_frames,
)
from paani_sim.studies.motion_table import UNCOMPENSATED, motion_table, tabulate_rows

C = m.MotionCause


def played(
    family: EncounterFamily, number: int, rate_hz: float = 5.0
) -> tuple[EncounterCourse, list[FrameObservation]]:
    rng = np.random.default_rng([7, number])
    course = draw_course(family, rng)
    return course, list(simulate_frames(course, rate_hz, Camera(), rng))


@pytest.mark.parametrize("family", list(EncounterFamily))
def test_frames_come_at_their_rate_with_boxes_inside_the_picture(family: EncounterFamily) -> None:
    """Same seed, same frames; boxes are sound; a whole thing's box is the truth but for jitter and reflections."""
    off = []
    for number in range(6):
        course, frames = played(family, number)
        assert (course, frames) == played(family, number)
        periods = np.diff([frame.at_s for frame in frames])
        assert np.median(periods) == pytest.approx(0.2, abs=0.02)
        for frame in frames:
            if frame.box is None:
                continue
            x1, y1, x2, y2 = frame.box
            assert 0.0 <= x1 < x2 <= 1.0
            assert 0.0 <= y1 < y2 <= 1.0
            assert 0.4 < frame.confidence <= 0.99
            assert frame.truth is not None
            if frame.whole:
                off.append(abs(x1 - frame.truth[0]) * 320)
    if off:
        assert np.median(off) < 1.0


def test_each_family_has_its_kind_of_motion() -> None:
    """Approach closes, recede opens, stationary and turn keep their range; a turn sweeps across the picture."""
    for number in range(6):
        for family, sign in (
            (EncounterFamily.APPROACH, 1),
            (EncounterFamily.APPROACH_TURNING, 1),
            (EncounterFamily.RECEDE, -1),
        ):
            course, _ = played(family, number)
            assert np.sign(range_at_m(course, 0.0) - range_at_m(course, 10.0)) == sign
        for family in (EncounterFamily.STATIONARY, EncounterFamily.TURN):
            course, frames = played(family, number)
            assert range_at_m(course, 5.0) == range_at_m(course, 0.0)
            middles = [0.5 * (f.truth[0] + f.truth[2]) for f in frames if f.truth is not None]
            assert (max(middles) - min(middles) > 0.5) == (family is EncounterFamily.TURN)
        course, _ = played(EncounterFamily.TURN, number)
        (before, _), (after, _) = boat_pose_at(course, 1.0), boat_pose_at(course, 2.0)
        assert after.yaw_rad - before.yaw_rad == pytest.approx(course.turn_radps)
        hidden = [f for f in played(EncounterFamily.GAPS, number)[1] if f.box is None]
        assert hidden


def test_gaps_and_cut_boxes_are_never_judged_and_say_why() -> None:
    """U9: a thing that is out of sight or cut by the picture's edge is unknown."""
    rows = motion_table(3, 8, ("paani",), (5.0,), (EncounterFamily.CLIPPED, EncounterFamily.GAPS))
    clipped, gaps = rows[0], rows[1]
    assert (clipped.closing, clipped.judged) == (0, 0)
    assert gaps.closing > 20
    assert gaps.known > 0.7 * gaps.closing


def test_a_turn_is_no_approach() -> None:
    """The same turns, with and without compensation: identities and signs."""
    kept, lost = (
        motion_table(3, 12, (profile,), (5.0,), (EncounterFamily.TURN,))[0] for profile in ("paani", UNCOMPENSATED)
    )
    assert kept.judged > 50
    assert kept.wrong < 0.05 * kept.judged
    assert lost.wrong > 0.5 * lost.judged > 10
    assert kept.identities <= 1.3 * kept.targets
    assert lost.identities > 3 * lost.targets


def test_i22_the_papers_rate() -> None:
    """I22: `paper` knows nothing at 0.5 Hz; every unknown has a cause."""
    families = (EncounterFamily.APPROACH, EncounterFamily.RECEDE, EncounterFamily.STATIONARY)
    paper = motion_table(3, 6, ("paper",), (0.5,), families)[-1]
    assert (paper.judged, paper.family) == (0, None)
    assert paper.closing == sum(count for _, count in paper.causes) > 0
    assert C.NONE not in dict(paper.causes)
    paani = motion_table(3, 6, ("paani",), (0.5,), families)[-1]
    assert paani.judged > 50
    assert paani.wrong == 0


def test_the_table_has_a_row_for_each_and_one_for_all() -> None:
    rows = motion_table(3, 1, ("paani", "paper"), (1.0, 5.0), (EncounterFamily.APPROACH, EncounterFamily.PASS))
    part = tabulate_rows(rows)
    assert [row[:3] for row in part.rows] == [
        (profile, rate, encounter)
        for profile in ("paani", "paper")
        for rate in ("1", "5")
        for encounter in ("approach", "pass", "all")
    ]
    assert all(len(row) == len(part.columns) for row in part.rows)
    assert rows[2].closing == rows[0].closing + rows[1].closing
    assert math.isfinite(sum(row.identities for row in rows))
