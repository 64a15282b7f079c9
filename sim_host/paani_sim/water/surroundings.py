"""Water and air about the hull at one moment."""

from typing import NamedTuple


class Surroundings(NamedTuple):
    """Current and wind over ground in the map frame, and the water's surface as the hull feels it.

    `elevation_m` above z = 0, slopes along the body's forward and left axes, and the rates of all three; the
    squared envelope of the waves times the unit vector that they run along, in the map frame.
    """

    current_x_mps: float = 0.0
    current_y_mps: float = 0.0
    wind_x_mps: float = 0.0
    wind_y_mps: float = 0.0
    elevation_m: float = 0.0
    elevation_rate_mps: float = 0.0
    slope_ahead: float = 0.0
    slope_left: float = 0.0
    slope_ahead_rate_ps: float = 0.0
    slope_left_rate_ps: float = 0.0
    envelope_x_m2: float = 0.0
    envelope_y_m2: float = 0.0


CALM = Surroundings()
