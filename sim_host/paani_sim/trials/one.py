"""One trial in this process: scenario, drive, score."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from paani.clock import process_cpu_s, stopwatch_ms
from paani.config import Config
from paani_sim.trials.cases import Case, scenario_of
from paani_sim.trials.drive import Drive
from paani_sim.trials.evidence_source import CameraEyes, Eyes
from paani_sim.trials.ground_truth_evidence import OracleEyes
from paani_sim.trials.lockstep_bus import MessageTap
from paani_sim.trials.policies import CAMERA, Policy, config_of
from paani_sim.trials.result import TrialResult
from paani_sim.trials.scoring import score
from paani_sim.worlds import Scenario


class Effort(msgspec.Struct, frozen=True, kw_only=True):
    """What the drive cost: no part of the result, for it differs each time."""

    wall_s: float
    cpu_s: float
    simulated_s: float


def eyes_of(policy: Policy, scenario: Scenario, config: Config) -> Eyes | None:
    """Who looks. Raises UserError where there is no OpenGL."""
    if policy in CAMERA:
        return CameraEyes(scenario.world, scenario.faults, config)
    return OracleEyes(scenario.world, scenario.faults, config) if policy is Policy.ORACLE else None


def config_for(case: Case, sets: Iterable[str] = (), *, threads: bool = False) -> Config:
    """The policy's settings with the scenario's vessel. Raises UserError for the scenario or a setting."""
    config, vessel = config_of(case.policy, sets, threads=threads), scenario_of(case).vessel
    if vessel == Scenario.vessel:
        return config
    return msgspec.structs.replace(config, plant=msgspec.structs.replace(config.plant, vessel=vessel))


def drive_of(case: Case, sets: Iterable[str] = (), *, threads: bool = False, tap: MessageTap | None = None) -> Drive:
    """Ready to begin; to be closed. Raises UserError for the scenario or a setting."""
    config, scenario = config_for(case, sets, threads=threads), scenario_of(case)
    eyes = eyes_of(case.policy, scenario, config)
    try:
        return Drive(scenario, config, eyes, tap=tap)
    except BaseException:
        if eyes is not None:
            eyes.close()
        raise


def run_case(
    case: Case, sets: Iterable[str] = (), *, threads: bool = False, tap: MessageTap | None = None
) -> tuple[TrialResult, Effort]:
    """Drive to the end and score. Raises UserError as `drive_of`."""
    wall_ms, cpu_s = stopwatch_ms(), process_cpu_s()
    drive = drive_of(case, sets, threads=threads, tap=tap)
    try:
        drive.run()
        result = score(drive, case.policy)
        simulated_s = drive.plant.sim_us * 1e-6
    finally:
        drive.close()
    effort = Effort(
        wall_s=round((stopwatch_ms() - wall_ms) * 1e-3, 3),
        cpu_s=round(process_cpu_s() - cpu_s, 3),
        simulated_s=round(simulated_s, 2),
    )
    return result, effort
