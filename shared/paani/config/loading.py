"""Layered settings: defaults < profile < TOML file < environment < `--set`."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from paani.config.profiles import PROFILES
from paani.config.tree import Config
from paani.errors import UserError
from paani.undecodable import UNDECODABLE

ENV_PREFIX = "PAANI_"
NOT_SETTINGS = frozenset({"PAANI_DATA", "PAANI_RUNTIME_DIR", "PAANI_CONFIG_JSON", "PAANI_ARDUROVER"})
MAX_SHOWN = 200  # characters of a setting that an error repeats
# Earlier names of settings and sections, and their present ones: old files, `--set` paths and recordings still load.
RENAMED_SETTINGS = {
    "dashboard.arm_at_start": "up.arm_at_start",
    "perception.gate": "perception.image_quality",
    "perception.fallback_non_water": "advisor.fallback_non_water",
    "perception.fallback_uncertainty": "advisor.fallback_uncertainty",
}


def load_config(
    *,
    profile: str | None = None,
    file: Path | None = None,
    environ: Mapping[str, str] | None = None,
    sets: Iterable[str] = (),
) -> Config:
    """Build the configuration.

    sets: `section.field=value` strings; values are read as TOML, else as plain text.
    Raises UserError with one line that names the file, variable or field at fault.
    """
    layers: list[tuple[str, dict[str, object]]] = []
    if file is not None:
        layers.append(_layer(str(file), _read_settings(file)))
    layers.append(_layer("environment", _from_environ(environ or {})))
    layers += [_layer(_set_name(text), _from_set(text)) for text in sets]

    chosen = "paani" if profile is None else _known_profile(profile, "")
    for origin, layer in layers:
        if "profile" in layer:
            named = _known_profile(layer.pop("profile"), f"{origin}: ")
            chosen = named if profile is None else chosen

    try:
        return _convert(_merged(chosen, layers))
    except UNDECODABLE as error:
        raise UserError(f"{_where_begun(error, chosen, layers)}: {_with_path(str(error))}") from error


def _merged(profile: str, layers: Iterable[tuple[str, dict[str, object]]]) -> dict[str, object]:
    """The values of the profile, with those of the layers in their place."""
    tree: dict[str, object] = {}
    _merge(tree, {**PROFILES[profile], "profile": profile})
    for _, layer in layers:
        _merge(tree, layer)
    return tree


def _known_profile(named: object, where: str) -> str:
    if not isinstance(named, str) or named not in PROFILES:
        raise UserError(f"{where}profile: unknown profile '{str(named)[:60]}' (one of {', '.join(PROFILES)})")
    return named


def _where_begun(error: Exception, profile: str, layers: list[tuple[str, dict[str, object]]]) -> str:
    """The layer that brought the fault in: whatever the layers, only what they make together has to hold."""
    for number, (origin, _) in enumerate(layers, 1):
        try:
            _convert(_merged(profile, layers[:number]))
        except UNDECODABLE as earlier:
            if str(earlier) == str(error):
                return origin
    return "configuration"


def encode_config(config: Config) -> bytes:
    """Exact JSON of a configuration, for handing to child processes and into logs."""
    return msgspec.json.encode(config)


def decode_config(data: bytes) -> Config:
    """Inverse of `encode_config`, of an earlier version too. Raises UserError.

    Settings that the earlier version did not have take the value of the recorded profile.
    """
    try:
        recorded = with_present_names(msgspec.json.decode(data, type=dict[str, object]))
        profile, tree = recorded.get("profile"), dict[str, object]()
        _merge(tree, PROFILES.get(profile, {}) if isinstance(profile, str) else {})
        _merge(tree, recorded)
        return _convert(tree, strict=True)
    except UNDECODABLE as error:
        raise UserError(f"configuration: {error}") from error


def with_settings(config: Config, sets: Iterable[str]) -> Config:
    """The same configuration with other `section.field=value` settings. Raises UserError naming the field at fault."""
    tree: dict[str, object] = msgspec.to_builtins(config)
    texts = tuple(sets)
    for text in texts:
        layer = with_present_names(_from_set(text))
        if "profile" in layer:
            raise UserError(f"{_set_name(text)}: a configuration's profile stays ({config.profile})")
        _merge(tree, layer)
    try:
        return _convert(tree)
    except UNDECODABLE as error:
        raise UserError(f"{' '.join(texts)}: {_with_path(str(error))}") from error


def with_present_names(settings: Mapping[str, object]) -> dict[str, object]:
    """The same settings under their present names; where both names are set, the present one wins."""
    tree: dict[str, object] = {}
    _merge(tree, settings)
    for earlier, present in RENAMED_SETTINGS.items():
        *sections, name = earlier.split(".")
        parent: object = tree
        for section in sections:
            parent = parent.get(section) if isinstance(parent, dict) else None
        if isinstance(parent, dict) and name in parent:
            moved = _nest(present.split("."), parent.pop(name))
            _merge(moved, tree)
            tree = moved
    return tree


def _layer(origin: str, settings: Mapping[str, object]) -> tuple[str, dict[str, object]]:
    """Where settings come from, and the settings under their present names. Raises UserError for a bottomless tree."""
    try:
        return origin, with_present_names(settings)
    except RecursionError as error:
        raise UserError(f"{origin}: settings are not nested that deep") from error


def _convert(tree: dict[str, object], *, strict: bool = False) -> Config:
    """Raises UNDECODABLE."""
    _require_text(tree, "")
    return msgspec.convert(tree, Config, strict=strict)


def _require_text(value: object, path: str) -> None:
    """Raises ValueError naming the field whose text no path or message can hold."""
    if isinstance(value, dict):
        for name, each in value.items():
            _require_text(each, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for each in value:
            _require_text(each, path)
    elif isinstance(value, str) and re.search("[\0\ud800-\udfff]", value):
        raise ValueError(f"{path}: holds a NUL character, or bytes that are not UTF-8")


def _with_path(message: str) -> str:
    """`... - at `$.advisor.x`` becomes `advisor.x: ...`; contradictions name their fields themselves."""
    text, _, path = message.rpartition(" - at ") if " - at " in message else (message, "", "")
    path = path.strip("`").removeprefix("$").lstrip(".")
    return (f"{path}: {text}" if path else text) + _suggestion(text, path)


def _suggestion(text: str, path: str) -> str:
    """The nearest name of the same section, for a field that is unknown there."""
    unknown = re.search(r"unknown field `([^`]*)`", text)
    if unknown is None:
        return ""
    section: type = Config
    for part in filter(None, path.split(".")):
        section = next((field.type for field in msgspec.structs.fields(section) if field.encode_name == part), Config)
    names = [field.encode_name for field in msgspec.structs.fields(section)]
    near = difflib.get_close_matches(unknown[1], names, n=1)
    where = f"{path}." if path else ""
    return f" (did you mean {where}{near[0]}?)" if near else f" (have: {', '.join(names)})"


def _read_settings(file: Path) -> dict[str, object]:
    """TOML, or JSON as `encode_config` writes it where the file's name says so."""
    try:
        text = file.read_text(encoding="utf-8-sig")  # what some editors write begins with a mark
        return msgspec.json.decode(text, type=dict[str, object]) if file.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise UserError(f"{file}: {error.strerror}") from error
    except UNDECODABLE as error:
        raise UserError(f"{file}: {error}") from error


def _from_environ(environ: Mapping[str, str]) -> dict[str, object]:
    tree: dict[str, object] = {}
    for name, text in environ.items():
        if name.startswith(ENV_PREFIX) and name not in NOT_SETTINGS:
            path = name.removeprefix(ENV_PREFIX).lower().split("__")
            _merge(tree, _nest(path, _value(text)))
    return tree


def _from_set(text: str) -> dict[str, object]:
    path, separator, value = text.partition("=")
    if not separator or not path.strip():
        raise UserError(f"{_set_name(text)}: expected section.field=value")
    return _nest(path.strip().split("."), _value(value.strip()))


def _value(text: str) -> object:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except UNDECODABLE:
        return text


def _nest(path: list[str], value: object) -> dict[str, object]:
    for part in reversed(path):
        value = {part: value}
    assert isinstance(value, dict)
    return value


def _merge(tree: dict[str, object], layer: Mapping[str, object]) -> None:
    for name, value in layer.items():
        below = tree.get(name)
        if isinstance(below, dict) and isinstance(value, Mapping):
            _merge(below, value)
        elif isinstance(value, Mapping):
            tree[name] = {}
            _merge(tree[name], value)  # type: ignore[arg-type]  # just made, a dict
        else:
            tree[name] = value


def _set_name(text: str) -> str:
    """How an error names it: whole, unless nobody would read it."""
    printable = text.encode(errors="backslashreplace").decode()  # an argument may be bytes that are no text
    return f"--set {printable}" if len(printable) <= MAX_SHOWN else f"--set {printable[:MAX_SHOWN]}..."
