"""What may drive the boat in a trial."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

import msgspec

from paani.config import Config, calibration_of, load_config

NOMINAL_SPEED_MPS = Config().navigator.cruise_mps


class Policy(StrEnum):
    """Who sees and who decides.

    PAANI: camera and deciders of the profile `wide`. PAPER: those of the profile `paper`, at its rates and speed.
    BLIND: follows the route without looking, and without a planner. ORACLE: `paani` with evidence from truth.
    """

    PAANI = "paani"
    PAPER = "paper"
    BLIND = "blind"
    ORACLE = "oracle"


CAMERA_POLICIES = frozenset({Policy.PAANI, Policy.PAPER})


def load_policy_config(policy: Policy, sets: Iterable[str] = (), *, threads: bool = False) -> Config:
    """Its settings; `sets` may choose another profile for those that are not the paper's.

    threads: the two nets side by side, for a drive that has two cores; what they say is the same.
    """
    if policy is Policy.PAPER:
        config = load_config(profile="paper", sets=[each for each in sets if not each.startswith("profile=")])
    else:
        blind = ("navigator.planner.use=false",) if policy is Policy.BLIND else ()
        config = load_config(sets=("profile=wide", *blind, *sets))
    return msgspec.structs.replace(
        config,
        perception=msgspec.structs.replace(config.perception, concurrent=threads, intra_op_threads=1),
        calibration=config.calibration if config.calibration.valid else calibration_of(config.eye),
    )


def time_limit_factor(config: Config) -> float:
    """A scenario's time limit is for the default cruising speed; who is told to go slower has longer."""
    return NOMINAL_SPEED_MPS / config.navigator.cruise_mps


def processed_frame_rate_hz(config: Config) -> float:
    """How often a picture is taken that is also looked at."""
    return min(config.eye.rate_hz, config.camera.rate_hz, config.perception.rate_hz)
