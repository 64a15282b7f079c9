"""Candidates and their simulated trajectories."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from paani_services.navigator.avoidance.rollout import (
    BoatState,
    GuidanceSetpoint,
    roll_out,
    roll_out_coasting,
    sample_candidates,
)
from tests.synthetic_water import PLANNER

RESTING, CRUISING = BoatState(0.0, 0.0, 0.0), BoatState(0.0, 0.0, 0.0, 0.6)


@pytest.mark.parametrize(("span_deg", "count"), [(120.0, 25), (180.0, 36)])
def test_every_heading_around_the_course_is_sampled_once(span_deg: float, count: int) -> None:
    """Headings on the far side of a course abaft the beam are reached by turning the other way round."""
    config = msgspec.structs.replace(PLANNER, span_deg=span_deg)
    for course in (0.0, 1.0, -3.0, math.pi):
        offsets, _ = sample_candidates(RESTING, GuidanceSetpoint(course, 0.6), config)
        assert len(offsets[::3]) == len(set(np.round(offsets % (2.0 * math.pi), 6).tolist())) == count
        off = np.abs((offsets - course + math.pi) % (2.0 * math.pi) - math.pi)
        assert off.max() <= math.radians(span_deg) + 1e-9
        assert np.abs(offsets).max() <= math.pi


def test_sway_continues_while_the_boat_turns() -> None:
    """The present sway goes on in its direction in the map."""
    still, carried = (
        roll_out(BoatState(0.0, 0.0, 0.3, 0.5, 0.0, sway), np.array([0.4]), np.array([0.6]), PLANNER)
        for sway in (0.0, 0.2)
    )
    assert carried.x_m - still.x_m == pytest.approx(-0.2 * math.sin(0.3) * still.time_s[:, None])
    assert carried.y_m - still.y_m == pytest.approx(0.2 * math.cos(0.3) * still.time_s[:, None])
    assert (carried.travelled_m == still.travelled_m).all()


@pytest.mark.parametrize("surge_mps", [-0.02, -0.5])
def test_way_astern_is_not_counted_as_room_ahead(surge_mps: float) -> None:
    """A boat that still goes astern is rolled out as one at rest, which comes farther ahead by any time."""
    astern, resting = (
        roll_out(BoatState(0.0, 0.0, 0.3, way_mps), np.array([0.4]), np.array([0.6]), PLANNER)
        for way_mps in (surge_mps, 0.0)
    )
    assert (astern.travelled_m == resting.travelled_m).all()
    assert (astern.x_m == resting.x_m).all()


def test_a_boat_coasts_as_far_as_its_drag_lets_it() -> None:
    """0.1 m/s of 0.6 may be wind and goes on; the drag of K5 takes the rest within 0.78 m; sway goes on."""
    time_s = np.linspace(0.0, 20.0, 201)
    way = roll_out_coasting(BoatState(1.0, 2.0, math.pi / 2.0, 0.6, 0.0, 0.1), time_s, PLANNER)
    assert way.y_m[:, 0] - 2.0 == pytest.approx(way.travelled_m[:, 0], abs=1e-6)
    assert way.x_m[:, 0] == pytest.approx(1.0 - 0.1 * time_s, abs=1e-6)
    assert way.travelled_m[-1, 0] == pytest.approx(2.0 + 12.4 / 20.0 * math.log(1.0 + 20.0 * 0.5 / 4.0), abs=0.05)
    assert roll_out_coasting(BoatState(0.0, 0.0, 0.0, 0.06), time_s, PLANNER).travelled_m[-1, 0] == pytest.approx(
        0.06 * 20.0
    )
    assert roll_out_coasting(RESTING, time_s, PLANNER).travelled_m.max() == 0.0
