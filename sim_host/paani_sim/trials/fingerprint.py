"""Fingerprint of code, models, settings and scenario, so that a stored result of other ones is not reused."""

from __future__ import annotations

import hashlib
import platform
import tomllib
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import msgspec
import numpy as np

from paani.config import encode_config
from paani.source_checksum import checksum_files, checksum_packages
from paani.undecodable import UNREADABLE
from paani_sim.trials.policies import load_policy_config
from paani_sim.trials.trial_cases import TrialCase

SCENARIO_SUFFIX = ".toml"
CODE_PACKAGES = ("paani", "paani_services", "paani_sim")
CODE_SUFFIXES = (".py", SCENARIO_SUFFIX)
MODELS_PACKAGE = "paani_models"
COMPUTING = ("numpy", "onnxruntime", "opencv-python-headless", "mujoco")


class Fingerprint(msgspec.Struct, frozen=True, kw_only=True):
    """Checksums of everything that a result depends on.

    settings, scenario: with the files that these name. machine: what of the processor and of the libraries decides the
    last bits of a picture and of what a network makes of it.
    """

    code: str
    models: str
    settings: str
    scenario: str
    machine: str = ""

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
        self._machine = _checksum(describe_machine().encode())

    def fingerprint(self, case: TrialCase) -> Fingerprint:
        """Fingerprint of one case. Raises UserError for a setting."""
        if case.policy not in self._settings:
            config = load_policy_config(case.policy, self._sets)
            self._settings[case.policy] = _checksum(encode_config(config) + _read_named(msgspec.to_builtins(config)))
        return Fingerprint(
            code=self._code,
            models=self._models,
            settings=self._settings[case.policy],
            scenario=_checksum_scenario(Path(case.world)) if case.world.endswith(SCENARIO_SUFFIX) else case.condition,
            machine=self._machine,
        )


def describe_machine() -> str:
    """Processor features that numpy's code is chosen by, and versions of what computes."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    versions = [f"{name} {version(name)}" for name in COMPUTING]
    return " ".join((platform.machine(), *features, *versions))


def _checksum_scenario(file: Path) -> str:
    """Of a scenario's file and of those that it names."""
    try:
        named = _read_named(tomllib.loads(file.read_text(encoding="utf-8-sig")))
    except UNREADABLE:
        named = b""  # loading it names the fault
    return _checksum(checksum_files([file]).encode() + named)


def _read_named(settings: object) -> bytes:
    """The content of every file that these settings name."""
    match settings:
        case dict():
            return b"".join(map(_read_named, settings.values()))
        case list() | tuple():
            return b"".join(map(_read_named, settings))
        case str() if settings and Path(settings).is_file():
            return checksum_files([Path(settings)]).encode()
        case _:
            return b""


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
