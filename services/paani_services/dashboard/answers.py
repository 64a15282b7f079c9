"""What the dashboard's server answers in JSON; `/openapi.json` tells programs of these types."""

from __future__ import annotations

import msgspec


class ErrorAnswer(msgspec.Struct, frozen=True):
    """What is wrong, and where."""

    error: str
    field: str


class StopAnswer(msgspec.Struct, frozen=True):
    """The STOP is latched. `kept`: it is on disk too."""

    stopped: bool
    kept: bool


class HeldAnswer(msgspec.Struct, frozen=True):
    """The operator's process was told that the button is held."""

    held: bool


class ArmedAnswer(msgspec.Struct, frozen=True):
    """The boat is armed."""

    armed: bool


class DoneAnswer(msgspec.Struct, frozen=True):
    """It was done."""

    done: bool


class SentAnswer(msgspec.Struct, frozen=True):
    """The operator's process was told what the hand says; what becomes of it stands in `operator/state`."""

    sent: bool


class SessionAnswer(msgspec.Struct, frozen=True):
    """`login`: a login is asked here, and whoever reads this has a session."""

    login: bool


class LifeAnswer(msgspec.Struct, frozen=True):
    """The process serves. `clients`: open pages. `armed`, `stopped`: null while the operator's process is not heard."""

    ok: bool
    clients: int
    armed: bool | None
    stopped: bool | None


class ReadyAnswer(msgspec.Struct, frozen=True):
    """`unready`: what is wrong with each process that is not ready."""

    ready: bool
    unready: dict[str, str]


class TopicRow(msgspec.Struct, frozen=True):
    """One row of the table of topics. `stance`: how it travels. Older than `fresh_s` it counts as stale."""

    name: str
    type: str
    producer: str
    rate_hz: float
    fresh_s: float
    stance: str
    summary: str
