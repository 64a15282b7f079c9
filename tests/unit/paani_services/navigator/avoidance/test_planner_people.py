"""People: those out of sight may have swum on, those aboard something are not in the water."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from paani.messages import Detection, Label
from paani_services.navigator.avoidance.clearance import clearance_m
from paani_services.navigator.avoidance.planner import plan
from paani_services.navigator.avoidance.rollout import Start, Wish
from paani_services.navigator.mapping.observation import Memory
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import Grid, lay
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import AT_REST, CAMERA, PLANNER, Bar, box_over, edge_of, looked_away, seen


def turned_away(seconds: float) -> tuple[Memory, int]:
    """Of a boat that saw a swimmer, and has looked astern since."""
    return looked_away(seconds, box_over((4.7, -0.3, 5.3, 0.3), 0.4))


def reached_m(grid: Grid) -> float:
    """How near to the boat the nearest cell is that the swimmer may have got to."""
    rows, columns = np.nonzero(grid.strayed)
    away_m = np.hypot(grid.west_m + CELL_M * (columns + 0.5), grid.south_m + CELL_M * (rows + 0.5))
    return float(away_m.min(initial=np.inf))


def test_a_person_out_of_sight_may_swim_on() -> None:
    """0.4 m/s from where they were, 3.6 m at most; what that leaves of the way is less by as much."""
    reached = []
    for seconds in (3.2, 4.8, 8.0):
        memory, now_us = turned_away(seconds)
        grid = lay(memory.sights, (0.0, 0.0), now_us, CAMERA, PLANNER)
        reached.append(reached_m(grid))
        row, column = np.argwhere(grid.strayed)[0]
        assert clearance_m(grid, PLANNER)[row, column] < 0.0
    assert reached == pytest.approx([4.7 - 1.28, 4.7 - 1.92, 4.7 - 3.2], abs=2.0 * CELL_M)
    memory, now_us = turned_away(8.0)
    for changes in ({"person_mps": 0.0}, {"person_reach_m": 0.0}, {"hidden_s": 0.0}):
        still = msgspec.structs.replace(PLANNER, **changes)
        assert reached_m(lay(memory.sights, (0.0, 0.0), now_us, CAMERA, still)) > 1e9


def test_nobody_has_swum_to_where_a_picture_shows_water() -> None:
    """The boat looks back: what is seen free is free, and the rest is not."""
    memory, now_us = turned_away(4.8)
    hidden = BoatPose(0.0, 0.0, 0.6)  # the swimmer's place is just outside the picture, half of what is round it is in
    memory = seen(hidden, at_us=now_us + 200_000, memory=memory)
    grid = lay(memory.sights, (0.0, 0.0), now_us + 200_000, CAMERA, PLANNER)
    assert grid.strayed.any()
    assert not (grid.strayed & grid.free).any()


@pytest.mark.parametrize(("x_m", "y_m"), [(0.0, -2.0), (2.5, 2.4)])
def test_the_boat_is_careful_where_a_person_may_be(x_m: float, y_m: float) -> None:
    """A swimmer last seen 8 s ago beside the way: the boat goes slower than it would have at once, or not at all."""
    memory, now_us = turned_away(8.0)
    grid = lay(memory.sights, (0.0, 0.0), now_us, CAMERA, PLANNER)
    grid = grid._replace(free=~grid.occupied)  # all else is known
    start, wish = Start(x_m, y_m, 0.0, 0.6), Wish(0.0, 0.6)
    found, at_once = (plan(given, start, wish, None, PLANNER) for given in (grid, grid._replace(strayed=grid.people)))
    assert found.speed_mps < at_once.speed_mps


def test_a_person_aboard_is_not_in_the_water() -> None:
    """In a kayak or on a pontoon: what carries them is nearer than where their foot would lie on the water."""
    for label in (Label.VESSEL, Label.PIER):
        side = (3.6, -1.2, 4.2, 1.2)
        carrier, rider = box_over(side, 0.5, label), box_over((3.8, -0.25, 4.0, 0.25), 0.8, foot_m=0.35)
        edge = edge_of(AT_REST, (side,))
        sight = seen(edge=edge, detections=(carrier, rider)).sights[-1]
        assert not any(foot.person for foot in sight.feet)
        assert Label.PERSON not in {box.label for box in sight.boxes}


@pytest.mark.parametrize(
    ("swimmer", "carried"),
    [
        ((3.2, -0.3, 3.5, 0.3), True),  # before the hull
        ((3.8, -0.3, 4.1, 0.3), False),  # nothing there that could carry them
    ],
)
def test_a_swimmer_is_in_the_water(swimmer: Bar, carried: bool) -> None:
    """Nearer than the vessel behind them, or with none about: they stay people, with their room."""
    hull = (3.6, -1.2, 4.2, 1.2)
    edge = edge_of(AT_REST, (hull, swimmer) if carried else (swimmer,))
    boxes = (box_over(hull, 0.5, Label.VESSEL), box_over(swimmer, 0.4)) if carried else (box_over(swimmer, 0.4),)
    sight = seen(edge=edge, detections=boxes).sights[-1]
    assert any(foot.person for foot in sight.feet)
    assert Label.PERSON in {box.label for box in sight.boxes}


def test_people_ashore_do_not_swim() -> None:
    """On a bank, metres behind where the water ends; at the water's edge they may go in."""
    edge = edge_of(AT_REST, bank_m=3.0)
    for x_m, moves in ((5.5, False), (3.2, True)):
        sight = seen(edge=edge, detections=(box_over((x_m, -0.3, x_m + 0.3, 0.3), 1.7),)).sights[-1]
        assert any(foot.person for foot in sight.feet)
        assert bool(sight.boxes) is moves


def test_a_swimmer_in_the_empty_corner_of_an_aslant_hull_s_box_is_in_the_water() -> None:
    """The mask ends the water at the swimmer, not lower: nobody is carried there."""
    near, far = (3.0, -1.6, 3.6, -1.0), (5.6, 0.8, 6.2, 1.4)
    hull = tuple((3.0 + 0.26 * k, -1.6 + 0.24 * k, 3.6 + 0.26 * k, -1.0 + 0.24 * k) for k in range(11))
    swimmer = (3.8, 0.3, 4.1, 0.9)
    boxes = [box_over(part, 0.5).box_xyxy for part in (near, far)]
    around = tuple(of(box[side] for box in boxes) for side, of in enumerate((min, min, max, max)))
    vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=around)  # type: ignore[arg-type]
    person = box_over(swimmer, 0.4)
    assert around[0] < person.box_xyxy[0] < person.box_xyxy[2] < around[2]
    assert person.box_xyxy[3] < around[3]
    sight = seen(edge=edge_of(AT_REST, (*hull, swimmer)), detections=(vessel, person)).sights[-1]
    assert any(foot.person for foot in sight.feet)
