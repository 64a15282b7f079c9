"""A hand that drives astern comes no nearer to the fence than one that drives ahead."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import NavCommand, Odometry
from tests.unit.paani_services.navigator.test_modes import fenced_pool, manual, step
from tests.unit.paani_services.navigator.test_navigate import PAANI, pose


def driven(x_m: float, surge: float, way_mps: float) -> NavCommand:
    """The order at this place of a boat whose edge lies to the west, and which goes there bow or stern first."""
    here: Odometry = msgspec.structs.replace(
        pose(x_m, 0.0), yaw_rad=math.pi if surge > 0.0 else 0.0, surge_mps=math.copysign(way_mps, surge)
    )
    return step(manual(surge), odometry=here, mission=fenced_pool())[1]


@pytest.mark.parametrize("way_mps", [0.0, 0.09, 0.3, 0.6])
@pytest.mark.parametrize("x_m", [-4.5, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0])
def test_astern_as_ahead(x_m: float, way_mps: float) -> None:
    ahead, astern = driven(x_m, 1.0, way_mps), driven(x_m, -1.0, way_mps)
    assert ahead.enable == astern.enable
    assert astern.astern_mps == pytest.approx(ahead.speed_mps, abs=1e-9)


PLACES_M, STICK = st.floats(-4.9, 4.9), st.sampled_from([-1.0, -0.4, 0.4, 1.0])


@given(PLACES_M, PLACES_M, st.floats(-math.pi, math.pi), STICK, STICK)
def test_a_hand_that_turns_stops_before_the_edge_on_its_heading_too(
    x_m: float, y_m: float, yaw_rad: float, surge: float, turn: float
) -> None:
    here = msgspec.structs.replace(pose(x_m, y_m, yaw_rad), surge_mps=0.0)
    order = step(manual(surge, turn), odometry=here, mission=fenced_pool())[1]
    way_m = (order.speed_mps - order.astern_mps) * PAANI.fence_stop_s
    end_m = x_m + way_m * math.cos(order.heading_rad), y_m + way_m * math.sin(order.heading_rad)
    assert max(map(abs, end_m)) <= 5.0
