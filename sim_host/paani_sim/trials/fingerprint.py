"""What a result was made with, so that results of other code, models or settings are not taken for the same."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

import msgspec

from paani.config import encode_config
from paani_sim.trials.cases import Case
from paani_sim.trials.policies import config_of

TOML = ".toml"
PACKAGES = ("paani", "paani_services", "paani_sim")
DRIVING = (".py", TOML)
MODELS = "paani_models"


class MadeWith(msgspec.Struct, frozen=True, kw_only=True):
    """Checksums."""

    code: str
    models: str
    settings: str
    scenario: str

    def differs(self, other: MadeWith) -> list[str]:
        """The names of what is not the same."""
        return [name for name in self.__struct_fields__ if getattr(self, name) != getattr(other, name)]


class Maker:
    """Looks at the code and the models once."""

    def __init__(self, sets: Iterable[str]) -> None:
        """Raises UserError for a setting."""
        self._sets = tuple(sets)
        self._code = _sum(file for package in PACKAGES for file in _files(package, DRIVING))
        self._models = _sum(_files(MODELS, (".onnx", ".json", ".py")))
        self._settings: dict[str, str] = {}

    def of(self, case: Case) -> MadeWith:
        """For one drive. Raises UserError for a setting."""
        if case.policy not in self._settings:
            self._settings[case.policy] = _short(encode_config(config_of(case.policy, self._sets)))
        return MadeWith(
            code=self._code,
            models=self._models,
            settings=self._settings[case.policy],
            scenario=_sum([Path(case.world)]) if case.world.endswith(TOML) else case.place,
        )


def _files(package: str, endings: tuple[str, ...]) -> list[Path]:
    spec = find_spec(package)
    folders = list(spec.submodule_search_locations or ()) if spec is not None else []
    return sorted(file for folder in folders for file in Path(folder).rglob("*") if file.suffix in endings)


def _sum(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
