"""Whether this installation can stand in for the one that recorded a log: settings, version, weights."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from paani.config import Config, decode_config
from paani.config.loading import with_present_names
from paani.config.section import Section
from paani.errors import UserError
from paani.logs.reader import CONFIG_FILE, Log
from paani.undecodable import UNDECODABLE

MODELS_FILE, VERSIONS_FILE = "models.json", "versions.json"
WEIGHTS_PACKAGE = "paani_models"  # looked up, not imported: the contract depends on no model
MANIFEST = Path("weights") / "manifest.json"


class _Model(msgspec.Struct):
    name: str
    sha256: str


class _Manifest(msgspec.Struct):
    models: tuple[_Model, ...]


class _Versions(msgspec.Struct):
    paani: str = ""


class Provenance(msgspec.Struct, frozen=True):
    """The settings to compute with, and what to tell about where the log came from."""

    config: Config
    notes: tuple[str, ...]


def provenance_of(log: Log, *, force: bool) -> Provenance:
    """Judge a log. Raises UserError for what needs `--force`, naming what it means."""
    notes: list[str] = []
    config = _config(log, notes, force=force)
    recorded, here = recorded_version(log), importlib.metadata.version("paani")
    if recorded and recorded != here:
        notes.append(
            f"recorded by paani {recorded}, computed by paani {here}: differences may be those of the versions"
        )
    changed = _changed_weights(log)
    if changed:
        text = f"the evidence was made by other weights than those installed ({', '.join(changed)})"
        if not force:
            raise UserError(
                f"{log.path}: {text}: decisions can be computed from the recorded evidence, "
                "but not the evidence from the pictures (--force goes on)"
            )
        notes.append(f"{text}: decisions are computed from the recorded evidence")
    return Provenance(config, tuple(notes))


def recorded_version(log: Log) -> str:
    """The version of paani that recorded the log; empty where it does not say."""
    data = log.attachment(VERSIONS_FILE)
    if data is None:
        return ""
    try:
        return msgspec.json.decode(data, type=_Versions).paani
    except UNDECODABLE:
        return ""


def _config(log: Log, notes: list[str], *, force: bool) -> Config:
    try:
        return log.config()
    except UserError as error:
        data = log.attachment(CONFIG_FILE)
        if data is None:
            raise
        if not force:
            raise UserError(f"{error} (of another version? --force leaves out what is unknown)") from error
    try:
        tree = with_present_names(msgspec.json.decode(data, type=dict[str, Any]))
    except UNDECODABLE as error:
        raise UserError(f"{log.path}: {CONFIG_FILE}: {error}") from error
    dropped = list(_drop_unknown(tree, Config, ""))
    try:
        config = decode_config(msgspec.json.encode(tree))
    except UserError as error:
        raise UserError(f"{log.path}: {CONFIG_FILE}: {error}") from error
    notes.append(f"settings unknown to this version are left out: {', '.join(dropped)}")
    return config


def _drop_unknown(tree: dict[str, Any], section: type[Section], path: str) -> Iterator[str]:
    fields = {field.name: field.type for field in msgspec.structs.fields(section)}
    for name in list(tree):
        kind = fields.get(name)
        if kind is None:
            del tree[name]
            yield f"{path}{name}"
        elif isinstance(kind, type) and issubclass(kind, Section) and isinstance(tree[name], dict):
            yield from _drop_unknown(tree[name], kind, f"{path}{name}.")


def _changed_weights(log: Log) -> list[str]:
    """Names of models whose checksum in the log is not that of the installed weights; empty where either is unknown."""
    recorded, installed = _checksums(log.attachment(MODELS_FILE)), _checksums(_installed_manifest())
    return sorted(name for name in recorded.keys() & installed.keys() if recorded[name] != installed[name])


def _checksums(data: bytes | None) -> dict[str, str]:
    try:
        manifest = msgspec.json.decode(data or b"{}", type=_Manifest)
    except UNDECODABLE:
        return {}
    return {model.name: model.sha256 for model in manifest.models}


def _installed_manifest() -> bytes | None:
    spec = importlib.util.find_spec(WEIGHTS_PACKAGE)
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder) / MANIFEST
        if path.is_file():
            return path.read_bytes()
    return None
