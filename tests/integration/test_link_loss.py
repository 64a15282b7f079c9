"""The plant of a scenario that cuts the link: what the board says does not arrive, and the board gets no time."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Latest
from paani.clock import WallClock
from tests.conftest import OpenAs, Spawn

pytestmark = pytest.mark.integration

START_S, LOST_S, ZERO_S, BACK_S = 6.0, 3.0, 0.5, 1.0
SCENARIO = (
    '[world]\nkind = "lake"\nobstacles = false\nactors = false\n'
    f'[[faults]]\nkind = "link_loss"\nstart_s = {START_S}\nduration_s = {LOST_S}\n'
)
CLOCK = WallClock()


async def test_the_last_gate_hears_no_board_over_a_lost_link(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """W4: zero within 0.5 s though thrust and pulses go on being sent; force again when the link is back."""
    (tmp_path / "cut.toml").write_text(SCENARIO)
    host, board, eyes = await open_as("dashboard"), await open_as("controller"), await open_as("perception")
    time, poses, applied = host.latest(keys.SIM_TIME), host.latest(keys.TRUE_POSE), list[m.ThrustApplied]()
    host.on(keys.THRUST_APPLIED, applied.append)
    at_s: dict[int, float] = {}
    host.on(keys.TRUE_POSE, lambda pose: at_s.__setitem__(pose.source_us, pose.sim_us * 1e-6))
    operator = await open_as("operator")
    arming, thrust = operator.publisher(keys.ARMING), board.publisher(keys.THRUST)
    pulse = eyes.publisher(keys.pulse("perception"))
    heard_s = list[float]()
    async with spawn("plant", f"world.name={tmp_path / 'cut.toml'}", 'plant.adapter.require_pulses=["perception"]'):
        while now_s(poses) < START_S + LOST_S + 2.0:
            now_us = CLOCK.now_us()
            arming.put(m.Arming(source_us=now_us, armed=True))
            pulse.put(m.Pulse(source_us=now_us))
            if time.value is not None:
                heard_s.append(time.value.sim_us * 1e-6)
                thrust.put(
                    m.Thrust(source_us=now_us, left=0.1, right=0.1, enabled=True, echo_us=time.value.stamp_us)
                )  # fmt: skip
            await asyncio.sleep(0.05)

    forces = [(at_s[a.source_us], a.left_n + a.right_n, a.zero_cause) for a in applied if a.source_us in at_s]
    before = [force for t_s, force, _ in forces if START_S - 1.0 < t_s < START_S]
    during = [(force, cause) for t_s, force, cause in forces if START_S + ZERO_S < t_s < START_S + LOST_S]
    after = [force for t_s, force, _ in forces if t_s > START_S + LOST_S + BACK_S]
    assert min(before) > 0.0
    assert len(during) > 20
    assert {force for force, _ in during} == {0.0}
    assert {cause for _, cause in during} <= {m.ZeroCause.PULSE_LOST, m.ZeroCause.TIMEOUT}
    assert min(after) > 0.0
    assert not [t_s for t_s in heard_s if START_S + 0.02 < t_s < START_S + LOST_S]


def now_s(poses: Latest[m.TruePose]) -> float:
    return poses.value.sim_us * 1e-6 if poses.value is not None else 0.0
