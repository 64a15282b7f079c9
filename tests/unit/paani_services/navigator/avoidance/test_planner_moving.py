"""What moves: its velocity from where boxes stood, and ways that keep clear of where it will be."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.messages import Detection, Label
from paani_services.navigator.avoidance.clearance import UNSEEN_GROWTH_MPS, predicted_clearance_m
from paani_services.navigator.avoidance.planner import Plan, plan_motion
from paani_services.navigator.avoidance.replanning import PlannerState, replan
from paani_services.navigator.avoidance.rollout import (
    BoatState,
    GuidanceSetpoint,
    Trajectories,
    roll_out,
    roll_out_coasting,
)
from paani_services.navigator.mapping.dynamic_obstacles import (
    DynamicObstacle,
    find_dynamic_obstacles,
    is_refuted,
)
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose, project
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    EYE,
    PLANNER,
    START_US,
    detection_of,
    observe_from,
    odometry,
    standing_gaps_m,
    water_edge_of,
)

PERIOD_S = 0.2
CRUISING, RESTING = BoatState(0.0, 0.0, 0.0, 0.6), BoatState(0.0, 0.0, 0.0)
AHEAD = GuidanceSetpoint(0.0, 0.6)


def box_of(boat: BoatPose, x_m: float, y_m: float, rng: np.random.Generator, jitter_px: float) -> Detection | None:
    """A swimmer's box, 1.1 m wide; its sides jitter. None where it is not all in the picture."""
    across = np.array([-math.sin(boat.yaw_rad), math.cos(boat.yaw_rad)])
    ends = np.array([[x_m, y_m] - 0.5 * across, [x_m, y_m] + 0.5 * across])
    corners = np.vstack([np.column_stack([ends, [0.0, 0.0]]), np.column_stack([ends, [0.4, 0.4]])])
    pixels = project(corners, boat, EYE) + rng.normal(0.0, jitter_px, (4, 2))
    (x1, y1), (x2, y2) = pixels.min(axis=0) / (320, 240), pixels.max(axis=0) / (320, 240)
    if x1 < 0.0 or y1 < 0.0 or x2 > 1.0 or y2 > 1.0:
        return None
    return Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(float(x1), float(y1), float(x2), float(y2)))


def watched(
    place_m: tuple[float, float],
    velocity_mps: tuple[float, float],
    *,
    seconds: float = 3.0,
    surge_mps: float = 0.5,
    yaw_radps: float = 0.0,
    jitter_px: float = 0.7,
    mistaken: float = 0.0,
    seed: int = 0,
) -> tuple[ObservationMemory, int, BoatPose]:
    """What a moving, turning boat remembers of a swimmer who is at `place_m` when the boat comes to (0, 0)."""
    rng = np.random.default_rng(seed)
    memory, at_us, boat = ObservationMemory(), START_US, BoatPose(0.0, 0.0, 0.0)
    for k in range(round(seconds / PERIOD_S), -1, -1):
        t_s = -k * PERIOD_S
        boat = BoatPose(surge_mps * t_s, 0.0, yaw_radps * t_s)
        at_us = START_US + round((seconds + t_s) * 1e6)
        found = box_of(boat, place_m[0] + velocity_mps[0] * t_s, place_m[1] + velocity_mps[1] * t_s, rng, jitter_px)
        if found and rng.random() < mistaken:  # a reflection taken in
            x1, y1, x2, y2 = found.box_xyxy
            found = msgspec.structs.replace(found, box_xyxy=(x1, y1, x2, min(1.0, y2 + 0.25 * (y2 - y1))))
        memory = observe_from(boat, at_us=at_us, memory=memory, detections=(found,) if found else ())
    return memory, at_us, boat


def moving(memory: ObservationMemory, at_us: int) -> tuple[DynamicObstacle, ...]:
    """What moves for certain, without the people who may."""
    return tuple(each for each in find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER) if each.is_moving)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    x_m=st.floats(3.5, 6.5),
    side=st.floats(-0.3, 0.3),
    speed=st.floats(0.25, 0.4),
    toward=st.floats(-3.1, 3.1),
    surge=st.floats(0.0, 0.6),
    yaw=st.floats(-0.1, 0.1),
    seed=st.integers(0, 1000),
)
def test_a_swimmer_s_velocity_is_known_within_its_deviation(
    x_m: float, side: float, speed: float, toward: float, surge: float, yaw: float, seed: int
) -> None:
    """From a boat that moves and turns, boxes that jitter: right to three deviations, or not said to move."""
    velocity = (speed * math.cos(toward), speed * math.sin(toward))
    memory, at_us, _ = watched((x_m, side * x_m), velocity, surge_mps=surge, yaw_radps=yaw, seed=seed)
    for obstacle in moving(memory, at_us):
        off = math.hypot(obstacle.velocity.east_mps - velocity[0], obstacle.velocity.north_mps - velocity[1])
        assert off <= 3.5 * obstacle.velocity.deviation_mps + 0.05
        assert obstacle.velocity.deviation_mps < 0.3


@pytest.mark.parametrize("velocity", [(0.0, 0.35), (0.0, -0.35), (-0.35, 0.0), (-0.25, 0.25)])
@pytest.mark.parametrize("yaw", [-0.1, 0.0, 0.1])
def test_a_swimmer_5_m_ahead_is_seen_to_move(velocity: tuple[float, float], yaw: float) -> None:
    memory, at_us, _ = watched((5.0, 0.0), velocity, yaw_radps=yaw)
    (obstacle,) = moving(memory, at_us)
    assert obstacle.velocity[:2] == pytest.approx(velocity, abs=0.13)
    assert math.hypot(obstacle.east_m.mean() - 5.0, obstacle.north_m.mean()) < 0.4


@pytest.mark.slow
def test_what_stands_is_hardly_ever_seen_to_move() -> None:
    """From a boat that moves and turns, and boxes whose every side jitters by a pixel: one in a hundred at most."""
    rng, said = np.random.default_rng(0), 0
    for seed in range(200):
        x_m, side, surge, yaw = rng.uniform((3.0, -0.3, 0.0, -0.2), (12.0, 0.3, 0.6, 0.2)).tolist()
        watching = {"surge_mps": surge, "yaw_radps": yaw, "seed": seed, "jitter_px": 1.0}
        memory, at_us, _ = watched((x_m, side * x_m), (0.0, 0.0), **watching)
        said += len(moving(memory, at_us))
    assert said <= 2


@pytest.mark.slow
def test_reflections_taken_in_move_nothing() -> None:
    """One box in seven reaches a quarter lower: at most one standing swimmer in a hundred is taken for a moving one."""
    said = 0
    for seed in range(100):
        memory, at_us, _ = watched((3.5 + 0.05 * seed, 0.0), (0.0, 0.0), mistaken=0.15, seed=seed)
        said += len(moving(memory, at_us))
    assert said <= 1


def test_a_person_may_swim_until_they_are_seen_to_stand() -> None:
    """From two pictures anybody may swim at ease, any way; the longer they are seen in one place the less."""
    fastest = []
    memory, at_us, _ = watched((4.0, 0.0), (0.0, 0.0), seconds=0.0, surge_mps=0.0)
    assert find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER) == ()  # once is nobody
    for seconds in (0.2, 1.0, 2.0, 3.0):
        memory, at_us, _ = watched((4.0, 0.0), (0.0, 0.0), seconds=seconds, surge_mps=0.0)
        (obstacle,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
        assert obstacle.velocity[:2] == (0.0, 0.0)
        assert obstacle.vacated_boxes == frozenset()  # and they are where they are seen
        fastest.append(obstacle.velocity.deviation_mps)
    assert fastest[0] == PLANNER.person_mps
    assert fastest == sorted(fastest, reverse=True)
    assert fastest[-1] < 0.15
    assert (
        find_dynamic_obstacles(memory.observations, at_us + round(PLANNER.occupied_s * 1e6) + 1, CAMERA, PLANNER) == ()
    )


def test_a_person_cut_by_the_picture_s_side_is_seen_to_stand_too() -> None:
    """One who has come to rest at the rim of the picture does not hold a boat up for ever."""
    memory, at_us = ObservationMemory(), START_US
    cut = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(0.0, 0.55, 0.1, 0.65))
    for _ in range(16):
        at_us += 200_000
        memory = observe_from(at_us=at_us, memory=memory, detections=(cut,))
    (obstacle,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert obstacle.velocity.deviation_mps < 0.15


@pytest.mark.parametrize(("looking", "denied"), [(AT_REST, True), (BoatPose(0.0, 0.0, -1.5), False)])
def test_what_is_not_where_it_should_be_by_now_did_not_go_on(looking: BoatPose, denied: bool) -> None:
    """Expected in the middle of pictures that show water there, it is denied after a second; out of them it is not."""
    memory, at_us, _ = watched((5.0, -1.5), (0.0, 0.35), surge_mps=0.0)
    found = []
    for _ in range(20):
        at_us += 200_000
        memory = observe_from(looking, at_us=at_us, memory=memory)
        (obstacle,) = moving(memory, at_us)
        grid = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER, obstacle.vacated_boxes)
        found.append(is_refuted(obstacle, grid))
    assert not any(found[:4])
    assert found[-1] is denied


def test_what_left_the_picture_goes_on_and_is_where_it_was_last_seen() -> None:
    """Turned away from it, the boat expects it where it is by now, less surely, and keeps off where it was last."""
    memory, at_us, _ = watched((5.0, 1.0), (0.0, 0.35), surge_mps=0.0)
    away = BoatPose(0.0, 0.0, -1.5)
    for _ in range(20):
        at_us += 200_000
        memory = observe_from(away, at_us=at_us, memory=memory)
    (obstacle,) = moving(memory, at_us)
    assert obstacle.age_s == pytest.approx(4.0, abs=0.3)
    assert (obstacle.east_m.mean(), obstacle.north_m.mean()) == pytest.approx((5.0, 2.4), abs=0.6)
    now, later = (
        predicted_clearance_m(each, np.zeros(1), np.zeros(1), np.zeros(1))
        for each in (obstacle._replace(age_s=0.0), obstacle)
    )
    assert later[0] < now[0]
    before, after = (
        build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER, of).occupied
        for of in (frozenset(), obstacle.vacated_boxes)
    )
    assert 0 < after.sum() < before.sum()
    assert not (after & ~before).any()


def test_what_is_cut_by_the_picture_s_side_stays_occupied() -> None:
    """It moved when it was last seen whole; what a picture shows of it since is there, however long that lasts."""
    memory, at_us, boat = watched((4.5, 1.6), (0.0, 0.35), surge_mps=0.0)
    whole = memory.observations[-1].boxes[-1]
    wide, top, low = ((each / 512) for each in (whole.right - whole.left, whole.top, whole.bottom))
    cut = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(0.0, top, wide, low))
    for k in range(1, 51):
        at_us += 200_000
        memory = observe_from(boat, at_us=at_us, memory=memory, detections=(cut,))
        found = moving(memory, at_us)
        grid = build_occupancy_grid(
            memory.observations,
            (0.0, 0.0),
            at_us,
            CAMERA,
            PLANNER,
            frozenset().union(*(each.vacated_boxes for each in found)),
        )
        assert grid.occupied.any(), k


def test_only_the_trail_of_what_moves_is_freed() -> None:
    """A bar beside the swimmer and a bank behind stay as occupied as they were, cell by cell."""
    memory, at_us = ObservationMemory(), START_US
    rng, boat = np.random.default_rng(1), BoatPose(0.0, 0.0, 0.0)
    edge = water_edge_of(boat, ((4.0, -2.2, 5.0, -1.2),), 7.0)
    for k in range(16):
        at_us = START_US + 200_000 * k
        found = box_of(boat, 5.0, 0.2 + 0.07 * k, rng, 0.5)
        memory = observe_from(boat, edge, at_us, memory, detections=(found,) if found else ())
    (obstacle,) = moving(memory, at_us)
    before = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER)
    after = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER, obstacle.vacated_boxes)
    assert not (after.occupied & ~before.occupied).any()
    rows, columns = np.nonzero(before.occupied & ~after.occupied)
    x_m, y_m = before.west_m + 0.2 * (columns + 0.5), before.south_m + 0.2 * (rows + 0.5)
    assert len(rows)
    assert (abs(x_m - 5.0) < 2.0).all()  # `person_room_m` before and behind
    assert (y_m > -1.8).all()
    assert (y_m < 3.5).all()


def open_water() -> OccupancyGrid:
    return build_occupancy_grid(observe_from().observations, (0.0, 0.0), START_US, CAMERA, PLANNER)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_waits_for_who_crosses_and_goes_on_behind_them(side: float) -> None:
    """On open water and under way: it waits, or brakes and looks round, and lets a swimmer pass."""
    grid = open_water()
    found = [
        plan_motion(grid, CRUISING, AHEAD, None, PLANNER, (swimmer(3.0, side * y_m, 0.0, side * 0.35),))
        for y_m in (-2.0, -1.0, 0.0, 0.5, 1.5)
    ]
    assert [each.speed_mps for each in found] == [0.06, 0.0, 0.06, 0.3, 0.3]
    assert all(side * each.heading_rad < 0.2 for each in found[3:])


def test_patience_with_who_may_swim_but_does_not_ends() -> None:
    """Who treads water in the way, or is taken for a person, is passed as what stands in the end."""
    grid = open_water()
    person = DynamicObstacle(np.array([2.8]), np.array([0.5]), 0.5, Velocity(0.0, 0.0, 0.2), 0.1, frozenset())
    found = [plan_motion(grid, RESTING, AHEAD, None, PLANNER, (person,), may_wait=patient) for patient in (True, False)]
    assert [each.speed_mps > 0.0 for each in found] == [False, True]
    crossing = swimmer(3.0, -1.0, 0.0, 0.35)
    assert plan_motion(grid, CRUISING, AHEAD, None, PLANNER, (crossing,), may_wait=False).speed_mps <= 0.3


def test_a_boat_waits_no_longer_than_its_patience() -> None:
    """Seen twice, a person 3.6 m ahead may swim anywhere: the boat waits, unless it has for `patience_s`."""
    place = (3.6, 0.3, 4.0, 0.9)
    memory, now_us = ObservationMemory(), START_US
    for now_us in (START_US, START_US + 200_000):
        memory = observe_from(
            edge=water_edge_of(AT_REST, (place,)), at_us=now_us, memory=memory, detections=(detection_of(place, 0.4),)
        )
    here = odometry(now_us, AT_REST)
    for waited_s, moves in ((None, False), (PLANNER.patience_s - 1.0, False), (PLANNER.patience_s + 1.0, True)):
        waiting_since_us = None if waited_s is None else now_us - round(waited_s * 1e6)
        state, found = replan(
            PlannerState(memory, waiting_since_us=waiting_since_us), here, AHEAD, now_us, CAMERA, PLANNER
        )
        assert (found.speed_mps > 0.0) is moves
        assert state.waiting_since_us == (None if moves else now_us if waiting_since_us is None else waiting_since_us)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_boat_at_rest_goes_out_of_the_way_of_what_drifts_onto_it(side: float) -> None:
    """A kayak 2 m wide comes at 0.13 m/s and will be there in 20 s: it turns away while there is room to turn."""
    grid = open_water()
    outline = (np.full(9, 3.8), side * 0.3 + np.linspace(-1.0, 1.0, 9))
    kayak = DynamicObstacle(*outline, 0.2, Velocity(-0.13, 0.0, 0.03), 0.1, frozenset())
    found = plan_motion(grid, RESTING, AHEAD, None, PLANNER, (kayak,))
    assert found.speed_mps > 0.0
    assert found.heading_rad * side < -0.8


def test_who_was_seen_long_ago_may_be_further_off_their_course() -> None:
    now, later = (
        predicted_clearance_m(swimmer(4.0, 0.0, 0.0, 0.0, age_s), np.zeros(1), np.zeros(1), np.zeros(1))[0]
        for age_s in (0.0, 12.0)
    )
    assert now - later == pytest.approx(12.0 * (UNSEEN_GROWTH_MPS + 0.05))


def swimmer(x_m: float, y_m: float, east_mps: float, north_mps: float, age_s: float = 0.1) -> DynamicObstacle:
    return DynamicObstacle(
        np.array([x_m]), np.array([y_m]), 0.5, Velocity(east_mps, north_mps, 0.05), age_s, frozenset()
    )


def least_gap_m(found: Plan, start: BoatState, obstacle: DynamicObstacle) -> float:
    """Between the boat's middle and a thing that moves on, over six seconds of the plan, or at rest."""
    time_s = np.arange(0.0, 6.0, 0.1)
    if found.speed_mps > 0.0:
        trajectories = roll_out(start, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
        x_m, y_m = (np.interp(time_s, trajectories.time_s, axis[:, 0]) for axis in (trajectories.x_m, trajectories.y_m))
    else:
        x_m, y_m = np.full_like(time_s, start.x_m), np.full_like(time_s, start.y_m)
    easts, norths = (
        obstacle.east_m[0] + time_s * obstacle.velocity.east_mps,
        obstacle.north_m[0] + time_s * obstacle.velocity.north_mps,
    )
    return float(np.hypot(x_m - easts, y_m - norths).min())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_crosser_is_passed_astern(side: float) -> None:
    """From `side` across the bow: standing it would be passed on the other side, moving it is passed behind."""
    crossing = swimmer(4.5, side * 1.5, 0.0, -side * 0.35)
    found = plan_motion(open_water(), CRUISING, AHEAD, None, PLANNER, (crossing,))
    assert found.speed_mps > 0.0
    assert found.heading_rad * side > 0.05
    standing = swimmer(4.5, side * 0.3, 0.0, 0.0)
    assert plan_motion(open_water(), CRUISING, AHEAD, None, PLANNER, (standing,)).heading_rad * side < 0.0


def test_what_is_gone_by_then_turns_nobody() -> None:
    """It crosses the course, but is past before the boat comes."""
    gone = swimmer(5.5, 0.6, 0.0, 0.6)
    assert plan_motion(open_water(), CRUISING, AHEAD, None, PLANNER, (gone,)) == Plan(0.0, 0.6)


def test_head_on_the_boat_turns_or_stops() -> None:
    for ahead_m in (3.0, 4.0, 5.0):
        oncoming = swimmer(ahead_m, 0.0, -0.4, 0.0)
        found = plan_motion(open_water(), CRUISING, AHEAD, None, PLANNER, (oncoming,))
        assert found.speed_mps == 0.0 or abs(found.heading_rad) > 0.1
        straight = least_gap_m(Plan(0.0, 0.6), CRUISING, oncoming)
        assert least_gap_m(found, CRUISING, oncoming) > straight + 0.3


def test_a_boat_at_rest_gets_out_of_the_way() -> None:
    """Somebody comes from the side: a way that comes no nearer than waiting is taken."""
    coming = swimmer(0.3, 2.2, 0.0, -0.4)
    found = plan_motion(open_water(), RESTING, AHEAD, None, PLANNER, (coming,))
    assert found.speed_mps > 0.0
    assert least_gap_m(found, RESTING, coming) > least_gap_m(Plan(0.0, 0.0), RESTING, coming) + 0.3


def test_what_was_not_seen_for_long_counts_no_more() -> None:
    crossing = swimmer(3.0, 0.3, 0.0, -0.1, PLANNER.unseen_s + 0.1)
    assert plan_motion(open_water(), CRUISING, AHEAD, None, PLANNER, (crossing,)) == Plan(0.0, 0.6)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    bar=st.tuples(st.floats(1.5, 7.0), st.floats(-3.0, 3.0), st.floats(0.3, 2.0), st.floats(0.3, 2.0)),
    bank_m=st.floats(1.5, 9.0),
    place=st.tuples(st.floats(1.0, 6.0), st.floats(-3.0, 3.0)),
    velocity=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)),
    surge=st.floats(0.0, 0.6),
)
def test_who_moves_opens_no_way_but_one_wider_than_coasting(
    bar: tuple[float, float, float, float],
    bank_m: float,
    place: tuple[float, float],
    velocity: tuple[float, float],
    surge: float,
) -> None:
    """On one grid the boat moves with movers where it moves without, and comes no nearer than at rest; or else where
    that keeps further off everything than coasting on would."""
    x, y, deep, wide = bar
    memory = observe_from(edge=water_edge_of(BoatPose(0.0, 0.0, 0.0), ((x, y, x + deep, y + wide),), bank_m))
    grid, start = (
        build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, PLANNER),
        BoatState(0.0, 0.0, 0.0, surge),
    )
    obstacle = swimmer(*place, *velocity)
    found = plan_motion(grid, start, AHEAD, None, PLANNER, (obstacle,))
    if found.speed_mps == 0.0:
        return
    trajectories = roll_out(start, np.array([found.heading_rad]), np.array([found.speed_mps]), PLANNER)
    soon = trajectories.time_s <= PLANNER.horizon_s
    time_s = trajectories.time_s[soon, None]
    gap_m = predicted_clearance_m(obstacle, trajectories.x_m[soon], trajectories.y_m[soon], time_s)[:, 0]
    rest_m = np.minimum.accumulate(
        predicted_clearance_m(obstacle, np.zeros_like(time_s), np.zeros_like(time_s), time_s)[:, 0]
    )
    keeps = (gap_m >= np.minimum(1.0, np.maximum(rest_m - 0.1, 0.0)) - 1e-9).all()
    if not keeps or plan_motion(grid, start, AHEAD, None, PLANNER).speed_mps == 0.0:
        assert least_m(grid, obstacle, trajectories) > least_m(
            grid, obstacle, roll_out_coasting(start, trajectories.time_s, PLANNER)
        )


def least_m(grid: OccupancyGrid, obstacle: DynamicObstacle, trajectories: Trajectories) -> float:
    """To what stands, within the 2 m that the planner knows, and to what moves, within its horizon."""
    soon = trajectories.time_s <= PLANNER.horizon_s + 1e-9
    standing = standing_gaps_m(grid, trajectories)[soon].min(initial=2.0)
    return float(
        min(
            standing,
            predicted_clearance_m(
                obstacle, trajectories.x_m[soon], trajectories.y_m[soon], trajectories.time_s[soon, None]
            ).min(),
        )
    )


def test_movers_repeat_bit_by_bit() -> None:
    memory, at_us, _ = watched((5.0, 0.5), (0.1, -0.3))
    again = msgspec.json.decode(msgspec.json.encode(memory), type=ObservationMemory)
    first, second = (moving(each, at_us) for each in (memory, again))
    assert first[0].velocity == second[0].velocity
    assert (first[0].east_m == second[0].east_m).all()
