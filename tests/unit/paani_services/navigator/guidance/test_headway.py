"""Headway along a path: when there is none, and where the path leads."""

from __future__ import annotations

import itertools
import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import Waypoint
from paani_services.navigator.guidance.headway import (
    AHEAD_SPACING_M,
    HEADWAY_M,
    Headway,
    is_barred,
    note_headway,
    path_ahead_m,
)
from paani_services.navigator.guidance.mission_progress import LegSetpoint
from paani_services.navigator.guidance.path_progress import WaypointPath
from tests.synthetic_water import PLANNER

CORNERS = ((0.0, 0.0), (30.0, 0.0), (30.0, 20.0))
PATH = WaypointPath(tuple(Waypoint(x_m=x, y_m=y) for x, y in CORNERS))
TO_SECOND = LegSetpoint(path=PATH, target=1)
BARRED_US = round(PLANNER.barred_s * 1e6)


@given(steps_m=st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=20), aside_m=st.floats(-5.0, 5.0))
def test_only_what_is_nearer_to_the_end_than_ever_is_headway(steps_m: list[float], aside_m: float) -> None:
    """Way made to a side, back, and over the same water again is none."""
    headway, best_m, at_m = note_headway(Headway(), TO_SECOND, 0, (15.0, aside_m), 1), 15.0, 15.0
    for number, step_m in enumerate(steps_m, start=2):
        at_m += step_m
        after = note_headway(headway, TO_SECOND, 0, (at_m, aside_m), number)
        if at_m >= best_m + HEADWAY_M + 1e-9:
            assert after.since_us == number
            best_m = at_m
        elif at_m < best_m + HEADWAY_M - 1e-9:
            assert after == headway
        else:
            best_m = at_m if after.since_us == number else best_m
        headway = after


def test_a_boat_is_barred_once_it_made_no_headway_for_so_long() -> None:
    headway = note_headway(Headway(), TO_SECOND, 0, (15.0, 0.0), 5)
    assert not is_barred(headway, 5 + BARRED_US - 1, PLANNER)
    assert is_barred(headway, 6 + BARRED_US, PLANNER)
    assert not is_barred(headway, 6 + BARRED_US, msgspec.structs.replace(PLANNER, barred_s=0.0))
    assert not is_barred(note_headway(headway, TO_SECOND, 1, (15.0, 0.0), 6 + BARRED_US), 6 + BARRED_US, PLANNER)


def test_what_follows_no_path_is_never_barred() -> None:
    headway = note_headway(Headway(), LegSetpoint(), 0, (0.0, 0.0), 5)
    assert note_headway(headway, LegSetpoint(), 0, (0.0, 0.0), 5 + BARRED_US).since_us == 5 + BARRED_US
    assert path_ahead_m(LegSetpoint(), (0.0, 0.0), 18.0) == []


@given(x_m=st.floats(-10.0, 40.0), y_m=st.floats(-10.0, 30.0), reach_m=st.floats(1.0, 60.0))
@pytest.mark.parametrize("repeat", [False, True])
def test_the_path_ahead_begins_abeam_and_follows_the_legs(x_m: float, y_m: float, reach_m: float, repeat: bool) -> None:
    path = PATH._replace(repeat=repeat)
    points = path_ahead_m(LegSetpoint(path=path, target=1), (x_m, y_m), reach_m)
    assert points[0] == pytest.approx((min(max(x_m, 0.0), 30.0), 0.0))
    steps_m = [math.dist(*pair) for pair in itertools.pairwise(points)]
    assert all(0.0 < step_m <= AHEAD_SPACING_M + 1e-9 for step_m in steps_m)
    left_m = 30.0 - points[0][0] + 20.0 + (math.hypot(30.0, 20.0) if repeat else 0.0)
    assert min(reach_m, left_m) - AHEAD_SPACING_M - 1e-9 <= sum(steps_m) <= min(reach_m, left_m) + 1e-9
    legs = itertools.pairwise((*CORNERS, CORNERS[0]) if repeat else CORNERS)
    lines = [((b[0] - a[0], b[1] - a[1]), a) for a, b in legs]
    for point in points:
        assert any(
            abs(along[0] * (point[1] - a[1]) - along[1] * (point[0] - a[0])) < 1e-6 * math.hypot(*along)
            for along, a in lines
        )
