"""People: those out of sight may have swum on, and those aboard a vessel or a pier are not in the water."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from paani.messages import Detection, Label
from paani_services.navigator.avoidance.clearance import UNSEEN_GROWTH_MPS, clearance_fields_m
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.velocity_fit import Velocity
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    PLANNER,
    Bar,
    detection_of,
    observe_from,
    observe_then_look_astern,
    open_water,
    plan_on,
    request_on,
    water_edge_of,
)

RESTING = BoatState(0.0, 0.0, 0.0)


def turned_away(seconds: float) -> tuple[ObservationMemory, int]:
    """The memory of a boat that saw a swimmer, and has looked astern since."""
    return observe_then_look_astern(seconds, detection_of((4.7, -0.3, 5.3, 0.3), 0.4))


def reached_m(grid: OccupancyGrid) -> float:
    """Distance from the boat to the nearest cell that the swimmer may have reached."""
    rows, columns = np.nonzero(grid.reachable_unseen)
    away_m = np.hypot(grid.west_m + CELL_M * (columns + 0.5), grid.south_m + CELL_M * (rows + 0.5))
    return float(away_m.min(initial=np.inf))


def test_a_person_out_of_sight_may_swim_on() -> None:
    """They reach cells at 0.4 m/s from where they were, up to 3.6 m; the clearance there falls by as much."""
    reached = []
    for seconds in (3.2, 4.8, 8.0):
        memory, now_us = turned_away(seconds)
        grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
        reached.append(reached_m(grid))
        row, column = np.argwhere(grid.reachable_unseen)[0]
        assert clearance_fields_m(grid, PLANNER)[0][row, column] < 0.0
    assert reached == pytest.approx([4.7 - 1.28, 4.7 - 1.92, 4.7 - 3.2], abs=2.0 * CELL_M)
    memory, now_us = turned_away(8.0)
    for changes in ({"person_mps": 0.0}, {"person_reach_m": 0.0}, {"hidden_s": 0.0}):
        still = msgspec.structs.replace(PLANNER, **changes)
        assert reached_m(build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, still)) > 1e9


def test_a_person_has_not_swum_to_where_a_picture_shows_water() -> None:
    """The boat looks back: cells seen free are free, and the rest may be reached."""
    memory, now_us = turned_away(4.8)
    hidden = BoatPose(0.0, 0.0, 0.6)  # the swimmer is just outside the picture, half of the surroundings inside
    memory = observe_from(hidden, at_us=now_us + 200_000, memory=memory)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us + 200_000, CAMERA, PLANNER)
    assert grid.reachable_unseen.any()
    assert not (grid.reachable_unseen & grid.free).any()


@pytest.mark.parametrize(("x_m", "y_m"), [(0.0, -2.0), (2.5, 2.4)])
def test_the_boat_goes_slower_where_a_person_may_be(x_m: float, y_m: float) -> None:
    """A swimmer was last seen 8 s ago beside the path: the boat goes slower than it would have at once, or stops."""
    memory, now_us = turned_away(8.0)
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
    grid = grid._replace(free=~grid.occupied)  # everything else is known to be free
    start, setpoint = BoatState(x_m, y_m, 0.0, 0.6), GuidanceSetpoint(0.0, 0.6)
    found, at_once = (
        plan_on(given, start, setpoint, None, PLANNER) for given in (grid, grid._replace(reachable_unseen=grid.people))
    )
    assert found.speed_mps < at_once.speed_mps


@pytest.mark.parametrize("course", [0.0, 0.4])
def test_a_boat_where_a_person_may_be_goes_on_and_is_not_driven_out(course: float) -> None:
    """Beside what was seen it turns away before it goes on; beside what may be there it goes on, and no nearer."""
    none = np.zeros((GRID_CELLS, GRID_CELLS), np.bool_)
    beside = none.copy()
    beside[35:48, :] = True  # from 0.4 m to starboard
    free = OccupancyGrid(-10.0, -10.0, none, none, ~none, none, none, none, none)
    setpoint = GuidanceSetpoint(course, 0.6)
    seen = plan_on(free._replace(occupied=beside, free=~beside), RESTING, setpoint, None, PLANNER)
    unseen = plan_on(free._replace(reachable_unseen=beside), RESTING, setpoint, None, PLANNER)
    assert seen.heading_rad > course + 0.2
    assert unseen.heading_rad == pytest.approx(course, abs=0.2)
    towards = plan_on(free._replace(reachable_unseen=beside), RESTING, GuidanceSetpoint(-0.8, 0.6), None, PLANNER)
    assert towards.speed_mps == 0.0 or towards.heading_rad >= 0.0


def test_a_person_aboard_is_not_in_the_water() -> None:
    """A kayak or pontoon is nearer than the point where the rider's foot would project to on the water."""
    for label in (Label.VESSEL, Label.PIER):
        side = (3.6, -1.2, 4.2, 1.2)
        carrier, rider = detection_of(side, 0.5, label), detection_of((3.8, -0.25, 4.0, 0.25), 0.8, foot_m=0.35)
        edge = water_edge_of(AT_REST, (side,))
        observation = observe_from(edge=edge, detections=(carrier, rider)).observations[-1]
        assert not any(foot.is_person for foot in observation.feet)
        assert Label.PERSON not in {box.label for box in observation.boxes}


@pytest.mark.parametrize(
    ("swimmer", "carried"),
    [
        ((3.2, -0.3, 3.5, 0.3), True),  # before the hull
        ((3.8, -0.3, 4.1, 0.3), False),  # nothing there carries them
    ],
)
def test_a_swimmer_is_in_the_water(swimmer: Bar, carried: bool) -> None:
    """People nearer than the vessel behind them, or with none about, stay people, with room around them."""
    hull = (3.6, -1.2, 4.2, 1.2)
    edge = water_edge_of(AT_REST, (hull, swimmer) if carried else (swimmer,))
    boxes = (
        (detection_of(hull, 0.5, Label.VESSEL), detection_of(swimmer, 0.4))
        if carried
        else (detection_of(swimmer, 0.4),)
    )
    observation = observe_from(edge=edge, detections=boxes).observations[-1]
    assert any(foot.is_person for foot in observation.feet)
    assert Label.PERSON in {box.label for box in observation.boxes}


def test_people_ashore_do_not_swim() -> None:
    """A person metres behind where the water ends stays ashore; one at the water's edge may go in."""
    edge = water_edge_of(AT_REST, bank_m=3.0)
    for x_m, moves in ((5.5, False), (3.2, True)):
        observation = observe_from(
            edge=edge, detections=(detection_of((x_m, -0.3, x_m + 0.3, 0.3), 1.7),)
        ).observations[-1]
        assert any(foot.is_person for foot in observation.feet)
        assert bool(observation.boxes) is moves


def test_a_swimmer_in_the_empty_corner_of_an_aslant_hull_s_box_is_in_the_water() -> None:
    """The mask ends the water at the swimmer, not below, so the hull does not carry them."""
    near, far = (3.0, -1.6, 3.6, -1.0), (5.6, 0.8, 6.2, 1.4)
    hull = tuple((3.0 + 0.26 * k, -1.6 + 0.24 * k, 3.6 + 0.26 * k, -1.0 + 0.24 * k) for k in range(11))
    swimmer = (3.8, 0.3, 4.1, 0.9)
    boxes = [detection_of(part, 0.5).box_xyxy for part in (near, far)]
    around = tuple(of(box[side] for box in boxes) for side, of in enumerate((min, min, max, max)))
    vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=around)  # type: ignore[arg-type]
    person = detection_of(swimmer, 0.4)
    assert around[0] < person.box_xyxy[0] < person.box_xyxy[2] < around[2]
    assert person.box_xyxy[3] < around[3]
    observation = observe_from(edge=water_edge_of(AT_REST, (*hull, swimmer)), detections=(vessel, person)).observations[
        -1
    ]
    assert any(foot.is_person for foot in observation.feet)


def test_who_swims_in_sight_is_as_near_as_one_standard_deviation_makes_them() -> None:
    """A person who moves is not on the grid; the room that a plan keeps around them is not what counts here."""
    swims = Velocity(0.0, 0.4, 0.3)
    outline = (np.array([2.0, 3.0]), np.array([0.0, 0.0]))
    for label, distance_m in ((Label.PERSON, 2.0 - 2.0 * (0.3 + UNSEEN_GROWTH_MPS)), (Label.VESSEL, np.inf)):
        swimmer = DynamicObstacle(*outline, 0.5, swims, 2.0, frozenset(), 0, label)
        request = request_on(open_water(), RESTING, GuidanceSetpoint(0.0, 0.6), obstacles=[swimmer])
        assert request.nearest_person_m() == pytest.approx(distance_m)
