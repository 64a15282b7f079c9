"""What the page plots over time: one sample a second, of a running boat or of a recording. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

import msgspec

from paani import keys
from paani import messages as m
from paani_services.dashboard.hub import Event

SAMPLE_PERIOD_US = 1_000_000
T = TypeVar("T", bound=m.Message)


class Sample(msgspec.Struct, frozen=True, kw_only=True):
    """The newest values at one moment; None where nothing fresh is known.

    at_us: the moment [Unix us]. advice: direction advised. mode: `STOPPED`, `NOT_ARMED` or the mode in force; both are
    empty where unknown. speed_mps: estimated speed ahead; cross_track_m: from the line that is followed. risk_...: of
    the corridors. thrust_...: applied, of full thrust. cpu_cores: of all processes that report. latency_ms: from the
    taking of the picture until the advice on it was sent. x_m, y_m: estimated position in the map.
    """

    at_us: int
    advice: str = ""
    mode: str = ""
    speed_mps: float | None = None
    cross_track_m: float | None = None
    risk_left: float | None = None
    risk_center: float | None = None
    risk_right: float | None = None
    thrust_left: float | None = None
    thrust_right: float | None = None
    cpu_cores: float | None = None
    latency_ms: float | None = None
    x_m: float | None = None
    y_m: float | None = None


class Columns(msgspec.Struct, frozen=True, kw_only=True):
    """Samples by field, oldest first: less than half the bytes of rows."""

    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


class Series(msgspec.Struct, frozen=True, kw_only=True):
    """What there is of a drive: its samples, one a second, and its events."""

    samples: Columns
    events: tuple[Event, ...]


class Newest(Protocol):
    """Looks up the newest message of a topic; None where there is none, or it is older than its topic allows."""

    def __call__(self, topic: keys.Topic[T]) -> T | None: ...


SAMPLED: tuple[keys.Topic[Any], ...] = (
    keys.ADVISORY, keys.OPERATOR_STATE, keys.ODOMETRY, keys.COMMAND, keys.THRUST_APPLIED,
)  # fmt: skip


def sample_of(newest: Newest, services: Iterable[str], at_us: int) -> Sample:
    """The sample of this moment. services: whose use of the processor is summed."""
    advisory, operator, odometry = newest(keys.ADVISORY), newest(keys.OPERATOR_STATE), newest(keys.ODOMETRY)
    command, applied = newest(keys.COMMAND), newest(keys.THRUST_APPLIED)
    reports = [report for name in services if (report := newest(keys.health(name))) is not None]
    return Sample(
        at_us=at_us,
        advice="" if advisory is None else advisory.direction.value,
        mode="" if operator is None else _mode(operator),
        speed_mps=None if odometry is None else odometry.surge_mps,
        cross_track_m=None if command is None else command.cross_track_m,
        risk_left=None if advisory is None else advisory.left.risk,
        risk_center=None if advisory is None else advisory.center.risk,
        risk_right=None if advisory is None else advisory.right.risk,
        thrust_left=None if applied is None else applied.left,
        thrust_right=None if applied is None else applied.right,
        cpu_cores=sum(report.cpu_cores for report in reports) if reports else None,
        latency_ms=None if advisory is None else max(0.0, (advisory.sent_us - advisory.source_us) * 1e-3),
        x_m=None if odometry is None else odometry.x_m,
        y_m=None if odometry is None else odometry.y_m,
    )


def columns_of(samples: Iterable[Sample]) -> Columns:
    """The samples by field."""
    rows = [msgspec.structs.astuple(sample) for sample in samples]
    names = tuple(field.name for field in msgspec.structs.fields(Sample))
    return Columns(names=names, values=tuple(zip(*rows, strict=True)) if rows else tuple(() for _ in names))


def _mode(operator: m.OperatorState) -> str:
    return "STOPPED" if operator.stopped else operator.mode.value if operator.armed else "NOT_ARMED"
