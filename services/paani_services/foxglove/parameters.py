"""The configuration as a viewer's list of parameters. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from paani.config import Config

Value = bool | int | float | str | list[str] | list[float]
# Where credentials and keys lie is nobody's business who only watches.
LEFT_OUT = ("bus.runtime_dir", "bus.certificates", "foxglove.tls_pem")


def parameters(config: Config) -> dict[str, Value]:
    """Every setting by its name (`section.field`). What is unset is left out; a list of other things is written out."""
    found: dict[str, Value] = {}
    _flatten(msgspec.to_builtins(config), "", found)
    return found


def _flatten(tree: Mapping[str, object], prefix: str, found: dict[str, Value]) -> None:
    for name, value in tree.items():
        path = f"{prefix}{name}"
        if path in LEFT_OUT or value is None:
            continue
        if isinstance(value, dict):
            _flatten(value, f"{path}.", found)
        elif isinstance(value, bool | int | float | str):
            found[path] = value
        elif isinstance(value, list | tuple):
            items = list(value)
            if items and all(isinstance(item, float | int) and not isinstance(item, bool) for item in items):
                found[path] = [float(item) for item in items]
            elif all(isinstance(item, str) for item in items):
                found[path] = items
            else:
                found[path] = msgspec.json.encode(items).decode()
