"""A whole drive scored: what is counted as what, on a course whose every clearance is known by hand."""

import dataclasses
import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import load_config
from paani.thrust_adapter import AppliedThrust
from paani_sim.plant.plant import Touch
from paani_sim.trials.drive import Drive
from paani_sim.trials.drive_history import DriveHistory, DriveSample, StopInterval
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.hull_clearance import BANK, MAX_CLEARANCE_M, HullPath, compute_clearances_m, was_visible
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import SHOAL, Closeness, Contact, TrialResult
from paani_sim.trials.scoring import find_encounters, score_drive
from paani_sim.vessels import load_vessel
from paani_sim.worlds import Kind, Obstacle, Pose2, World
from paani_sim.worlds.world import Shoal

VESSEL = load_vessel("paper")
HALF_WIDTH_M = 0.5 * VESSEL.hull.spacing_m + VESSEL.hull.radius_m
BUOY = Obstacle("buoy", Kind.BUOY, "can", Pose2(0.0, 3.0, 0.0), 1.0, 1.0, 1.0)
PIER = Obstacle("pier", Kind.OTHER, "pier", Pose2(30.0, 3.0, 0.0), 1.0, 2.0, 1.0)
POND = World(
    name="pond",
    seed=1,
    origin_lat_deg=50.0,
    origin_lon_deg=8.0,
    shore_m=np.array([[-50.0, -20.0], [90.0, -20.0], [90.0, 20.0], [-50.0, 20.0]]),
    route_m=np.array([[-40.0, 0.0], [40.0, 0.0]]),
    start=Pose2(-40.0, 0.0, 0.0),
    obstacles=(BUOY, PIER),
    actors=(),
    route_closed=False,
    shoals=(Shoal(80.0, 0.0, 3.0, 0.05),),
)
BUOY_GAP_M, PIER_GAP_M, BANK_GAP_M = 0.3, 0.2, 0.1
LEGS_Y_M = (
    3.0 - 0.5 - HALF_WIDTH_M - BUOY_GAP_M,
    3.0 - 1.0 - HALF_WIDTH_M - PIER_GAP_M,
    -20.0 + HALF_WIDTH_M + BANK_GAP_M,
)
LEG_X_M = np.linspace(-9.0, 9.0, 181)
PIER_AT_S, SHOAL_AT_S, BANK_AT_S = 0.1 * (181 + 90), 0.1 * (181 + 175), 0.1 * (2 * 181 + 90)


def drive_past(*touches: Touch) -> TrialResult:
    """Close by the buoy, the pier and the bank, one after the other, slowing down."""
    places = [(x_m + 30.0 * (leg == 1), y_m) for leg, y_m in enumerate(LEGS_Y_M) for x_m in LEG_X_M.tolist()]
    history = DriveHistory()
    history.samples = [
        DriveSample(
            t_s=0.1 * k, x_m=x_m, y_m=y_m, yaw_rad=0.0, surge_mps=1.0 - 0.001 * k, cross_track_m=3.0 if k % 2 else -4.0,
            left_n=1.0, right_n=1.0, collisions=0, in_contact=False, actors_along_m=(),
        )
        for k, (x_m, y_m) in enumerate(places)
    ]  # fmt: skip
    history.stops = [StopInterval(50.0, "NO_SAFE_SIDE")]
    drive = SimpleNamespace(
        scenario=SimpleNamespace(world=POND, name="pond", seed=1, faults=()),
        config=load_config(),
        history=history,
        plant=SimpleNamespace(
            vessel=VESSEL, touches=touches, distance_m=60.0, energy_j=500.0, state_hash=lambda: "hash"
        ),
        progress=SimpleNamespace(best_progress_m=54.0),
        outcome=DriveOutcome.COMPLETED,
        error="",
        goal_m=54.0,
        elapsed_s=54.3,
        time_limit_s=200.0,
        frames=100,
    )
    return score_drive(cast(Drive, drive), Policy.BLIND)


def test_near_misses_of_things_and_of_banks_are_counted_apart() -> None:
    found = drive_past()
    assert (found.collisions, found.near_misses, found.near_misses_bank) == (0, 2, 1)
    assert (found.min_clearance_m, found.min_bank_clearance_m) == (PIER_GAP_M, BANK_GAP_M)
    assert [(each.what, each.clearance_m) for each in found.encounters] == [
        ("buoy", BUOY_GAP_M), ("pier", PIER_GAP_M), ("bank", BANK_GAP_M)
    ]  # fmt: skip
    assert (found.off_route_rms_m, found.off_route_max_m) == pytest.approx((12.5**0.5, 4.0), abs=0.01)
    assert (found.distance_m, found.progress_m, found.stops[0].seconds) == (60.0, 54.0, 4.2)


def test_what_is_touched_is_no_near_miss_and_has_no_clearance() -> None:
    found = drive_past(
        Touch("pier", PIER_AT_S, PIER_AT_S),
        Touch("shoal_0", SHOAL_AT_S, SHOAL_AT_S),
        Touch("bank_3", BANK_AT_S, BANK_AT_S),
    )
    assert (found.near_misses, found.near_misses_bank) == (1, 0)
    assert (found.collisions, found.collisions_bank) == (3, 1)
    touched = {each.what: each.clearance_m for each in found.encounters if each.closeness is Closeness.CONTACT}
    assert touched == {"pier": 0.0, "bank": 0.0}
    assert [(each.what, each.kind) for each in found.contacts] == [
        ("pier", "other"), ("shoal_0", SHOAL), ("bank", "bank")
    ]  # fmt: skip
    speeds_mps = [each.speed_mps for each in found.contacts]
    assert speeds_mps == pytest.approx([1.0 - 0.269, 1.0 - 0.354, 1.0 - 0.450], abs=1e-6)


def test_a_camera_sees_no_ground_under_water_and_what_it_saw_four_seconds_before() -> None:
    """The pier is abaft as it is touched, and was ahead before."""
    abaft_s = PIER_AT_S + 2.5
    found = drive_past(Touch("pier", abaft_s, abaft_s), Touch("shoal_0", SHOAL_AT_S, SHOAL_AT_S))
    assert [each.visible for each in found.contacts] == [True, False]
    assert (found.collisions_visible, found.collisions_bank) == (1, 0)


@given(st.floats(-40.0, 80.0), st.floats(-18.0, 18.0), st.floats(-4.0, 4.0))
def test_the_bank_is_as_far_as_the_hull_leaves_room(x_m: float, y_m: float, yaw_rad: float) -> None:
    """Of a straight wall: the distance of the middle, less how far a rounded rectangle reaches towards it."""
    hull = VESSEL.hull
    ahead_m, aside_m = 0.5 * hull.length_m - hull.radius_m, 0.5 * hull.spacing_m
    cos, sin = abs(math.cos(yaw_rad)), abs(math.sin(yaw_rad))
    across_m = 20.0 - abs(y_m) - (sin * ahead_m + cos * aside_m + hull.radius_m)
    along_m = min(x_m + 50.0, 90.0 - x_m) - (cos * ahead_m + sin * aside_m + hull.radius_m)
    path = HullPath(hull, np.array([x_m]), np.array([y_m]), np.array([yaw_rad]), np.zeros((1, 0)))
    found = compute_clearances_m(POND, path)[BANK][0]
    assert found == pytest.approx(min(max(min(across_m, along_m), 0.0), MAX_CLEARANCE_M), abs=1e-9)


@pytest.mark.parametrize(("away_samples", "meetings"), [(29, 1), (30, 2)])
def test_a_thing_that_is_out_of_range_for_three_seconds_is_met_again(away_samples: int, meetings: int) -> None:
    """And is touched where the drive ends between two samples."""
    gaps_m = np.array([4.0] * 10 + [5.5] * away_samples + [4.5] * 10)
    samples = [
        DriveSample(0.1 * k, 0.0, 0.0, 0.0, 0.5, 0.0, 1.0, 1.0, 0, in_contact=False, actors_along_m=())
        for k in range(len(gaps_m))
    ]
    end_s = samples[-1].t_s + 0.07
    touch = Contact(what="buoy", kind="buoy", at_s=end_s, x_m=0.0, y_m=0.0, speed_mps=0.5, visible=True)
    found = find_encounters(POND, samples, {"buoy": gaps_m}, (touch,))
    assert len(found) == meetings
    assert [each.closeness for each in found][-1] is Closeness.CONTACT


def test_what_stands_behind_a_thing_does_not_hide_it() -> None:
    behind = dataclasses.replace(PIER, id="behind", pose=Pose2(31.5, 3.0, 0.0), width_m=6.0)
    before = dataclasses.replace(behind, id="before", pose=Pose2(28.5, 3.0, 0.0))
    path = HullPath(VESSEL.hull, np.array([22.0]), np.array([3.0]), np.array([0.0]), np.zeros((1, 0)))
    for other, is_seen in ((behind, True), (before, False)):
        world = dataclasses.replace(POND, obstacles=(PIER, other))
        assert was_visible(world, "pier", path, 0.6, 15.0, 0.3) is is_seen


def test_a_stop_for_another_reason_ends_the_one_before() -> None:
    history = DriveHistory()
    order = m.NavCommand(source_us=1, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.ADVISED_STOP,))
    for t_s, reason in ((1.0, m.Reason.NO_SAFE_SIDE), (3.0, m.Reason.STALE_EVIDENCE), (4.0, m.Reason.STALE_EVIDENCE)):
        history.record_order(t_s, order, m.Advisory(source_us=1, direction=m.Direction.STOP, reason=reason))
    assert history.stops == [StopInterval(1.0, "NO_SAFE_SIDE", 3.0), StopInterval(3.0, "STALE_EVIDENCE")]


def test_a_thrust_by_a_newer_picture_is_a_change_and_the_same_one_again_is_none() -> None:
    history = DriveHistory()
    on, off = (AppliedThrust(0.1, 0.1, force_n, force_n, m.ZeroCause.NONE) for force_n in (1.0, 0.0))
    first, second = (m.Thrust(source_us=at_us, enabled=True, left=0.1, right=0.1) for at_us in (10, 20))
    for now_us, applied, order in (
        (1, off, None), (2, on, first), (3, on, first), (4, on, second), (5, off, second), (6, on, second)
    ):  # fmt: skip
        history.record_thrust(applied, order, now_us)
    assert [each.at_us for each in history.thrust_changes] == [2, 4, 5, 6]
