"""What a drive delivers of the sensors that a boat may have or not."""

from __future__ import annotations

import pytest

from paani import keys
from paani import messages as m
from paani_sim.trials.drive import Drive
from paani_sim.trials.policies import Policy
from paani_sim.trials.run_trial import build_drive
from paani_sim.trials.trial_cases import TrialCase

SECONDS = 4.0


class Messages:
    """The messages of a drive by topic."""

    def __init__(self) -> None:
        self.by_topic: dict[str, list[m.Message]] = {}

    def __call__(self, topic: keys.Topic[m.Message], message: m.Message, now_us: int, data: bytes = b"") -> None:
        self.by_topic.setdefault(topic.name, []).append(message)


def drive_for(messages: Messages, *sets: str) -> Drive:
    drive = build_drive(TrialCase(world="river", seed=1, policy=Policy.ORACLE), sets, threads=True, tap=messages)
    try:
        while drive.plant.sim_us < SECONDS * 1e6:
            drive.step()
        return drive
    finally:
        drive.close()


@pytest.mark.slow
def test_a_boat_with_a_range_scanner_plans_with_its_scans() -> None:
    messages = Messages()
    drive = drive_for(messages, "plant.sensors.lidar=true")
    scans = messages.by_topic[keys.SCAN.name]
    assert len(scans) == pytest.approx(SECONDS * keys.SCAN.rate_hz, abs=2)
    remembered = drive.autonomy._navigator.state.planner_state.memory.scans
    assert remembered[-1].stamp_us == scans[-1].source_us
    assert len(remembered) > 8


@pytest.mark.slow
def test_a_boat_without_has_none_and_one_without_an_ais_receiver_hears_nobody() -> None:
    messages = Messages()
    drive = drive_for(messages, "plant.sensors.ais=false")
    assert not {keys.SCAN.name, keys.AIS.name} & set(messages.by_topic)
    assert drive.autonomy._navigator.state.planner_state.memory.scans == ()
