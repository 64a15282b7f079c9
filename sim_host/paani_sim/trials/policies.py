"""The policies that a trial compares, and their configurations."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

import msgspec

from paani.config import Config, calibration_of, load_config
from paani.motion_planning import MotionPlanner
from paani_sim.trials.peers.bendy_ruler import plan_bendy_ruler
from paani_sim.trials.peers.dynamic_window import plan_dynamic_window
from paani_sim.trials.peers.velocity_obstacles import plan_velocity_obstacles

NOMINAL_SPEED_MPS = Config().navigator.cruise_mps


class Policy(StrEnum):
    """Where evidence comes from and which profile decides.

    PAANI: camera and deciders of the profile `paani`, which `paani up` runs where none is asked for. PAANI_WIDE: those
    of the profile `wide`. PAPER: those of the profile `paper`, at its rates and speed. BLIND: PAANI without evidence
    and without a planner. ORACLE: PAANI with evidence from ground truth. BENDY_RULER, DWA, VO: PAANI with a planner of
    the literature in place of the navigator's own.
    """

    PAANI = "paani"
    PAANI_WIDE = "paani-wide"
    PAPER = "paper"
    BLIND = "blind"
    ORACLE = "oracle"
    BENDY_RULER = "bendy-ruler"
    DWA = "dwa"
    VO = "vo"


PEERS: dict[Policy, MotionPlanner] = {
    Policy.BENDY_RULER: plan_bendy_ruler,
    Policy.DWA: plan_dynamic_window,
    Policy.VO: plan_velocity_obstacles,
}
CAMERA_POLICIES = frozenset({Policy.PAANI, Policy.PAANI_WIDE, Policy.PAPER, *PEERS})
OWN_PROFILE = {Policy.PAANI_WIDE: "wide", Policy.PAPER: "paper"}  # of policies whose profile no setting changes


def load_policy_config(policy: Policy, sets: Iterable[str] = (), *, threads: bool = False) -> Config:
    """Load the configuration of a policy; `sets` may choose another profile for policies without one of their own.

    threads: run the two networks side by side, for a drive that has two cores; their outputs are the same.
    """
    if policy in OWN_PROFILE:
        config = load_config(
            profile=OWN_PROFILE[policy], sets=[each for each in sets if not each.startswith("profile=")]
        )
    else:
        blind = ("navigator.planner.use=false",) if policy is Policy.BLIND else ()
        config = load_config(sets=(*blind, *sets))
    return msgspec.structs.replace(
        config,
        perception=msgspec.structs.replace(config.perception, concurrent=threads, intra_op_threads=1),
        calibration=config.calibration if config.calibration.valid else calibration_of(config.eye),
    )


def time_limit_factor(config: Config) -> float:
    """Factor on a scenario's time limit, which is set for the default cruising speed."""
    return NOMINAL_SPEED_MPS / config.navigator.cruise_mps


def processed_frame_rate_hz(config: Config) -> float:
    """Rate of the pictures that perception processes."""
    return min(config.eye.rate_hz, config.camera.rate_hz, config.perception.rate_hz)
