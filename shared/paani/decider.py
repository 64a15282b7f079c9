"""A decider: a pure step from what a process has heard to what it says.

A service registers its own as an entry point in the group `paani.deciders`. The live process, the replay and the
lockstep trials call the same `decide`, so a recorded decision can be computed again to the byte.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import msgspec

from paani import messages as m
from paani.config import Config
from paani.errors import UserError
from paani.keys import Topic

if TYPE_CHECKING:  # numpy comes with it, 12 MiB for every process
    from paani.motion_planning import MotionPlanner

S = TypeVar("S")


class Input(msgspec.Struct, frozen=True):
    """The newest message of a topic and when it came [us]; None before the first."""

    message: Any = None
    received_us: int = 0


Inputs = Mapping[str, Input]  # by topic name
Outputs = Mapping[str, m.Message]  # by topic name; headers still empty


class Decider(msgspec.Struct, Generic[S], frozen=True, kw_only=True):
    """`decide(state, inputs, now_us, config)` is pure and total; `state()` is the state at start.

    inputs: topics heard, newest message each. own: the process's own topics whose last message it also needs.
    outputs: topics said. A state encodes to JSON and back without loss.
    with_planner: the same step with another motion planner; None for a process without one.
    """

    service: str
    state: Callable[[], S]
    inputs: tuple[Topic[Any], ...]
    outputs: tuple[Topic[Any], ...]
    decide: Callable[[S, Inputs, int, Config], tuple[S, Outputs]]
    own: tuple[Topic[Any], ...] = ()
    with_planner: Callable[[MotionPlanner], Decider[S]] | None = None


def deciders() -> dict[str, Decider[Any]]:
    """Every installed decider by service."""
    return {point.name: point.load() for point in entry_points(group="paani.deciders")}


def decider_of(service: str) -> Decider[Any]:
    """The decider of one service. Raises UserError when none is installed."""
    for point in entry_points(group="paani.deciders"):
        if point.name == service:
            loaded: Decider[Any] = point.load()
            return loaded
    raise UserError(f"no decider named '{service}' (have: {', '.join(sorted(deciders()))})")
