"""Values that hold arrays, as what `==` compares."""

from __future__ import annotations

import dataclasses

import numpy as np


def as_plain(value: object) -> object:
    """Data classes as dictionaries by field, tuples and arrays as lists, all the way down; the rest as it is."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [as_plain(part) for part in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: as_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return value
