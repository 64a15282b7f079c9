"""Geometry of the Imazu cases: everyone meets in one point, and what a lens can see of them."""

import math

import numpy as np
import pytest

from paani_sim.trials.hull_clearance import compute_actor_poses
from paani_sim.worlds import Behaviour, actor_distance_along_m
from paani_sim.worlds.curves import clearance_m
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.imazu import (
    CASES,
    DEPARTURE_S,
    FAIR_PREFIX,
    IMAZU_SCENARIOS,
    PREFIX,
    RUN_M,
    TCPA_S,
    build_imazu_scenario,
    case_codes,
    count_seen,
    relative_start,
)
from paani_sim.worlds.load import load_scenario


@pytest.mark.parametrize("name", IMAZU_SCENARIOS)
def test_everyone_reaches_the_same_point_at_the_same_time(name: str) -> None:
    """DCPA 0 and TCPA 40 s for a boat that keeps course and speed; nobody gives way, and nobody runs aground."""
    scenario = load_scenario(name)
    world = scenario.world
    assert (world.start, len(world.actors)) == ((0.0, 0.0, 0.0), len(case_codes(name)))
    times_s = np.arange(0.0, scenario.task.time_limit_s, 0.1)
    boat_x_m = NOMINAL_BOAT_MPS * (times_s - DEPARTURE_S)
    for actor in world.actors:
        assert actor.behaviour is Behaviour.HOLDS_ON
        poses = compute_actor_poses(actor, np.array([actor_distance_along_m(actor, t_s) for t_s in times_s.tolist()]))
        gaps_m = np.hypot(poses[:, 0] - boat_x_m, poses[:, 1])
        assert gaps_m.min() == pytest.approx(0.0, abs=1e-6)
        assert times_s[gaps_m.argmin()] == pytest.approx(DEPARTURE_S + TCPA_S)
        sailed_m = np.hypot(*np.diff(poses[:300, :2], axis=0).T)
        assert np.ptp(sailed_m) < 1e-6
        assert clearance_m(world.shore_m, poses[::20, :2]).min() > 10.0


@pytest.mark.parametrize(
    ("code", "bearing_deg", "distance"),
    [("H", 0.0, 2.0), ("F", 22.5, 1.848), ("A", 45.0, 1.414), ("a", -45.0, 1.414), ("S", 0.0, 0.3), ("B", 67.5, 0.765),
     ("b", -67.5, 0.765), ("C", 75.0, 0.518), ("D", 82.5, 0.261), ("d", -82.5, 0.261), ("E", 85.0, 0.174),
     ("e", -85.0, 0.174), ("s", -44.4, 0.707)],
)  # fmt: skip
def test_vessels_start_where_the_table_has_them(code: str, bearing_deg: float, distance: float) -> None:
    start = relative_start("imazu-01", code)
    assert start.bearing_deg == pytest.approx(bearing_deg, abs=0.05)
    assert math.hypot(*start) / RUN_M == pytest.approx(distance, abs=0.001)


def cases_seen(prefix: str, hfov_deg: float, *, whole: bool) -> set[str]:
    """Cases of which the lens sees every vessel, or none."""
    sizes = {case: len(case_codes(prefix + case)) if whole else 0 for case in CASES}
    return {case for case, size in sizes.items() if count_seen(prefix + case, hfov_deg) == size}


def test_a_camera_sees_few_of_the_plain_cases_and_all_of_the_fair_ones() -> None:
    assert cases_seen(PREFIX, 102.0, whole=True) == {"01", "02", "03", "05", "08", "08b", "16"}
    assert cases_seen(PREFIX, 102.0, whole=False) == {"04", "06", "12b"}
    assert cases_seen(PREFIX, 70.0, whole=True) == {"01", "03"}
    assert cases_seen(FAIR_PREFIX, 70.0, whole=True) == set(CASES)


def test_forms_differ_in_speed_alone() -> None:
    assert case_codes("imazu-12") == "HBE"
    assert case_codes("imazu-fair-12b") == "BE"
    assert (case_codes("imazu-08"), case_codes("imazu-08b")) == ("HA", "Ha")
    plain, fair = (build_imazu_scenario(prefix + "03").world.actors[0] for prefix in (PREFIX, FAIR_PREFIX))
    assert (plain.speed_mps, fair.speed_mps) == pytest.approx((0.42, 0.258))
