"""A shoal that no camera sees: with an echo sounder the boat goes round, with one that lies it is no worse off."""

from __future__ import annotations

import dataclasses
import json
from typing import NamedTuple

import pytest

from paani import keys
from paani import messages as m
from paani_sim.trials.drive import Drive
from paani_sim.trials.policies import Policy, load_policy_config
from paani_sim.trials.result import SHOAL, TrialResult
from paani_sim.trials.run_trial import open_evidence_source
from paani_sim.trials.scoring import score_drive
from paani_sim.worlds import Fault, FaultKind, Scenario, Shoal, Task, load_world
from paani_sim.worlds.route_frame import RouteFrame, cut_route

WAY_M, SHOAL_AT_M = 22.0, 12.0
pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]  # three drives


class Driven(NamedTuple):
    """How a drive ended, and what the navigator made of the soundings every two seconds."""

    result: TrialResult
    statuses: frozenset[str]

    @property
    def groundings(self) -> int:
        return sum(each.kind == SHOAL for each in self.result.contacts)


def shoal_ahead(*faults: Fault) -> Scenario:
    """An empty lake, and a shoal in the lane."""
    lake = dataclasses.replace(load_world("lake"), obstacles=(), actors=(), bottom_m=2.0)
    section = cut_route(lake, 60.0, WAY_M)
    x_m, y_m, _ = RouteFrame(section.route_m, closed=False).pose_at(SHOAL_AT_M, 0.3)
    world = dataclasses.replace(section, shoals=(Shoal(x_m, y_m, 5.0, 0.05),))
    return Scenario("shoal", world, seed=3, task=Task(WAY_M, 200.0), faults=faults)


def driven(sonar: bool, *faults: Fault) -> Driven:
    scenario = shoal_ahead(*faults)
    config = load_policy_config(Policy.ORACLE, [f"plant.sensors.sonar={str(sonar).lower()}"])
    statuses = set[str]()

    def watch(topic: keys.Topic[m.Message], message: m.Message, now_us: int, data: bytes = b"") -> None:
        if isinstance(message, m.Step) and topic.name == "navigator/step" and message.state:
            statuses.add(json.loads(message.state)["pilot"]["soundings"]["status"])

    drive = Drive(scenario, config, open_evidence_source(Policy.ORACLE, scenario, config), tap=watch)
    try:
        drive.run()
        return Driven(score_drive(drive, Policy.ORACLE), frozenset(statuses))
    finally:
        drive.close()


def test_soundings_lead_round_a_shoal_that_the_boat_else_runs_on_to_and_a_frozen_sonar_is_no_worse_than_none() -> None:
    blind, sounding = driven(sonar=False), driven(sonar=True)
    assert blind.statuses == {"off"}
    assert [each.what for each in blind.result.contacts] == ["shoal_0"] * blind.groundings
    assert blind.groundings >= 1
    assert (sounding.groundings, sounding.result.completed) == (0, True)
    assert "ok" in sounding.statuses
    frozen = driven(True, Fault(FaultKind.SONAR_FROZEN, 4.0))
    assert "frozen" in frozen.statuses
    assert frozen.groundings <= blind.groundings
    assert frozen.result.completed
