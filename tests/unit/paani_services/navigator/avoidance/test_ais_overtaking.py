"""A vessel that comes from astern, where no camera looks, and tells of itself by AIS: the boat leaves its lane."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.config import NavigatorConfig
from paani.geometry import geodetic_from_enu, wrap_rad
from paani_services.navigator.avoidance.replanning import PlannerState, explain_plan, replan
from paani_services.navigator.avoidance.rollout import GuidanceSetpoint, Plan
from paani_services.navigator.navigate import NavigatorState
from paani_services.navigator.predict import predict
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import CAMERA, PLANNER, START_US, observe_from, odometry

ORIGIN_DEG = (51.44, -0.95)
HERE = replace(
    odometry(START_US, BoatPose(0.0, 0.0, 0.0)),
    surge_mps=0.6,
    latitude_deg=ORIGIN_DEG[0],
    longitude_deg=ORIGIN_DEG[1],
)
AHEAD = GuidanceSetpoint(0.0, 0.6)


def barge(astern_m: float = 16.0, aside_m: float = 0.5, speed_mps: float = 2.0, age_s: float = 1.0) -> m.AisVessels:
    """Its bow so far astern by now, on the boat's course."""
    latitude_deg, longitude_deg = geodetic_from_enu(-astern_m - 7.0 - age_s * speed_mps, aside_m, *ORIGIN_DEG)
    vessel = m.AisVessel(
        mmsi=235000001, fixed_us=START_US - round(age_s * 1e6), latitude_deg=latitude_deg,
        longitude_deg=longitude_deg, sog_mps=speed_mps, cog_rad=0.0, to_bow_m=7.0, to_stern_m=7.0, to_port_m=1.5,
        to_starboard_m=1.5,
    )  # fmt: skip
    return m.AisVessels(source_us=START_US, vessels=(vessel,))


def planned(ais: m.AisVessels | None) -> tuple[PlannerState, Plan]:
    return replan(PlannerState(observe_from()), HERE, AHEAD, START_US, CAMERA, PLANNER, ais=ais)


def test_the_boat_leaves_the_lane_of_what_overtakes_it() -> None:
    """To the side that is nearer to the lane's edge; unheard, the vessel would run it down."""
    assert planned(None)[1].heading_rad == pytest.approx(0.0, abs=0.01)
    for aside_m in (1.0, -1.0):
        _, plan = planned(barge(aside_m=aside_m))
        assert math.degrees(abs(wrap_rad(plan.heading_rad))) > 15.0
        assert math.copysign(1.0, plan.heading_rad) == -aside_m
        assert plan.speed_mps > 0.3


@pytest.mark.parametrize(
    "ais",
    [barge(aside_m=20.0), barge(speed_mps=0.1), barge(age_s=PLANNER.ais_max_age_s + 1.0), m.AisVessels(source_us=0)],
    ids=["in another lane", "moored", "silent", "nobody"],
)
def test_nobody_on_its_way_changes_nothing(ais: m.AisVessels) -> None:
    assert planned(ais)[1] == planned(None)[1]


def test_the_reasons_are_told_from_what_was_recorded() -> None:
    """What was told by AIS is part of the plan's basis, so the plan can be made again."""
    state, _ = planned(barge(astern_m=6.0, aside_m=1.0))
    assert explain_plan(state, CAMERA, PLANNER) != ()
    assert state.basis is not None
    assert explain_plan(replace(state, basis=replace(state.basis, targets=())), CAMERA, PLANNER) == ()


def test_people_are_shown_who_it_is_and_what_the_boat_does() -> None:
    state, plan = planned(barge(aside_m=1.0))
    order = m.NavCommand(source_us=START_US, enable=True, heading_rad=plan.heading_rad, speed_mps=plan.speed_mps)
    prediction = predict(NavigatorState(planner_state=state), order, HERE, None, START_US, CAMERA, NavigatorConfig())
    [vessel] = prediction.obstacles
    assert (vessel.mmsi, vessel.track_id, vessel.encounter) == (235000001, 0, m.EncounterClass.OVERTAKEN)
    assert (vessel.x_m, vessel.y_m) == pytest.approx((-23.0, 1.0), abs=0.1)
    assert prediction.courtesy == "Give way: vessel 235000001 (AIS) overtaking us, moving aside"
