"""Clearances, sight, encounters, stops and reactions on hand-made tracks; intervals against known values."""

import dataclasses
import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import load_config
from paani_sim.plant.plant import Touch
from paani_sim.trials.drive_history import DriveHistory, DriveSample, StopInterval, ThrustChange
from paani_sim.trials.fault_reactions import measure_reactions
from paani_sim.trials.hull_clearance import (
    BANK,
    MAX_CLEARANCE_M,
    HullPath,
    compute_actor_poses,
    compute_clearances_m,
    was_visible,
)
from paani_sim.trials.intervals import poisson_interval, wilson_interval
from paani_sim.trials.lockstep_bus import START_US
from paani_sim.trials.result import Closeness, Contact
from paani_sim.trials.route_progress import RouteProgress
from paani_sim.trials.scoring import (
    CONTACT_GAP_S,
    build_hull_path,
    classify_closeness,
    find_contacts,
    find_encounters,
    summarise_latency,
    summarise_stops,
)
from paani_sim.vessels import load_vessel
from paani_sim.worlds import Actor, Fault, FaultKind, Kind, Obstacle, Pose2, World, actor_pose_along

HULL = load_vessel("paper").hull
HALF_LENGTH_M, HALF_WIDTH_M = 0.5 * HULL.length_m, 0.5 * HULL.spacing_m + HULL.radius_m
POND = World(
    name="pond",
    seed=1,
    origin_lat_deg=50.0,
    origin_lon_deg=8.0,
    shore_m=np.array([[-50.0, -20.0], [50.0, -20.0], [50.0, 20.0], [-50.0, 20.0]]),
    route_m=np.array([[-40.0, 0.0], [40.0, 0.0]]),
    start=Pose2(-40.0, 0.0, 0.0),
    obstacles=(),
    actors=(),
    route_closed=False,
)
BUOY = Obstacle("buoy", Kind.BUOY, "can", Pose2(0.0, 3.0, 0.0), 1.0, 1.0, 1.0)
BARGE = Obstacle("barge", Kind.VESSEL, "barge", Pose2(0.0, -5.0, 0.0), 8.0, 2.0, 1.0)
SWIMMER = Actor("swimmer", Kind.PERSON, "swimming", np.array([[20.0, -10.0], [20.0, 10.0]]), 0.5, 1.2, 0.6, 0.4)


def samples(
    places: list[tuple[float, float, float]], surge_mps: float = 0.6, along_m: float = 0.0
) -> list[DriveSample]:
    return [
        DriveSample(
            t_s=3.0 + 0.1 * k, x_m=x, y_m=y, yaw_rad=yaw, surge_mps=surge_mps, cross_track_m=y, left_n=1.0, right_n=1.0,
            collisions=0, in_contact=False, actors_along_m=(along_m,),
        )
        for k, (x, y, yaw) in enumerate(places)
    ]  # fmt: skip


def hull_path(world: World, places: list[tuple[float, float, float]], along_m: float = 0.0) -> HullPath:
    history = samples(places, along_m=along_m)
    if not world.actors:
        history = [sample._replace(actors_along_m=()) for sample in history]
    return build_hull_path(world, HULL, history)


def with_things(*things: Obstacle | Actor) -> World:
    return dataclasses.replace(
        POND,
        obstacles=tuple(thing for thing in things if isinstance(thing, Obstacle)),
        actors=tuple(thing for thing in things if isinstance(thing, Actor)),
    )


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(0, 200, 0.0, 0.0188), (8, 10, 0.4902, 0.9433), (98, 100, 0.9300, 0.9945), (5, 5, 0.5655, 1.0), (0, 0, 0.0, 1.0)],
)
def test_wilson_against_known_values(successes: int, trials: int, low: float, high: float) -> None:
    """R. G. Newcombe (1998) and the formula by hand."""
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=1e-4)


@given(trials=st.integers(1, 2000), data=st.data())
def test_wilson_interval_contains_the_share(trials: int, data: st.DataObject) -> None:
    successes = data.draw(st.integers(0, trials))
    low, high = wilson_interval(successes, trials)
    assert 0.0 <= low <= successes / trials <= high <= 1.0


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.025, 5.572), (10, 4.795, 18.390)])
def test_poisson_against_the_exact_interval(count: int, low: float, high: float) -> None:
    """Garwood's, as tables of the chi-squared distribution give it."""
    assert poisson_interval(count) == pytest.approx((low, high), abs=0.03)


@given(st.integers(0, 3000))
def test_poisson_interval_contains_the_count_and_rises_with_it(count: int) -> None:
    low, high = poisson_interval(count)
    assert 0.0 <= low <= count < high
    assert poisson_interval(count + 1) > (low, high)


def test_clearance_is_from_hull_to_footprint() -> None:
    gaps = compute_clearances_m(with_things(BUOY, BARGE), hull_path(POND, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.5 * math.pi)]))
    assert gaps["buoy"] == pytest.approx([3.0 - 0.5 - HALF_WIDTH_M, 3.0 - 0.5 - HALF_LENGTH_M])
    assert gaps["barge"] == pytest.approx([4.0 - HALF_WIDTH_M, 4.0 - HALF_LENGTH_M])
    assert gaps[BANK] == pytest.approx([MAX_CLEARANCE_M, MAX_CLEARANCE_M])


def test_clearance_to_a_bank_and_inside_a_thing() -> None:
    gaps = compute_clearances_m(with_things(BARGE), hull_path(POND, [(0.0, 19.0, 0.0), (1.0, -5.0, 1.0)]))
    assert gaps[BANK][0] == pytest.approx(1.0 - HALF_WIDTH_M)
    assert gaps["barge"][1] == 0.0


def test_a_corner_of_a_bank_counts() -> None:
    """A spit that ends beside the hull, its corners nearer than its edges' ends are long."""
    shore = np.array([[-50.0, -20.0], [0.0, -20.0], [0.2, -1.0], [0.4, -20.0], [50.0, -20.0], [50.0, 20.0], [-50, 20]])
    world = dataclasses.replace(POND, shore_m=shore)
    assert compute_clearances_m(world, hull_path(POND, [(0.2, 0.0, 0.0)]))[BANK][0] == pytest.approx(1.0 - HALF_WIDTH_M)


@given(along_m=st.floats(-15.0, 40.0))
def test_actors_keep_their_heading_beyond_the_end_of_their_path(along_m: float) -> None:
    """A boat that has arrived does not swing round to the east."""
    path_m = np.array([[0.0, 0.0], [0.0, 10.0], [-8.0, 14.0]])
    boat = dataclasses.replace(SWIMMER, closed=False, path_m=path_m, length_m=6.2)
    assert compute_actor_poses(boat, np.array([along_m]))[0] == pytest.approx(actor_pose_along(boat, along_m), abs=1e-9)


@given(along_m=st.floats(-5.0, 60.0))
def test_actors_are_where_the_world_says(along_m: float) -> None:
    x, y, yaw = compute_actor_poses(SWIMMER, np.array([along_m]))[0]
    expected = actor_pose_along(SWIMMER, along_m)
    assert (x, y) == pytest.approx(expected[:2], abs=1e-9)
    if 1.0 < along_m % 20.0 < 19.0:  # at an end the path turns back on itself
        assert yaw == pytest.approx(expected.yaw_rad)


@pytest.mark.parametrize(
    ("places", "what", "seen"),
    [
        ([(-8.0, 0.0, 0.0)], "buoy", True),
        ([(-8.0, 0.0, math.pi)], "buoy", False),  # behind
        ([(-20.0, 0.0, 0.0)], "buoy", False),  # too far
        ([(0.0, -9.0, 0.5 * math.pi)], "buoy", False),  # behind the barge
        ([(0.0, -9.0, 0.5 * math.pi), (-8.0, 0.0, 0.0)], "buoy", True),  # once is enough
        ([(0.0, 15.0, 0.5 * math.pi)], BANK, True),
        ([(0.0, 15.0, 0.0), (0.0, 18.0, 0.0)], BANK, False),  # always beside the boat
    ],
)
def test_visibility_to_the_camera(places: list[tuple[float, float, float]], what: str, seen: bool) -> None:
    world = with_things(BUOY, BARGE)
    assert was_visible(world, what, hull_path(POND, places), math.radians(35.0), 15.0, 0.55) is seen


def test_any_part_of_a_thing_is_seen_and_what_is_lower_than_the_camera_hides_nothing() -> None:
    """Along a hull of 20 m only its middle third is in view; a log before it is looked over."""
    narrowboat = Obstacle("boat", Kind.VESSEL, "narrowboat", Pose2(5.0, 0.0, 0.5 * math.pi), 20.0, 2.0, 1.5)
    log = Obstacle("log", Kind.OTHER, "log", Pose2(2.0, 0.0, 0.5 * math.pi), 6.0, 0.4, 0.25)
    wall = dataclasses.replace(log, id="wall", height_m=2.5)
    at = hull_path(POND, [(0.0, 1.0, 0.0)])
    seen = [
        was_visible(with_things(narrowboat, *between), "boat", at, math.radians(20.0), 15.0, 0.55, 0.9)
        for between in ((), (log,), (wall,))
    ]
    assert seen == [True, True, False]


def test_a_bridge_that_a_hull_can_touch_is_scored() -> None:
    low = dataclasses.replace(BARGE, base_z_m=0.3)
    high = dataclasses.replace(BARGE, id="bridge", base_z_m=2.1)
    assert set(compute_clearances_m(with_things(low, high), hull_path(POND, [(0.0, 0.0, 0.0)]))) == {"barge", BANK}


def contacts(*touches: tuple[str, float, float]) -> list[tuple[str, float, bool]]:
    """Of a boat that drives towards the buoy and, a quarter of a minute later, away from it."""
    places = [(-8.0 + 0.05 * k, 3.0, 0.0) for k in range(600)]
    history = [sample._replace(actors_along_m=()) for sample in samples(places)]
    world = with_things(BUOY, BARGE)
    path = build_hull_path(world, HULL, history)
    found = find_contacts(world, [Touch(*touch) for touch in touches], history, path, load_config().eye)
    return [(each.what, each.at_s, each.visible) for each in found]


def test_touches_that_follow_each_other_within_five_seconds_are_one_contact() -> None:
    starts = [("buoy", 10.0), ("buoy", 14.9), ("buoy", 19.8), ("buoy", 24.9), ("barge", 25.0)]
    touches = [(name, start_s, start_s) for name, start_s in starts]
    assert [each[:2] for each in contacts(*touches)] == [("buoy", 10.0), ("buoy", 24.9), ("barge", 25.0)]


@given(st.lists(st.tuples(st.floats(0.0, 30.0), st.floats(0.1, 20.0), st.integers(0, 3)), max_size=8))
def test_contacts_are_counted_by_the_time_without_a_touch(drawn: list[tuple[float, float, int]]) -> None:
    """However long each touch lasts, whichever piece of the bank it is with, and where touches overlap."""
    touches = sorted((start_s, start_s + length_s, f"bank_{piece}") for start_s, length_s, piece in drawn)
    apart = [
        start_s
        for number, (start_s, _, _) in enumerate(touches)
        if all(start_s - end_s > CONTACT_GAP_S for _, end_s, _ in touches[:number])
    ]
    found = contacts(*((name, start_s, end_s) for start_s, end_s, name in touches))
    assert [each[1] for each in found] == [round(start_s, 2) for start_s in apart]


def test_all_pieces_of_the_bank_are_one_bank() -> None:
    found = contacts(("bank_0", 10.0, 10.0), ("bank_1", 14.0, 14.0), ("bank_0", 30.0, 30.0))
    assert [each[:2] for each in found] == [(BANK, 10.0), (BANK, 30.0)]


def test_a_contact_with_what_was_before_the_camera_is_visible_and_with_what_was_behind_it_is_not() -> None:
    assert [each[2] for each in contacts(("buoy", 10.0, 10.0), ("buoy", 40.0, 40.0))] == [True, False]


def test_encounters_have_one_closest_point_each() -> None:
    """Past the buoy, away, and past it again, a little nearer."""
    there = [(x, 0.0, 0.0) for x in np.arange(-9.0, 9.0, 0.06).tolist()]
    back = [(x, 0.4, math.pi) for x in np.arange(9.0, -9.0, -0.06).tolist()]
    world = with_things(BUOY)
    history = [sample._replace(actors_along_m=()) for sample in samples(there + back)]
    gaps = compute_clearances_m(world, build_hull_path(world, HULL, history))
    found = [each for each in find_encounters(world, history, gaps, ()) if each.what == "buoy"]
    assert [each.clearance_m for each in found] == pytest.approx([2.125, 1.725], abs=0.01)
    assert [each.closeness for each in found] == [Closeness.CLEAR, Closeness.CLEAR]
    touch = Contact(what="buoy", kind="buoy", at_s=found[0].at_s, x_m=0.0, y_m=0.0, speed_mps=0.5, visible=True)
    touched = [each for each in find_encounters(world, history, gaps, (touch,)) if each.what == "buoy"]
    assert [each.closeness for each in touched] == [Closeness.CONTACT, Closeness.CLEAR]


def test_closeness_classes() -> None:
    found = [classify_closeness(gap_m) for gap_m in (0.1, 0.3, 0.59, 0.6, 1.49, 1.5)]
    assert found == [
        Closeness.GRAZING, Closeness.TIGHT, Closeness.TIGHT, Closeness.CLOSE, Closeness.CLOSE, Closeness.CLEAR
    ]  # fmt: skip


def test_stops_by_reason() -> None:
    stops = [
        StopInterval(5.0, "STALE_EVIDENCE", 6.5),
        StopInterval(9.0, "NO_SAFE_SIDE"),
        StopInterval(7.0, "STALE_EVIDENCE", 7.5),
    ]
    assert [(s.reason, s.count, s.seconds) for s in summarise_stops(stops, 20.0)] == [
        ("NO_SAFE_SIDE", 1, 11.0),
        ("STALE_EVIDENCE", 2, 2.0),
    ]


def test_a_boat_that_is_kept_on_station_counts_as_stopped_by_its_advice() -> None:
    history = DriveHistory()
    going = m.NavCommand(source_us=1, enable=True, heading_rad=0.0, speed_mps=0.5)
    keeping = msgspec.structs.replace(going, speed_mps=0.0, vetoes=(m.Inhibit.ADVISED_STOP,), keeps_station=True)
    advisory = m.Advisory(source_us=1, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE)
    for t_s, order in ((1.0, going), (2.0, keeping), (4.0, keeping), (5.0, going)):
        history.record_order(t_s, order, advisory)
    assert history.stops == [StopInterval(2.0, "NO_SAFE_SIDE", 5.0)]


def test_latency_is_of_the_first_thrust_of_each_picture() -> None:
    applied = [
        ThrustChange(1_000_000, True, 0),
        ThrustChange(1_310_000, False, 1_200_000),
        ThrustChange(1_510_000, False, 1_400_000),
        ThrustChange(1_600_000, True, 0),
        ThrustChange(1_650_000, False, 1_400_000),
    ]
    assert summarise_latency(applied) == summarise_latency(applied[:3])
    assert (summarise_latency(applied).p50_s, summarise_latency(applied).samples) == (0.11, 2)
    held = [ThrustChange(1_700_000, True, 1_600_000), ThrustChange(1_900_000, False, 1_600_000)]
    assert summarise_latency(held).max_s == 0.3


def reaction_of(*applied: ThrustChange, frames_unusable: tuple[int, ...] = ()) -> tuple[float | None, bool]:
    history = DriveHistory()
    history.samples = samples([(0.0, 0.0, 0.0)] * 200)
    history.thrust_changes = list(applied)
    history.unusable_frames = [(at_us, m.UnusableCause.BLACK) for at_us in frames_unusable]
    [found] = measure_reactions((Fault(FaultKind.CAMERA_BLACK, 10.0, 5.0),), history, 0.2)
    return found.zero_thrust_s, found.in_time


def at(seconds: float) -> int:
    return START_US + round(seconds * 1e6)


def test_reaction_to_a_black_camera() -> None:
    """Fans off within one frame and half a second, and no sooner on again than the camera sees."""
    go, stop = ThrustChange(at(4.0), False, 1), ThrustChange(at(10.31), True, 0)
    assert reaction_of(go, stop) == (0.31, True)
    assert reaction_of(go, stop, ThrustChange(at(12.0), False, 2)) == (None, False)
    assert reaction_of(go, stop, ThrustChange(at(12.0), False, 2), ThrustChange(at(14.0), True, 0)) == (4.0, False)
    on = ThrustChange(at(10.2), False, 1)  # it lay still for a moment as the camera failed, and was under way again
    assert reaction_of(go, ThrustChange(at(9.9), True, 0), on, ThrustChange(at(10.5), True, 0)) == (0.5, True)
    assert reaction_of(go, stop, ThrustChange(at(16.0), False, 2)) == (0.31, True)
    assert reaction_of(go, ThrustChange(at(10.71), True, 0)) == (0.71, False)
    assert reaction_of(go) == (None, False)
    assert reaction_of(go, ThrustChange(at(9.0), True, 0)) == (0.0, True)


def test_only_faults_while_the_boat_is_armed_are_judged() -> None:
    """It is armed from 3 s to 23 s; with its fans off before, it would have reacted at once."""
    history = DriveHistory()
    history.samples = samples([(0.0, 0.0, 0.0)] * 201)
    faults = [Fault(FaultKind.CAMERA_BLACK, start_s, 5.0) for start_s in (2.9, 3.0, 23.0, 23.1)]
    assert [each.at_s for each in measure_reactions(faults, history, 0.2)] == [3.0, 23.0]


def test_progress_along_an_open_and_a_closed_route() -> None:
    line = RouteProgress(POND.route_m, closed=False, start_m=(-30.0, 0.0))
    for x, y in [(-29.0, 1.0), (-20.0, -2.0), (-25.0, 0.0)]:
        line.update((x, y))
    assert (line.progress_m, line.best_progress_m, line.cross_track_m) == pytest.approx((5.0, 10.0, 0.0))
    square = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]])
    ring = RouteProgress(square, closed=True, start_m=(20.0, 0.0))
    for place in [(39.0, 1.0), (40.0, 20.0), (39.0, 39.0), (20.0, 40.0), (0.0, 38.0), (0.0, 20.0), (1.0, 1.0), (19, 0)]:
        ring.update(place)
    assert ring.best_progress_m == pytest.approx(159.0)


def test_a_route_that_comes_near_itself_is_not_cut_short() -> None:
    hairpin = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 3.0], [0.0, 3.0]])
    progress = RouteProgress(hairpin, closed=False, start_m=(10.0, 0.0))
    progress.update((11.0, 2.9))
    assert progress.progress_m == pytest.approx(1.0)
