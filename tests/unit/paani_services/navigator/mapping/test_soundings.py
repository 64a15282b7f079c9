"""Soundings: what is shallow, where the bottom is expected to be, and that a sonar that lies adds no danger."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from paani import messages as m
from paani.config import PlannerConfig
from paani.messages import SoundingStatus
from paani_services.navigator.mapping.observation import ObservationMemory, update_memory
from paani_services.navigator.mapping.soundings import (
    BEYOND_ROWS,
    EXPECTED_WITHIN_M,
    MAX_SHALLOW_CELLS,
    SHALLOW_CELL_M,
    SoundingMemory,
    name_doubts,
    update_soundings,
)
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import PLANNER, START_US, odometry

STEP_US, SPEED_MPS = 200_000, 0.6
LIMIT_M = PLANNER.min_depth_m
Bottom = Callable[[float], float]


class Survey:
    """A boat that goes east at 0.6 m/s and sounds five times a second. Soundings err by turns by 1 cm and less."""

    def __init__(self, config: PlannerConfig = PLANNER) -> None:
        self.config, self.now_us, self.x_m, self.steps = config, START_US, 0.0, 0
        self.boat, self.memory, self.epoch = ObservationMemory(), SoundingMemory(), 0
        self.map_off_m = 0.0  # by which the map differs from dead reckoning

    def sail(self, steps: int, depth_of: Bottom, *, speed_mps: float = SPEED_MPS, errs: bool = True) -> SoundingMemory:
        for _ in range(steps):
            depth_m = depth_of(self.x_m) + (0.008 * ((self.steps * 7) % 5 - 2) / 2 if errs else 0.0)
            self.take(m.Depth(source_us=self.now_us + STEP_US, depth_m=depth_m), speed_mps)
        return self.memory

    def take(self, depth: m.Depth | None, speed_mps: float = SPEED_MPS) -> SoundingMemory:
        """A step of the boat, and what its sonar says then."""
        self.steps += 1
        state = odometry(self.now_us, BoatPose(self.x_m + self.map_off_m, 0.0, 0.0))
        for _ in range(2):
            self.now_us += STEP_US // 2
            self.x_m += 0.5 * speed_mps * STEP_US * 1e-6
            state = odometry(self.now_us, BoatPose(self.x_m + self.map_off_m, 0.0, 0.0))
            state = replace(state, surge_mps=speed_mps, epoch=self.epoch)
            self.boat = update_memory(self.boat, state, None, self.config)
        self.memory = update_soundings(self.memory, depth, self.boat, state, self.now_us, self.config)
        return self.memory

    def places(self) -> list[tuple[float, float]]:
        """The middles of the shallow cells."""
        return [((c.column + 0.5) * SHALLOW_CELL_M, (c.row + 0.5) * SHALLOW_CELL_M) for c in self.memory.cells]


def level(depth_m: float) -> Bottom:
    return lambda _: depth_m


def rising(slope: float, shallow_at_m: float) -> Bottom:
    """So shallow that it counts at this place, and less deep beyond it."""
    return lambda x_m: LIMIT_M + slope * (shallow_at_m - x_m)


@given(st.floats(0.1, 0.6), st.floats(5.0, 9.0))
@pytest.mark.slow
def test_shallow_water_is_expected_where_the_bottom_leads_to_before_the_boat_can_only_just_stop(
    slope: float, shallow_at_m: float
) -> None:
    survey = Survey()
    while survey.x_m < shallow_at_m - 2.0:
        survey.sail(1, rising(slope, shallow_at_m))
    assert survey.memory.status is SoundingStatus.OK
    places = survey.places()
    assert places, "no later than two metres before it, and a boat stops in 1.5 m"
    beyond_m = BEYOND_ROWS * SHALLOW_CELL_M
    assert all(-0.5 * EXPECTED_WITHIN_M < x_m - shallow_at_m < 0.5 * EXPECTED_WITHIN_M + beyond_m for x_m, _ in places)
    ahead_m = [x_m for x_m, y_m in places if abs(y_m) < 0.3 and x_m > survey.x_m]
    assert min(ahead_m) < shallow_at_m + SHALLOW_CELL_M, "the way on is closed before it is shallow"
    assert max(ahead_m) - min(ahead_m) > 1.0, "and so far beyond that no boat jumps it"
    assert {round(y_m, 1) for _, y_m in places} >= {-1.8, -1.0, -0.6, -0.2, 0.2, 0.6, 1.0, 1.8}, "and beside it"


@given(st.floats(0.65, 30.0), st.integers(0, 100))
@pytest.mark.slow
def test_a_level_bottom_that_is_deep_enough_is_no_obstacle(depth_m: float, first: int) -> None:
    survey = Survey()
    survey.steps = first
    assert survey.sail(40, level(depth_m)).cells == ()
    assert survey.memory.depth_m == pytest.approx(depth_m, abs=0.01)


def test_what_was_sounded_shallow_stays_an_obstacle() -> None:
    """Also where it is sounded deep later, as at high water or on a wave."""
    survey = Survey()
    survey.sail(30, lambda x_m: 2.0 if x_m < 1.2 or x_m > 2.4 else 0.5)
    sounded = [x_m for (x_m, _), cell in zip(survey.places(), survey.memory.cells, strict=True) if cell.is_sounded]
    assert min(sounded) < 1.6
    assert 1.9 < max(sounded) < 2.7
    survey.sail(40, level(2.0), speed_mps=-SPEED_MPS)
    assert survey.x_m < 0.0
    assert set(sounded) <= {x_m for x_m, _ in survey.places()}


@pytest.mark.slow
def test_what_was_only_expected_is_forgotten_in_time() -> None:
    survey = Survey()
    survey.sail(26, rising(0.3, 5.0))
    assert survey.memory.cells
    survey.sail(480, rising(0.3, 5.0), speed_mps=-SPEED_MPS)
    assert survey.memory.cells, "96 s later, and 60 m away"
    survey.sail(180, rising(0.3, 5.0), speed_mps=-SPEED_MPS)
    assert survey.memory.cells == ()


def test_what_was_expected_shallow_is_free_again_where_the_bottom_is_level_after_all() -> None:
    survey = Survey()
    survey.sail(24, rising(0.5, 5.0))
    at_m = survey.x_m
    assert any(abs(y_m) < 0.3 for _, y_m in survey.places())
    survey.sail(14, lambda x_m: rising(0.5, 5.0)(min(x_m, at_m)))
    assert [x_m for x_m, y_m in survey.places() if abs(y_m) < 0.3 and x_m > survey.x_m] == []


def test_a_bottom_that_falls_closes_nothing_behind_the_boat() -> None:
    survey = Survey()
    assert survey.sail(15, lambda x_m: 0.7 + 0.3 * x_m).cells == ()


@pytest.mark.parametrize("bottom", [rising(0.3, 2.0), level(0.4)], ids=["nearly shallow", "shallow"])
def test_the_way_on_is_closed_where_the_water_is_shallow_already_or_as_good_as_that(bottom: Bottom) -> None:
    survey = Survey()
    survey.sail(16, bottom)
    expected = [x_m for (x_m, _), cell in zip(survey.places(), survey.memory.cells, strict=True) if not cell.is_sounded]
    assert max(expected) > survey.x_m + 0.4


def test_the_foot_of_a_shoal_is_noticed_within_a_metre() -> None:
    """What was level before it does not make the slope look gentle."""
    survey = Survey()
    survey.sail(33, lambda x_m: 1.54 - 0.45 * max(x_m - 3.0, 0.0))
    assert survey.x_m < 4.0
    assert min(x_m for x_m, y_m in survey.places() if abs(y_m) < 0.3) < 3.0 + (1.54 - LIMIT_M) / 0.45 + 0.4


def test_a_boat_that_stands_keeps_what_it_expected_and_expects_nothing_new() -> None:
    survey = Survey()
    survey.sail(26, rising(0.3, 5.0))
    marked = set(survey.places())
    survey.sail(10, lambda x_m: rising(0.3, 5.0)(x_m) + 0.02 * (survey.steps % 3), speed_mps=0.0)
    assert marked
    assert set(survey.places()) == marked


@pytest.mark.slow
def test_memory_is_bounded_and_the_oldest_is_forgotten() -> None:
    survey = Survey()
    survey.sail(1200, level(0.4), speed_mps=1.5)
    assert len(survey.memory.cells) == MAX_SHALLOW_CELLS
    assert min(x_m for x_m, _ in survey.places()) > 100.0
    assert len(survey.memory.recent) < 60


def test_a_frozen_sonar_is_named_and_what_it_says_then_marks_and_frees_nothing() -> None:
    survey = Survey()
    survey.sail(26, rising(0.3, 5.0))
    assert survey.memory.cells
    survey.sail(15, level(survey.memory.depth_m), errs=False)
    assert survey.memory.status is SoundingStatus.FROZEN
    assert name_doubts(survey.memory) == ("sonar frozen",)
    assert survey.memory.recent == ()
    kept = survey.memory.cells
    assert kept
    survey.sail(30, level(survey.memory.depth_m), errs=False)
    assert survey.memory.cells == kept
    believed = survey.sail(5, level(2.5))
    assert believed.status is SoundingStatus.OK, "it is believed again once its digits change"
    assert name_doubts(believed) == ()


def test_a_boat_at_rest_hears_one_depth_for_long() -> None:
    survey = Survey()
    assert survey.sail(60, level(2.0), speed_mps=0.0, errs=False).status is SoundingStatus.OK


def test_a_jump_is_named_and_believed_once_three_soundings_bear_it_out() -> None:
    survey = Survey()
    survey.sail(10, level(3.0))
    assert survey.sail(1, level(0.3)).status is SoundingStatus.JUMPED
    assert survey.memory.cells == ()
    assert survey.memory.depth_m > 2.9
    assert survey.sail(1, level(3.0)).status is SoundingStatus.OK
    assert survey.sail(2, level(0.3)).status is SoundingStatus.JUMPED
    believed = survey.sail(1, level(0.3))
    assert believed.status is SoundingStatus.OK
    assert len(believed.cells) >= 1


@given(st.lists(st.integers(1, 3), min_size=30, max_size=30))
@pytest.mark.slow
def test_a_sonar_that_raves_is_never_believed(steps: list[int]) -> None:
    survey = Survey()
    survey.sail(10, level(3.0))
    depth_m, number = survey.memory.depth_m, 0
    for step in steps:
        number += step
        survey.sail(1, level((0.2, 15.0, 80.0, 300.0)[number % 4]))
        assert survey.memory.status is SoundingStatus.JUMPED
    assert survey.memory.cells == ()
    assert survey.memory.depth_m == depth_m


@pytest.mark.parametrize(
    ("depth_m", "available", "status"),
    [
        (0.0, True, SoundingStatus.IMPLAUSIBLE),
        (math.nan, True, SoundingStatus.IMPLAUSIBLE),
        (math.inf, True, SoundingStatus.IMPLAUSIBLE),
        (-1.0, True, SoundingStatus.IMPLAUSIBLE),
        (0.0, False, SoundingStatus.NO_ECHO),
    ],
)
def test_nonsense_is_named_and_changes_no_obstacle(depth_m: float, available: bool, status: SoundingStatus) -> None:
    survey = Survey()
    survey.sail(26, rising(0.3, 5.0))
    marked = survey.memory.cells
    assert marked
    survey.take(m.Depth(source_us=survey.now_us + STEP_US, depth_m=depth_m, available=available))
    assert survey.memory.status is status
    assert survey.memory.cells == marked


def test_a_sounding_that_is_still_to_come_is_named_and_marks_nothing() -> None:
    """As one from before the clock was set back is."""
    survey = Survey()
    survey.sail(5, level(4.0))
    for ahead_us in (1, 5_000_000):
        survey.take(m.Depth(source_us=survey.now_us + STEP_US + ahead_us, depth_m=0.2))
        assert (survey.memory.status, survey.memory.cells) == (SoundingStatus.STALE, ())
    assert survey.sail(2, level(4.0)).status is SoundingStatus.OK


def test_a_sonar_that_falls_silent_is_named() -> None:
    survey = Survey()
    survey.sail(10, level(3.0))
    last = m.Depth(source_us=survey.now_us, depth_m=3.0)
    for _ in range(round(PLANNER.sounding_max_age_s / 0.2) + 1):
        survey.take(last)
    assert survey.memory.status is SoundingStatus.STALE


def test_an_echo_lost_over_water_that_became_shallow_is_lost_in_the_blind_zone() -> None:
    shallow, deep = Survey(), Survey()
    for survey, depth_m in ((shallow, 0.7), (deep, 3.0)):
        survey.sail(10, level(depth_m))
        survey.take(m.Depth(source_us=survey.now_us + STEP_US, available=False))
    sounded = [place for place, cell in zip(shallow.places(), shallow.memory.cells, strict=True) if cell.is_sounded]
    assert sounded == [pytest.approx((shallow.x_m, 0.0), abs=0.4)]
    assert max(x_m for x_m, y_m in shallow.places() if abs(y_m) < 0.3) > shallow.x_m + 0.4, "and the way on is closed"
    assert deep.memory.cells == ()


@pytest.mark.parametrize("set_back_s", [0, 5, 3600])
def test_shallow_places_go_on_by_the_map_where_dead_reckoning_begins_anew(set_back_s: int) -> None:
    survey = Survey()
    survey.now_us += 7200 * 10**6
    survey.sail(10, level(0.4))
    survey.map_off_m = 3.0
    survey.sail(10, level(0.4))
    before = survey.places()
    survey.epoch += 1
    survey.now_us -= set_back_s * 10**6
    survey.sail(1, level(2.0))
    assert len(before) == len(survey.places()) > 2
    for (old_m, _), (new_m, _) in zip(before, survey.places(), strict=True):
        assert new_m - old_m == pytest.approx(3.0, abs=0.5 * SHALLOW_CELL_M + 1e-9)


def test_without_a_sonar_and_with_soundings_off_nothing_is_remembered() -> None:
    assert Survey().take(None) == SoundingMemory()
    off = Survey(replace(PLANNER, min_depth_m=0.0))
    assert off.sail(20, level(0.3)) == SoundingMemory()
