"""Parameters to and from ground stations. No input or output of its own.

What a station writes is never in force by that: a tunable setting is tried beside those in force, and a hand on the
page promotes it while the boat is not armed. So each write is answered by an error, with text, and by the value that
holds; when another one holds, every station is told.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from paani import messages as m
from paani.config import AdvisorConfig
from paani_services.mavlink import commands
from paani_services.mavlink.codec import dialect, text_of
from paani_services.mavlink.parameters import (
    Parameter,
    find,
    is_in_force,
    param_error,
    param_value,
    parameters_of,
    path_of,
    written_text,
)
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import PARAMETERS_PER_TICK, Source, Station

UNKNOWN, READ_ONLY = dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST, dialect.MAV_PARAM_ERROR_READ_ONLY
DENIED, RANGE = dialect.MAV_PARAM_ERROR_PERMISSION_DENIED, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE


class ParameterWrite(NamedTuple):
    """What a station asks to have tried: the setting, its value as text, and who is told how that ended."""

    station: Station
    target: Source
    name: str
    path: str
    text: str


class ParameterExchange:
    """ask: has a write tried, and `answer` called. count: something refused. is_trusted: whether it may command."""

    def __init__(
        self,
        ask: Callable[[ParameterWrite], None],
        count: Callable[[str], None],
        is_trusted: Callable[[Station, Any], bool],
        advisor: AdvisorConfig,
        cruise_mps: float,
    ) -> None:
        self._ask, self._count, self._is_trusted = ask, count, is_trusted
        self._advisor, self._cruise_mps = advisor, cruise_mps
        self._snapshot = Snapshot(now_us=0)
        self._changes: tuple[m.Change, ...] | None = None
        self._values: dict[str, float] = {}
        self.handlers: dict[str, Callable[[Station, Any, Source], None]] = {
            "PARAM_REQUEST_LIST": self._request_list,
            "PARAM_REQUEST_READ": self._request_read,
            "PARAM_SET": self._set,
        }

    def follow(self, snapshot: Snapshot) -> list[Any]:
        """Take what is known now; the values that are in force since another proposal is, for every station."""
        self._snapshot = snapshot
        if snapshot.shadow is None or snapshot.shadow.active_changes == self._changes:
            return []
        is_first, self._changes = self._changes is None, snapshot.shadow.active_changes
        parameters, before = self._parameters, self._values
        self._values = {each.name: each.value for each in parameters}
        changed = (number for number, each in enumerate(parameters) if before.get(each.name) != each.value)
        return [] if is_first else [param_value(parameters, number) for number in changed]

    def send_due(self, station: Station) -> None:
        """Send what is next of the list that this station asked for."""
        if station.next_parameter is None:
            return
        parameters, begun = self._parameters, station.next_parameter
        ended = min(begun + PARAMETERS_PER_TICK, len(parameters))
        for index in range(begun, ended):
            station.send(param_value(parameters, index), self._snapshot.now_us)
        station.next_parameter = ended if ended < len(parameters) else None

    def answer(self, write: ParameterWrite, error: int, text: str) -> None:
        """Say how a write has ended, and which value holds."""
        self._refuse(write.station, write.target, write.name, error, text)

    @property
    def _parameters(self) -> tuple[Parameter, ...]:
        return parameters_of(self._snapshot, self._cruise_mps, self._advisor)

    def _request_list(self, station: Station, _: Any, __: Source) -> None:
        station.next_parameter = 0

    def _request_read(self, station: Station, message: Any, source: Source) -> None:
        parameters, index = self._parameters, message.param_index
        by_name, name = index < 0, text_of(message.param_id)
        found = find(parameters, name) if by_name else index
        if found is not None and found < len(parameters):
            station.send(param_value(parameters, found, by_name=by_name), self._snapshot.now_us)
        elif by_name:
            station.send(param_error(name, source, UNKNOWN), self._snapshot.now_us)

    def _set(self, station: Station, message: Any, source: Source) -> None:
        parameters, name = self._parameters, text_of(message.param_id)
        found = find(parameters, name)
        if found is None:
            station.send(param_error(name, source, UNKNOWN), self._snapshot.now_us)
        elif not self._is_trusted(station, message):
            self._refuse(station, source, name, DENIED, commands.NOT_TRUSTED)
        elif (path := path_of(name)) is None:
            self._refuse(station, source, name, READ_ONLY, f"{name}: is not tunable")
        elif (text := written_text(message.param_value, path, self._advisor)) is None:
            self._refuse(station, source, name, RANGE, f"{name}: no value of its kind")
        elif is_in_force(parameters, found, message.param_value) and not self._is_on_trial(path):
            station.send(param_value(parameters, found, by_name=True), self._snapshot.now_us)
        else:
            self._ask(ParameterWrite(station, source, name, path, text))

    def _is_on_trial(self, path: str) -> bool:
        """Whether a trial has another value for this setting."""
        shadow = self._snapshot.shadow
        return shadow is not None and path in {each.path for each in shadow.changes}

    def _refuse(self, station: Station, target: Source, name: str, error: int, text: str) -> None:
        self._count("mavlink_refused")
        station.refuse(text, self._snapshot.now_us)
        station.send(param_error(name, target, error), self._snapshot.now_us)
        parameters = self._parameters
        if (found := find(parameters, name)) is not None:
            station.send(param_value(parameters, found, by_name=True), self._snapshot.now_us)
