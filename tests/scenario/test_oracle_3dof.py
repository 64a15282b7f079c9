"""The plant against Fossen's 3-DOF model, written apart from it and solved with scipy."""

import math

import numpy as np
import pytest

from paani_sim.plant.reference_model import MANOEUVRES, Manoeuvre, compare_manoeuvre, solve_reference

STEADY = [manoeuvre for manoeuvre in MANOEUVRES if not manoeuvre.zigzag_rad]
ZIGZAG = next(manoeuvre for manoeuvre in MANOEUVRES if manoeuvre.zigzag_rad)


@pytest.mark.parametrize("vessel", ["paper", "otter"])
@pytest.mark.parametrize("manoeuvre", STEADY, ids=lambda manoeuvre: manoeuvre.name)
def test_plant_agrees_with_the_published_model(vessel: str, manoeuvre: Manoeuvre) -> None:
    """Straight line, turning circle, drift in current and wind, a crossing: within 0.1 m and 0.3 degrees."""
    difference = compare_manoeuvre(vessel, manoeuvre)
    assert difference.position_m < 0.1
    assert difference.heading_deg < 0.3


@pytest.mark.parametrize("vessel", ["paper", "otter"])
def test_zig_zag_agrees(vessel: str) -> None:
    """The plant's helm looks every 10 ms, the model's at once, and each reversal adds to the difference."""
    difference = compare_manoeuvre(vessel, ZIGZAG)
    assert difference.distance_m > 35.0
    assert difference.position_m < 0.1
    assert difference.heading_deg < 4.0


def test_model_itself_by_hand() -> None:
    """12 N against 4 u + 20 u^2: 0.681 m/s. 1.8 N m against 4 r + 25 r^2: 0.200 rad/s. Adrift: as the water."""
    straight, circle, drift = (solve_reference("paper", MANOEUVRES[index]) for index in (0, 1, 3))
    assert np.linalg.norm(straight[-1, :2] - straight[-2, :2]) / 0.1 == pytest.approx(0.681, abs=0.001)
    assert (circle[-1, 2] - circle[-2, 2]) / 0.1 == pytest.approx(0.200, abs=0.001)
    velocity = (drift[-1, :2] - drift[-2, :2]) / 0.1
    assert velocity == pytest.approx([0.4 * math.cos(math.radians(60.0)), 0.4 * math.sin(math.radians(60.0))], abs=0.01)
    assert np.ptp(drift[:, 2]) == 0.0


def test_added_mass_shows() -> None:
    """The otter answers the helm later than the paper's boat: the comparison can tell them apart."""
    paper, otter = solve_reference("paper", MANOEUVRES[1]), solve_reference("otter", MANOEUVRES[1])
    assert math.degrees(paper[-1, 2] - otter[-1, 2]) > 3.0
