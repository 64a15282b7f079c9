"""Where a path is joined does not hang on the last digit of a number."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from paani.messages import Waypoint
from paani_services.navigator.guidance.path_progress import WaypointPath, nearest_leg

METRES = st.floats(-1000.0, 1000.0)


@given(st.floats(0.1, 30.0), st.floats(0.1, 30.0), st.floats(-math.pi, math.pi), METRES, METRES)
def test_a_boat_that_is_nearest_to_a_corner_joins_the_leg_that_ends_there(
    beyond_m: float, aside_m: float, turned_rad: float, east_m: float, north_m: float
) -> None:
    """However the path lies in the map."""

    def placed(x_m: float, y_m: float) -> tuple[float, float]:
        sin, cos = math.sin(turned_rad), math.cos(turned_rad)
        return east_m + x_m * cos - y_m * sin, north_m + x_m * sin + y_m * cos

    corners = (placed(*each) for each in ((-20.0, 0.0), (0.0, 0.0), (0.0, 20.0), (-20.0, 20.0)))
    path = WaypointPath(tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in corners))
    assert nearest_leg(path, placed(beyond_m, -aside_m)) == 1
