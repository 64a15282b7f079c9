"""Fingerprint of code, models, settings and scenario, so that a stored result of other ones is not reused."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

import msgspec

from paani.config import encode_config
from paani.source_checksum import checksum_files, checksum_packages
from paani_sim.trials.policies import load_policy_config
from paani_sim.trials.trial_cases import TrialCase

SCENARIO_SUFFIX = ".toml"
CODE_PACKAGES = ("paani", "paani_services", "paani_sim")
CODE_SUFFIXES = (".py", SCENARIO_SUFFIX)
MODELS_PACKAGE = "paani_models"


class Fingerprint(msgspec.Struct, frozen=True, kw_only=True):
    """Checksums of everything that a result depends on."""

    code: str
    models: str
    settings: str
    scenario: str

    def list_differences(self, other: Fingerprint) -> list[str]:
        """Names of the checksums that differ."""
        return [name for name in self.__struct_fields__ if getattr(self, name) != getattr(other, name)]


class FingerprintReader:
    """Computes fingerprints; code and models are read once."""

    def __init__(self, sets: Iterable[str]) -> None:
        """Raises UserError for a setting."""
        self._sets = tuple(sets)
        self._code = checksum_packages(CODE_PACKAGES, CODE_SUFFIXES)
        self._models = checksum_packages((MODELS_PACKAGE,), (".onnx", ".json", ".py"))
        self._settings: dict[str, str] = {}

    def fingerprint(self, case: TrialCase) -> Fingerprint:
        """Fingerprint of one case. Raises UserError for a setting."""
        if case.policy not in self._settings:
            self._settings[case.policy] = _checksum(encode_config(load_policy_config(case.policy, self._sets)))
        return Fingerprint(
            code=self._code,
            models=self._models,
            settings=self._settings[case.policy],
            scenario=checksum_files([Path(case.world)]) if case.world.endswith(SCENARIO_SUFFIX) else case.condition,
        )


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
