"""Conditions that can be set to a value, whatever a seed draws: to find where drives begin to fail. Pure."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from paani.errors import UserError
from paani_sim.worlds import World
from paani_sim.worlds.generate import AS_DRAWN, Traffic

VALUE_SEPARATOR = "="
MOST_VALUES = 20  # of one sweep
WIND = "wind_mps"


class Condition(NamedTuple):
    """The values that a condition may have, as in a scenario file, and how a world gets one."""

    least: float
    most: float
    apply: Callable[[World, float], World]


def _part(part: str, name: str, factor: float = 1.0) -> Callable[[World, float], World]:
    def apply(world: World, value: float) -> World:
        changes: dict[str, Any] = {part: dataclasses.replace(getattr(world, part), **{name: factor * value})}
        return dataclasses.replace(world, **changes)

    return apply


def _as_it_is(world: World, _value: float) -> World:
    return world


CONDITIONS = {
    "current_mps": Condition(0.0, 3.0, _part("current", "speed_mps")),
    WIND: Condition(0.0, 30.0, _part("wind", "speed_mps")),
    "visibility_m": Condition(20.0, 1e5, _part("light", "visibility_m")),
    "rain_mmph": Condition(0.0, 100.0, _part("light", "rain_mmph")),
    "sun_elevation_deg": Condition(0.0, 90.0, _part("light", "sun_elevation_rad", math.pi / 180.0)),
}
# Whole numbers, of what is drawn into a world: `traffic_of`.
TRAFFIC = {"encounters": Condition(1, 6, _as_it_is), "people_factor": Condition(1, 4, _as_it_is)}
SWEPT = CONDITIONS | TRAFFIC


def parse_sweep(text: str) -> tuple[str, ...]:
    """Parse `NAME=V,V,...` to one `NAME=V` for each value. Raises UserError."""
    name, _, listed = text.partition(VALUE_SEPARATOR)
    values = listed.split(",")
    if len(values) > MOST_VALUES:
        raise UserError(f"--sweep {name}: {len(values)} values (at most {MOST_VALUES})")
    found = tuple(f"{name}{VALUE_SEPARATOR}{parse_setting(f'{name}{VALUE_SEPARATOR}{each}')[1]:g}" for each in values)
    if len(set(found)) < len(found):
        raise UserError(f"--sweep {text}: the same value twice")
    return found


def parse_setting(text: str) -> tuple[str, float]:
    """The condition and the value of `NAME=V`. Raises UserError."""
    name, _, given = text.partition(VALUE_SEPARATOR)
    if name not in SWEPT:
        raise UserError(f"--sweep {text}: no condition '{name}' (have: {', '.join(SWEPT)})")
    condition = SWEPT[name]
    try:
        value = float(given)
    except ValueError:
        raise UserError(f"--sweep {text}: '{given}' is no number") from None
    if not condition.least <= value <= condition.most:
        raise UserError(f"--sweep {text}: {name} is {condition.least:g} to {condition.most:g}")
    if name in TRAFFIC and not value.is_integer():
        raise UserError(f"--sweep {text}: {name} is a whole number")
    return name, value


def with_condition(world: World, text: str) -> World:
    """The world with the condition of `NAME=V`; as it is where that is of what is met. Raises UserError."""
    name, value = parse_setting(text)
    return SWEPT[name].apply(world, value)


def traffic_of(text: str) -> Traffic:
    """What is to be met by `NAME=V`; as drawn where that is of the world, or empty. Raises UserError."""
    if not text:
        return AS_DRAWN
    name, value = parse_setting(text)
    return AS_DRAWN._replace(**{name: int(value)}) if name in TRAFFIC else AS_DRAWN
