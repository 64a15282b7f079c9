"""Runs one case in this process: build the scenario, drive, score."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from paani.clock import process_cpu_s, stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani_sim.trials.conditions import WIND, parse_setting
from paani_sim.trials.drive import Drive
from paani_sim.trials.evidence_source import CameraEvidenceSource, EvidenceSource
from paani_sim.trials.ground_truth_evidence import GroundTruthEvidenceSource
from paani_sim.trials.lockstep_bus import MessageTap
from paani_sim.trials.policies import CAMERA_POLICIES, PEERS, Policy, load_policy_config
from paani_sim.trials.result import TrialResult
from paani_sim.trials.scoring import score_drive
from paani_sim.trials.trial_cases import TrialCase, build_scenario
from paani_sim.vessels import load_vessel
from paani_sim.worlds import Scenario


class ComputeEffort(msgspec.Struct, frozen=True, kw_only=True):
    """Time that the drive took. It differs from run to run and so is no part of the result."""

    wall_s: float
    cpu_s: float
    simulated_s: float


def open_evidence_source(policy: Policy, scenario: Scenario, config: Config) -> EvidenceSource | None:
    """Open the policy's source of evidence; None for BLIND. Raises UserError where there is no OpenGL."""
    if policy in CAMERA_POLICIES:
        return CameraEvidenceSource(scenario.world, scenario.faults, config)
    return GroundTruthEvidenceSource(scenario.world, scenario.faults, config) if policy is Policy.ORACLE else None


def load_case_config(case: TrialCase, sets: Iterable[str] = (), *, threads: bool = False) -> Config:
    """Load the policy's configuration with the scenario's vessel. Raises UserError for the scenario or a setting."""
    config, vessel = load_policy_config(case.policy, sets, threads=threads), build_scenario(case).vessel
    if vessel == Scenario.vessel:
        return config
    return msgspec.structs.replace(config, plant=msgspec.structs.replace(config.plant, vessel=vessel))


def require_swept_effect(case: TrialCase, sets: Iterable[str] = ()) -> None:
    """Raises UserError where the swept condition is a wind that does not move the case's boat."""
    if not case.swept or parse_setting(case.swept)[0] != WIND:
        return
    name = load_case_config(case, sets).plant.vessel or Scenario.vessel
    windage = load_vessel(name).windage
    if windage.frontal_area_m2 == windage.lateral_area_m2 == 0.0:
        raise UserError(f"--sweep {WIND}: plant.vessel {name} has no windage, so wind moves it at no speed")


def build_drive(
    case: TrialCase, sets: Iterable[str] = (), *, threads: bool = False, tap: MessageTap | None = None
) -> Drive:
    """Build a drive, to be closed by the caller. Raises UserError for the scenario or a setting."""
    config, scenario = load_case_config(case, sets, threads=threads), build_scenario(case)
    evidence_source = open_evidence_source(case.policy, scenario, config)
    try:
        return Drive(scenario, config, evidence_source, tap=tap, planner=PEERS.get(case.policy))
    except BaseException:
        if evidence_source is not None:
            evidence_source.close()
        raise


def run_trial(
    case: TrialCase, sets: Iterable[str] = (), *, threads: bool = False, tap: MessageTap | None = None
) -> tuple[TrialResult, ComputeEffort]:
    """Run a case to its end and score it. Raises UserError as `build_drive`."""
    wall_ms, cpu_s = stopwatch_ms(), process_cpu_s()
    drive = build_drive(case, sets, threads=threads, tap=tap)
    try:
        drive.run()
        result = score_drive(drive, case.policy)
        simulated_s = drive.plant.sim_us * 1e-6
    finally:
        drive.close()
    effort = ComputeEffort(
        wall_s=round((stopwatch_ms() - wall_ms) * 1e-3, 3),
        cpu_s=round(process_cpu_s() - cpu_s, 3),
        simulated_s=round(simulated_s, 2),
    )
    return result, effort
