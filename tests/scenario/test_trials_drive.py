"""Drives in lockstep: repeatable to the byte, ended by what ends them, safe when the camera fails."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from paani import messages as m
from paani.config import Config
from paani_sim.eye.configured_camera import boat_pose, build_camera
from paani_sim.eye.labels import WATER_CODE
from paani_sim.eye.renderer import Eye
from paani_sim.trials.drive import Drive
from paani_sim.trials.drive_states import DriveOutcome, DrivePhase
from paani_sim.trials.evidence_source import CameraEvidenceSource
from paani_sim.trials.ground_truth_evidence import GroundTruthEvidenceSource, find_water_edge, level_mask
from paani_sim.trials.policies import Policy, load_policy_config, time_limit_factor
from paani_sim.trials.result import TrialResult
from paani_sim.trials.run_trial import open_evidence_source
from paani_sim.trials.scoring import score_drive
from paani_sim.worlds import Fault, FaultKind, Scenario, Task, load_world

Launch = Callable[..., Drive]
VESSEL = Path("sim_host/paani_sim/vessels/paper.toml")


def scenario(distance_m: float, limit_s: float = 60.0, *faults: Fault, alone: bool = False, seed: int = 1) -> Scenario:
    world = load_world("lake")
    if alone:
        world = dataclasses.replace(world, obstacles=(), actors=())
    return Scenario("test", world, seed, task=Task(distance_m, limit_s), faults=faults)


@pytest.fixture
def launch() -> Iterator[Launch]:
    opened: list[Drive] = []

    def make(given: Scenario, policy: Policy, config: Config | None = None) -> Drive:
        config = config or load_policy_config(policy)
        opened.append(Drive(given, config, open_evidence_source(policy, given, config)))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def result_of(drive: Drive, policy: Policy) -> TrialResult:
    drive.run()
    return score_drive(drive, policy)


def test_the_same_drive_twice_is_the_same_to_the_byte(launch: Launch) -> None:
    """W14: seed, scenario and policy make the result; another seed makes another."""

    def once(seed: int) -> bytes:
        return msgspec.json.encode(result_of(launch(scenario(2.0, seed=seed), Policy.ORACLE), Policy.ORACLE))

    assert once(1) == once(1)
    assert once(1) != once(2)


def test_ready_running_finished(launch: Launch) -> None:
    """Disarmed until the boat could go; done when the task's distance is."""
    drive = launch(scenario(4.0, alone=True), Policy.ORACLE)
    seen = [drive.phase]
    while drive.phase is not DrivePhase.FINISHED:
        drive.step()
        if drive.phase is not seen[-1]:
            seen.append(drive.phase)
        assert drive.phase is not DrivePhase.READY or drive.applied.left_n == 0.0
    assert seen == [DrivePhase.READY, DrivePhase.RUNNING, DrivePhase.FINISHED]
    result = score_drive(drive, Policy.ORACLE)
    assert (result.why, result.completed) == (DriveOutcome.COMPLETED, True)
    assert 4.0 <= result.progress_m < 4.3
    assert result.collisions == 0
    assert result.latency.p50_s == pytest.approx(0.1, abs=0.011)
    assert result.limit_s == 60.0


def test_a_drive_ends_at_its_time_limit(launch: Launch) -> None:
    result = result_of(launch(scenario(50.0, 3.0), Policy.BLIND), Policy.BLIND)
    assert (result.why, result.completed) == (DriveOutcome.TIME_LIMIT, False)
    assert result.seconds == pytest.approx(3.0)
    assert result.latency.samples == 0


@pytest.mark.rotating(cpu_s=6)
def test_a_drive_ends_after_two_minutes_without_progress(launch: Launch) -> None:
    given = scenario(50.0, 200.0, Fault(FaultKind.LINK_LOSS, 4.0, 200.0), alone=True)
    result = result_of(launch(given, Policy.BLIND), Policy.BLIND)
    assert (result.why, result.completed) == (DriveOutcome.STALLED, False)
    assert 120.0 <= result.seconds < 130.0


def test_slower_policies_have_longer() -> None:
    """The paper cruises at 0.15 m/s (M7), a quarter of the default."""
    assert time_limit_factor(load_policy_config(Policy.PAPER)) == pytest.approx(4.0)
    assert time_limit_factor(load_policy_config(Policy.PAANI)) == 1.0


def test_diverging_integration_is_a_failure(launch: Launch, tmp_path: Path) -> None:
    """A vessel whose drag no step of 10 ms can follow: the trial ends, and not as a success."""
    file = tmp_path / "stiff.toml"
    file.write_text(VESSEL.read_text().replace("surge_linear = 4.0", "surge_linear = 9e8"))
    drive = launch(scenario(4.0), Policy.BLIND, load_policy_config(Policy.BLIND, [f'plant.vessel="{file}"']))
    drive.plant.place(*drive.plant.position_m, 0.3)
    result = result_of(drive, Policy.BLIND)
    assert (result.why, result.completed) == (DriveOutcome.DIVERGED, False)
    assert "not finite" in result.error


@pytest.mark.parametrize("kind", [FaultKind.CAMERA_BLACK, FaultKind.CAMERA_BLURRED])
def test_unusable_camera_stops_within_a_frame_and_half_a_second(launch: Launch, kind: FaultKind) -> None:
    """W4: and it stays stopped until the fault is over."""
    given = scenario(60.0, 12.0, Fault(kind, 6.13, 4.0), alone=True)
    [reaction] = result_of(launch(given, Policy.ORACLE), Policy.ORACLE).reactions
    assert reaction.in_time
    assert reaction.zero_thrust_s is not None
    assert reaction.zero_thrust_s <= 0.7


@pytest.mark.gl
@pytest.mark.parametrize("kind", [FaultKind.CAMERA_BLACK, FaultKind.CAMERA_BLURRED])
def test_unusable_rendered_camera_stops_the_boat(launch: Launch, kind: FaultKind) -> None:
    """W4 through rendering, image-quality check and networks."""
    given = scenario(60.0, 9.0, Fault(kind, 6.0, 4.0), alone=True)
    result = result_of(launch(given, Policy.PAANI), Policy.PAANI)
    [reaction] = result.reactions
    assert reaction.in_time
    assert result.unusable > 0


@pytest.mark.gl
@pytest.mark.parametrize("policy", [Policy.PAANI, Policy.PAANI_WIDE, Policy.PAPER])
def test_a_policy_of_a_camera_sees_by_rendered_pictures_alone(policy: Policy) -> None:
    """W14: no evidence from ground truth."""
    given = scenario(1.0)
    source = open_evidence_source(policy, given, load_policy_config(policy))
    assert isinstance(source, CameraEvidenceSource)
    source.close()


@pytest.mark.gl
def test_rendered_drives_repeat_to_the_byte(launch: Launch) -> None:
    """W14 with rendering and inference."""
    found = [result_of(launch(scenario(1.0), Policy.PAANI), Policy.PAANI) for _ in range(2)]
    assert msgspec.json.encode(found[0]) == msgspec.json.encode(found[1])
    assert found[0].frames > 10


def test_nothing_crosses_a_lost_link(launch: Launch) -> None:
    """No thrust, no pulse: the thrust adapter applies zero within half a second, and resumes when the link is back."""
    drive = launch(scenario(60.0, 12.0, Fault(FaultKind.LINK_LOSS, 6.0, 2.0), alone=True), Policy.ORACLE)
    forces: dict[float, float] = {}
    while drive.phase is not DrivePhase.FINISHED:
        drive.step()
        forces[round(drive.plant.sim_us * 1e-6, 2)] = drive.applied.left_n
    assert forces[5.9] > 0.0
    assert all(force == 0.0 for t_s, force in forces.items() if 6.51 < t_s < 8.0)
    assert forces[9.5] > 0.0


@pytest.mark.parametrize("down_deg", [6.0, 0.0])
def test_ground_truth_evidence_agrees_with_the_renderer(down_deg: float) -> None:
    """Things that face the boat, by label; nothing that the shore hides or the boat has passed; level cameras too."""
    world, config = load_world("river"), load_policy_config(Policy.ORACLE, [f"eye.pitch_down_deg={down_deg}"])
    evidence_source = GroundTruthEvidenceSource(world, (), config)
    start = world.start
    truth = m.TruePose(
        source_us=0, sim_us=0, x_m=start.x_m, y_m=start.y_m, z_m=0.177, roll_rad=0.0, pitch_rad=0.0,
        yaw_rad=start.yaw_rad, surge_mps=0.0, sway_mps=0.0, yaw_rate_radps=0.0,
    )  # fmt: skip
    seen = evidence_source.compute_visible_scene(truth)
    assert {label for label, _ in seen.boxes} >= {m.Label.BUOY}
    assert seen.water[-1].all()
    assert not seen.water[:20].any()
    assert all(0.0 <= x1 < x2 <= 1.0 and 0.0 <= y1 < y2 <= 1.0 for _, (x1, y1, x2, y2) in seen.boxes)


@pytest.mark.rotating(cpu_s=5)
@pytest.mark.gl
@pytest.mark.parametrize("name", ["river", "lake"])
def test_ground_truth_water_is_the_rendered_water(name: str) -> None:
    """Mask against the label picture along the route: 0.95 of intersection over union on average."""
    world, config = load_world(name), load_policy_config(Policy.ORACLE)
    oracle, camera = GroundTruthEvidenceSource(world, (), config), Eye(world, build_camera(config.eye))
    found = []
    for k in range(0, len(world.route_m), 12):
        here, there = world.route_m[k], world.route_m[(k + 1) % len(world.route_m)]
        truth = m.TruePose(
            source_us=0, sim_us=0, x_m=here[0], y_m=here[1], z_m=0.177, roll_rad=0.04, pitch_rad=0.02,
            yaw_rad=float(np.arctan2(*(there - here)[::-1])), surge_mps=0.0, sway_mps=0.0, yaw_rate_radps=0.0,
        )  # fmt: skip
        drawn = camera.render_labelled(boat_pose(truth), 0.0).mask == WATER_CODE
        rows = ((np.arange(64) + 0.5) / 64 * drawn.shape[0]).astype(int)
        columns = ((np.arange(80) + 0.5) / 80 * drawn.shape[1]).astype(int)
        water = drawn[rows[:, None], columns[None, :]]
        seen = oracle.compute_visible_scene(truth).water
        found.append((water & seen).sum() / max(1, (water | seen).sum()))
    camera.close()
    assert np.mean(found) > 0.95


def test_water_edge_of_each_column() -> None:
    """The lower edge of the first cell that is no water, from below."""
    water = np.zeros((4, 3), np.bool_)
    water[2:, 0] = True
    water[1, 0] = False
    water[:, 1] = True
    assert find_water_edge(water) == (0.5, 0.0, 1.0)


def test_level_mask_turns_as_the_picture_does() -> None:
    """Starboard down by 0.1: the horizon in the picture climbs to the right, and is level again afterwards."""
    x = ((np.arange(80) + 0.5) / 80 - 0.5) * 4.0 / 3.0
    y = (np.arange(64) + 0.5) / 64 - 0.5
    tilted = y[:, None] > -np.tan(0.1) * x[None, :]
    flat = level_mask(tilted, -0.1, 4.0 / 3.0) | level_mask(tilted, 0.1, 4.0 / 3.0)
    assert flat[36:60, 20:60].all()
