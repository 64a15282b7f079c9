"""Where RETURN leads: never to a rally point that is outside the fence, behind it, or on what was seen."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani_services.operator.return_place import choose_place

MARGIN_M = 2.0


def points(*places: tuple[float, float]) -> tuple[m.Waypoint, ...]:
    return tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in places)


HERE, HOME, NEAR, NEARER = points((0, 0), (-40, 0), (20, 0), (0, 10))
BASIN = m.FenceArea(keep=m.Keep.IN, corners=points((-60, -60), (60, -60), (60, 60), (-60, 60)))
WALL = m.FenceArea(keep=m.Keep.OUT, corners=points((8, -5), (12, -5), (12, 5), (8, 5)))
NONE_SEEN = m.OccupancyGrid(source_us=1, west_m=18.0, south_m=-2.0, cell_m=2.0, columns=2, rows=2, cells=b"\x00")
ROCK = replace(NONE_SEEN, cells=b"\x80")  # of the four cells the north-eastern one


def chosen(
    *rally: m.Waypoint, fence: tuple[m.FenceArea, ...] = (BASIN,), seen: m.OccupancyGrid | None = None
) -> m.Waypoint:
    return choose_place(HERE, HOME, m.Mission(source_us=1, name="", legs=(), fence=fence, rally=rally), seen, MARGIN_M)


@pytest.mark.parametrize(
    ("rally", "place"),
    [((), HOME), ((NEAR,), NEAR), ((NEAR, NEARER), NEARER), (points((41, 0)), HOME), (points((0, 40)), HOME)],
)
def test_the_nearest_of_home_and_the_rally_points(rally: tuple[m.Waypoint, ...], place: m.Waypoint) -> None:
    assert chosen(*rally) == place


def test_what_is_outside_the_fence_or_within_its_margin_or_behind_it_is_passed_over() -> None:
    """However it came to be among the rally points."""
    out = replace(BASIN, corners=points((-60, -60), (15, -60), (15, 60), (-60, 60)))
    assert chosen(NEAR, fence=(out,)) == HOME
    assert chosen(NEAR, fence=(replace(out, corners=points((-60, -60), (21, -60), (21, 60), (-60, 60))),)) == HOME
    assert chosen(NEAR, fence=(BASIN, WALL)) == HOME
    assert chosen(NEAR, replace(NEARER, y_m=30.0), fence=(BASIN, WALL)) == replace(NEARER, y_m=30.0)


def test_a_boat_that_is_itself_outside_the_fence_is_led_home() -> None:
    assert chosen(NEAR, fence=(replace(BASIN, corners=points((5, -60), (60, -60), (60, 60), (5, 60))),)) == HOME


def test_land_is_passed_over_as_a_fence_is() -> None:
    mission = m.Mission(source_us=1, name="", legs=(), land=(WALL,), rally=(NEAR,))
    assert choose_place(HERE, HOME, mission, None, MARGIN_M) == HOME
    assert choose_place(HERE, HOME, replace(mission, land=()), None, MARGIN_M) == NEAR


@pytest.mark.parametrize(
    ("seen", "place"), [(None, NEAR), (NONE_SEEN, NEAR), (ROCK, HOME), (replace(ROCK, cells=b""), HOME),
                        (replace(ROCK, west_m=100.0), NEAR), (replace(ROCK, cells=b"\x40"), NEAR)]
)  # fmt: skip
def test_what_was_seen_at_its_place(seen: m.OccupancyGrid | None, place: m.Waypoint) -> None:
    assert chosen(NEAR, seen=seen) == place
