"""A detection that never leaves the picture: advisor, navigator, controller and plant in lockstep."""

from __future__ import annotations

import math
import random

import msgspec
import pytest

from paani import messages as m
from paani.geometry import wrap_rad
from paani_services.advisor.advise import AdvisorState, advise
from tests.guidance_loop import Lockstep, open_water
from tests.scenario.conftest import Launch
from tests.unit.paani_services.advisor.advisor_evidence import box, seeing

pytestmark = pytest.mark.timeout(300)
CAP_DEG, OVERSHOOT_DEG = 90.0, 7.0
STILL_MPS = 0.02


def turned_deg(boat: Lockstep, evidence: m.Evidence, seconds: float) -> list[float]:
    """Heading over time, unwrapped, since the detection came [deg]; a picture every 0.2 s, 0.05 s old."""
    state, turned, yaw_rad = AdvisorState(), [0.0], boat.plant.attitude.yaw_rad
    for step, _ in enumerate(boat.run(seconds)):
        seen = msgspec.structs.replace(evidence, source_us=boat.now_us - 50_000, frame_seq=step // 2)
        state, boat.advisory, _ = advise(state, seen, boat.now_us, boat.config, boat.odometry)
        before_rad, yaw_rad = yaw_rad, boat.plant.attitude.yaw_rad
        turned.append(turned[-1] + math.degrees(wrap_rad(yaw_rad - before_rad)))
    return turned


def under_way(launch: Launch, profile: str) -> Lockstep:
    boat = launch(open_water("lake"), profile)
    boat.settle(15.0)
    return boat


@pytest.mark.rotating(cpu_s=10)
def test_four_minutes_of_a_stuck_detection_turn_the_boat_no_further_than_the_cap(launch: Launch) -> None:
    """Resolution 15: a quarter turn, then rest, and the order says why."""
    boat = under_way(launch, "paani")
    turned = turned_deg(boat, seeing(box(m.Label.PIER, (0.40, 0.30, 0.60, 0.70), 0.9)), 240.0)
    assert CAP_DEG - OVERSHOOT_DEG < max(map(abs, turned)) < CAP_DEG + OVERSHOOT_DEG
    assert abs(boat.plant.velocity[0]) < STILL_MPS
    assert boat.command is not None
    assert boat.command.inhibits == (m.Inhibit.TURN_CAPPED,)


@pytest.mark.rotating(cpu_s=4)
def test_the_papers_boat_goes_round_and_round(launch: Launch) -> None:
    """M5 as written, with the same detection."""
    turned = turned_deg(under_way(launch, "paper"), seeing(box(m.Label.PIER, (0.40, 0.30, 0.60, 0.70), 0.9)), 120.0)
    assert max(map(abs, turned)) > 360.0


@pytest.mark.rotating(cpu_s=20)
@pytest.mark.parametrize("seed", range(5))
def test_no_stuck_box_spins_the_boat(launch: Launch, seed: int) -> None:
    """Wherever it is and whatever is advised: no further than the cap either way."""
    rng = random.Random(seed)
    width, height = rng.uniform(0.1, 0.6), rng.uniform(0.2, 0.5)
    x1, y1 = rng.uniform(0.25, 0.75 - width / 2.0) - width / 4.0, rng.uniform(0.3, 0.95 - height)
    stuck = seeing(box(rng.choice(tuple(m.Label)), (max(0.0, x1), y1, x1 + width, y1 + height), 0.9))
    turned = turned_deg(under_way(launch, "paani"), stuck, 60.0)
    assert max(map(abs, turned)) < CAP_DEG + OVERSHOOT_DEG
    assert max(turned) - min(turned) < CAP_DEG + 2.0 * OVERSHOOT_DEG
