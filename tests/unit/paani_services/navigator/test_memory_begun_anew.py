"""What the navigator remembers no more where dead reckoning begins anew."""

from __future__ import annotations

from paani import messages as m
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.navigate import NavigatorState, navigate
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    CONFIG,
    PLANNER,
    START_US,
    evidence,
    odometry,
    water_edge_of,
)
from tests.unit.paani_services.navigator.test_interlocks import MISSION


def test_a_station_of_before_dead_reckoning_began_anew_is_kept_no_more() -> None:
    """It began anew where the map is, a metre away: without that, the boat would go astern to no place of its own."""
    state, now_us = NavigatorState(), START_US

    def step(x_m: float) -> m.NavCommand:
        nonlocal state
        inputs = NavigatorInputs(
            advisory=m.Advisory(
                source_us=now_us,
                direction=m.Direction.STOP,
                reason=m.Reason.NO_SAFE_SIDE,
                may_keep_station=True,
            ),
            advisory_us=now_us,
            odometry=odometry(now_us, BoatPose(x_m, 0.0, 0.0)),
            odometry_us=now_us,
            clock=m.SimTime(source_us=now_us, sim_us=now_us, stamp_us=now_us),
            clock_us=now_us,
            arming=m.Arming(source_us=now_us, armed=True),
            arming_us=now_us,
            evidence=evidence(now_us, water_edge_of(AT_REST)),
        )
        state, command = navigate(state, inputs, MISSION, now_us, 43, CONFIG.navigator, CAMERA)
        return command

    for _ in range(60):
        now_us += 100_000
        assert step(0.0).astern_mps == 0.0
    for gap_us in (round(PLANNER.max_reckon_s * 1e6) + 50_000, *(100_000,) * 20):
        now_us += gap_us
        assert step(1.2).astern_mps == 0.0
