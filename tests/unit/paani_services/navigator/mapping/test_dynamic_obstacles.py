"""Dynamic obstacles: their velocities from where boxes stood, and the cells that they occupy and vacate."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.messages import Detection, Label
from paani_services.navigator.avoidance.clearance import predicted_clearance_m
from paani_services.navigator.mapping.dynamic_obstacles import (
    DynamicObstacle,
    find_dynamic_obstacles,
)
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.occupancy_grid import build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_services.navigator.mapping.water_map import is_refuted
from paani_sim.eye.camera import BoatPose, project
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    EYE,
    PLANNER,
    START_US,
    detection_of,
    observe_from,
    open_water,
    water_edge_of,
)

PERIOD_S = 0.2


def box_of(boat: BoatPose, x_m: float, y_m: float, rng: np.random.Generator, jitter_px: float) -> Detection | None:
    """A swimmer's box, 1.1 m wide, with jittering sides; None where it is not all in the picture."""
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
        if found and rng.random() < mistaken:  # the box includes a reflection
            x1, y1, x2, y2 = found.box_xyxy
            found = msgspec.structs.replace(found, box_xyxy=(x1, y1, x2, min(1.0, y2 + 0.25 * (y2 - y1))))
        memory = observe_from(boat, at_us=at_us, memory=memory, detections=(found,) if found else ())
    return memory, at_us, boat


def moving(memory: ObservationMemory, at_us: int) -> tuple[DynamicObstacle, ...]:
    """The obstacles that move for certain, without the people who may begin to."""
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
    """From a boat that moves and turns, with jittering boxes: right to three deviations, or taken for rest."""
    velocity = (speed * math.cos(toward), speed * math.sin(toward))
    memory, at_us, _ = watched((x_m, side * x_m), velocity, surge_mps=surge, yaw_radps=yaw, seed=seed)
    for obstacle in moving(memory, at_us):
        off = math.hypot(obstacle.velocity.east_mps - velocity[0], obstacle.velocity.north_mps - velocity[1])
        assert off <= 3.5 * obstacle.velocity.deviation_mps + 0.05
        assert obstacle.velocity.deviation_mps < 0.3


@pytest.mark.parametrize("velocity", [(0.0, 0.35), (0.0, -0.35), (-0.35, 0.0), (-0.25, 0.25)])
@pytest.mark.parametrize("yaw", [-0.1, 0.0, 0.1])
def test_the_velocity_of_a_swimmer_5_m_ahead_is_estimated(velocity: tuple[float, float], yaw: float) -> None:
    memory, at_us, _ = watched((5.0, 0.0), velocity, yaw_radps=yaw)
    (obstacle,) = moving(memory, at_us)
    assert obstacle.velocity[:2] == pytest.approx(velocity, abs=0.13)
    assert math.hypot(obstacle.east_m.mean() - 5.0, obstacle.north_m.mean()) < 0.4


@pytest.mark.slow
def test_a_static_swimmer_is_hardly_ever_taken_for_a_moving_one() -> None:
    """From a boat that moves and turns, with boxes that jitter by a pixel on every side: one in a hundred at most."""
    rng, found_moving = np.random.default_rng(0), 0
    for seed in range(200):
        x_m, side, surge, yaw = rng.uniform((3.0, -0.3, 0.0, -0.2), (12.0, 0.3, 0.6, 0.2)).tolist()
        watching = {"surge_mps": surge, "yaw_radps": yaw, "seed": seed, "jitter_px": 1.0}
        memory, at_us, _ = watched((x_m, side * x_m), (0.0, 0.0), **watching)
        found_moving += len(moving(memory, at_us))
    assert found_moving <= 2


@pytest.mark.slow
def test_boxes_that_include_reflections_are_not_taken_for_motion() -> None:
    """One box in seven reaches a quarter lower: one static swimmer in a hundred at most is taken for a moving one."""
    found_moving = 0
    for seed in range(100):
        memory, at_us, _ = watched((3.5 + 0.05 * seed, 0.0), (0.0, 0.0), mistaken=0.15, seed=seed)
        found_moving += len(moving(memory, at_us))
    assert found_moving <= 1


def test_a_person_may_swim_until_they_are_seen_to_stand() -> None:
    """After two pictures a person may swim at ease in any direction; the longer they stay in one place, the slower."""
    fastest = []
    memory, at_us, _ = watched((4.0, 0.0), (0.0, 0.0), seconds=0.0, surge_mps=0.0)
    assert find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER) == ()  # seen only once
    for seconds in (0.2, 1.0, 2.0, 3.0):
        memory, at_us, _ = watched((4.0, 0.0), (0.0, 0.0), seconds=seconds, surge_mps=0.0)
        (obstacle,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
        assert obstacle.velocity[:2] == (0.0, 0.0)
        assert obstacle.vacated_boxes == frozenset()  # they occupy the cells where they are seen
        fastest.append(obstacle.velocity.deviation_mps)
    assert fastest[0] == PLANNER.person_mps
    assert fastest == sorted(fastest, reverse=True)
    assert fastest[-1] < 0.15
    assert (
        find_dynamic_obstacles(memory.observations, at_us + round(PLANNER.occupied_s * 1e6) + 1, CAMERA, PLANNER) == ()
    )


def test_a_person_cut_by_the_picture_s_side_is_seen_to_stand_too() -> None:
    """A person who has come to rest at the picture's border does not hold the boat up for ever."""
    memory, at_us = ObservationMemory(), START_US
    cut = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(0.0, 0.55, 0.1, 0.65))
    for _ in range(16):
        at_us += 200_000
        memory = observe_from(at_us=at_us, memory=memory, detections=(cut,))
    (obstacle,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert obstacle.velocity.deviation_mps < 0.15


@pytest.mark.parametrize(("looking", "denied"), [(AT_REST, True), (BoatPose(0.0, 0.0, -1.5), False)])
@pytest.mark.slow
def test_an_obstacle_is_refuted_where_pictures_show_water_at_its_predicted_position(
    looking: BoatPose, denied: bool
) -> None:
    """That takes a second of pictures that show water there; a camera that looks elsewhere refutes nothing."""
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


@pytest.mark.parametrize(
    ("occupancy", "denied"), [("free", True), ("occupied", False), ("occluded", False), ("unknown", False)]
)
@pytest.mark.parametrize("age_s", [0.9, 1.1])
def test_water_alone_refutes_who_is_out_of_sight(occupancy: str, denied: bool, age_s: float) -> None:
    """What stands or stood there may hide who is there: how deep it is is not seen."""
    grid, velocity = open_water(), Velocity(0.3, 0.0, 0.05)
    cells = np.zeros_like(grid.free)
    cells[48:52, 60:64] = occupancy != "free"
    grid = grid._replace(
        free=grid.free & ~cells,
        occupied=cells & (occupancy in {"occupied", "occluded"}),
        occluded=cells & (occupancy == "occluded"),
    )
    obstacle = DynamicObstacle(np.full(3, 2.4), np.array([-0.2, 0.0, 0.2]), 0.2, velocity, age_s, frozenset())
    assert is_refuted(obstacle, grid) is (denied and age_s > 1.0)


def test_an_obstacle_out_of_sight_is_predicted_and_occupies_where_it_was_last_seen() -> None:
    """The boat turned away: it predicts the obstacle less and less surely, and keeps off where it was last seen too."""
    memory, at_us, _ = watched((5.0, 1.0), (0.0, 0.35), surge_mps=0.0)
    away, obstacle = BoatPose(0.0, 0.0, -1.5), None
    for number in range(20):
        at_us += 200_000
        memory = observe_from(away, at_us=at_us, memory=memory)
        if number not in {4, 19}:
            continue
        (obstacle,) = moving(memory, at_us)
        before, after = (
            build_occupancy_grid(memory.observations, (0.0, 0.0), at_us, CAMERA, PLANNER, of).occupied
            for of in (frozenset(), obstacle.vacated_boxes)
        )
        assert after.sum() > 0
        assert not (after & ~before).any()
        is_trail_kept = number == 4  # after `occupied_s` the last picture from there alone is kept
        assert bool(after.sum() < before.sum()) is is_trail_kept
    assert obstacle is not None
    assert obstacle.age_s == pytest.approx(4.0, abs=0.3)
    assert (obstacle.east_m.mean(), obstacle.north_m.mean()) == pytest.approx((5.0, 2.4), abs=0.6)
    now, later = (
        predicted_clearance_m(each, np.zeros(1), np.zeros(1), np.zeros(1))
        for each in (obstacle._replace(age_s=0.0), obstacle)
    )
    assert later[0] < now[0]


@pytest.mark.slow
def test_an_obstacle_cut_by_the_picture_s_side_stays_occupied() -> None:
    """It moved when last seen whole; where later pictures show part of it stays occupied, however long that lasts."""
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


def test_only_the_trail_of_a_dynamic_obstacle_is_freed() -> None:
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


def test_velocities_are_reproduced_bit_by_bit() -> None:
    memory, at_us, _ = watched((5.0, 0.5), (0.1, -0.3))
    again = msgspec.json.decode(msgspec.json.encode(memory), type=ObservationMemory)
    first, second = (moving(each, at_us) for each in (memory, again))
    assert first[0].velocity == second[0].velocity
    assert (first[0].east_m == second[0].east_m).all()


def test_two_that_were_seen_as_one_are_two_obstacles() -> None:
    """A track takes one measurement of each picture; the other begins a track of its own."""
    one, other = (detection_of((4.9, y_m, 5.1, y_m + 0.3), 0.4) for y_m in (-0.4, 0.2))
    memory = observe_from(at_us=START_US, detections=(one,))
    for number in (1, 2, 3):
        memory = observe_from(at_us=START_US + 200_000 * number, memory=memory, detections=(one, other))
    assert len(find_dynamic_obstacles(memory.observations, START_US + 600_000, CAMERA, PLANNER)) == 2


@pytest.mark.parametrize(
    ("seen", "count"),
    [
        ({0.0: Label.PERSON, 2.4: Label.PERSON}, 1),
        ({0.0: Label.PERSON, 2.6: Label.PERSON}, 0),
        ({0.0: Label.PERSON, 0.2: Label.PERSON, 0.4: Label.VESSEL}, 1),
    ],
)
def test_a_track_goes_on_with_its_own_label_within_the_time_that_is_fitted(
    seen: dict[float, Label], count: int
) -> None:
    """A person seen again is one who may swim, and stays one beside a vessel; one seen long after begins anew."""
    memory, at_us = ObservationMemory(), START_US
    for at_s, label in seen.items():
        at_us = START_US + round(at_s * 1e6)
        box = detection_of((4.9, -0.2, 5.1, 0.1), 0.4, label)
        memory = observe_from(at_us=at_us, memory=memory, detections=(box,))
    assert len(find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)) == count


@settings(max_examples=25)
@given(labels=st.lists(st.sampled_from([Label.VESSEL, Label.BUOY]), min_size=12, max_size=12))
@pytest.mark.slow
def test_what_comes_is_known_by_its_motion_whatever_each_picture_takes_it_for(labels: list[Label]) -> None:
    """A hull that comes at 1.5 m/s from 10 m off, in pictures 0.2 s apart, is met as one that moves."""
    memory, at_us = ObservationMemory(), START_US
    for number, label in enumerate(labels):
        at_us, ahead_m = START_US + 200_000 * number, 10.0 - 0.3 * number
        box = detection_of((ahead_m, -0.6, ahead_m + 0.4, 0.6), 1.5, label)
        edge = water_edge_of(AT_REST, ((ahead_m, -0.6, ahead_m + 4.0, 0.6),))
        memory = observe_from(edge=edge, at_us=at_us, memory=memory, detections=(box,))
    (found,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert found.velocity.east_mps == pytest.approx(-1.5, abs=0.4)
    assert found.label is max(reversed(labels), key=labels.count)


@pytest.mark.parametrize("speed_mps", [2.2, 3.0])
def test_a_long_hull_that_comes_end_on_is_known_within_two_seconds(speed_mps: float) -> None:
    """A barge from 13 m off, an eight: a row of the mask is 2 m there, the lower end of a box half a metre."""
    memory, at_us = ObservationMemory(), START_US
    for number in range(10):
        at_us, ahead_m = START_US + 200_000 * number, 13.0 - 0.2 * speed_mps * number
        bow, hull = (ahead_m, -1.2, ahead_m + 0.4, 1.2), (ahead_m, -1.2, ahead_m + 10.0, 1.2)
        memory = observe_from(
            edge=water_edge_of(AT_REST, (hull,)),
            at_us=at_us,
            memory=memory,
            detections=(detection_of(bow, 1.8, Label.VESSEL),),
        )
    (found,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert found.velocity.east_mps == pytest.approx(-speed_mps, abs=0.35)


@pytest.mark.parametrize(("pictures", "count"), [(3, 0), (4, 1)])
def test_three_pictures_are_too_few_for_a_velocity(pictures: int, count: int) -> None:
    """Three places that a detector is wrong about lie on a line by chance, and what is there would be taken to go."""
    memory, at_us = ObservationMemory(), START_US
    for number in range(pictures):
        at_us, ahead_m = START_US + 400_000 * number, 4.5 - 0.7 * number
        box = detection_of((ahead_m, -0.2, ahead_m + 0.4, 0.2), 0.5, Label.BUOY)
        memory = observe_from(at_us=at_us, memory=memory, detections=(box,))
    assert len(find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)) == count


def test_a_track_goes_on_over_a_box_that_ends_too_low() -> None:
    """One picture's box of a narrow thing that comes is a tenth longer downwards, which is 2 m nearer."""
    memory, at_us = ObservationMemory(), START_US
    for number in range(10):
        at_us, ahead_m = START_US + 200_000 * number, 12.0 - 0.3 * number
        box = detection_of((ahead_m, -0.3, ahead_m + 0.4, 0.3), 1.8, Label.BUOY)
        if number == 3:
            x1, y1, x2, y2 = box.box_xyxy
            box = msgspec.structs.replace(box, box_xyxy=(x1, y1, x2, y2 + 0.1 * (y2 - y1)))
        memory = observe_from(at_us=at_us, memory=memory, detections=(box,))
    (found,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert found.velocity.east_mps == pytest.approx(-1.5, abs=2.0 * found.velocity.deviation_mps)
    assert (START_US + 600_000, 0) in found.vacated_boxes


def test_a_vessel_and_a_buoy_beside_each_other_are_told_apart() -> None:
    """Each goes on with its own label, although the other is by then where it was."""
    memory, at_us = ObservationMemory(), START_US
    for number in range(10):
        at_us, left_m = START_US + 200_000 * number, 1.0 - 0.2 * number
        boxes = [
            detection_of((5.0, at_m - 0.1, 5.2, at_m + 0.1), 0.4, label)
            for label, at_m in ((Label.VESSEL, left_m), (Label.BUOY, left_m - 0.2))
        ]
        memory = observe_from(at_us=at_us, memory=memory, detections=boxes)
    found = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert {each.label: round(each.velocity.north_mps, 1) for each in found} == {Label.VESSEL: -1.0, Label.BUOY: -1.0}
    assert all(each.velocity.deviation_mps < 0.05 for each in found)  # one that was taken for the other leaps
