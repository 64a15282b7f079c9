"""Everything in a log that belongs to one advisory: what it was made from, and what became of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.errors import UserError
from paani.logs.pictures import RecordedPicture, paired_pictures
from paani.logs.reader import Log
from paani.undecodable import UNDECODABLE

BEFORE_US, AFTER_US = 5_000_000, 3_000_000  # where the rest of a decision is looked for

AROUND: tuple[keys.Topic[Any], ...] = (
    keys.ADVISORY, keys.TRACKS, keys.EVIDENCE, keys.COMMAND, keys.PREDICTION, keys.THRUST, keys.THRUST_APPLIED,
)  # fmt: skip


class Moment(msgspec.Struct, frozen=True, kw_only=True):
    """One decision. What the log has not is None. before: the direction before, first advised at `before_us`.

    prediction: the newest by then that is not out of date.
    """

    at_us: int
    start_us: int
    advisory: m.Advisory
    before: str
    before_us: int
    tracks: m.Tracks | None
    evidence: m.Evidence | None
    order: m.NavCommand | None
    prediction: m.Prediction | None
    thrust: m.Thrust | None
    applied: m.ThrustApplied | None
    picture: RecordedPicture | None
    mask: RecordedPicture | None


class _Run(msgspec.Struct):
    """Advisories of one direction in a row."""

    direction: str
    begin_us: int


class _Direction(msgspec.Struct):
    direction: str


def last_change_us(log: Log) -> int:
    """When the direction changed last; without a change, when the last advice came. Raises UserError."""
    runs = list(_runs(log, None))
    if not runs:
        raise UserError(f"{log.path}: no advice in it")
    return runs[-1].begin_us if len(runs) > 1 else log.end_us


def moment_at(log: Log, at_us: int) -> Moment:
    """The decision in force at a time. Raises UserError where there is none."""
    found = _messages(log, AROUND, at_us - BEFORE_US, at_us + AFTER_US)
    advisories = [(log_us, a) for log_us, a in found[keys.ADVISORY.name] if log_us <= at_us]
    if not advisories:
        span_s = (log.end_us - log.start_us) * 1e-6
        raise UserError(f"{log.path}: no advice at {(at_us - log.start_us) * 1e-6:.1f} s (it has 0 to {span_s:.1f} s)")
    log_us, advisory = advisories[-1]
    runs = list(_runs(log, log_us))
    frame = (advisory.frame_epoch, advisory.frame_seq)
    order = _first(o for _, o in found[keys.COMMAND.name] if o.advisory_sent_us == advisory.sent_us)
    thrust = _first(t for _, t in found[keys.THRUST.name] if order and t.command_sent_us == order.sent_us)
    applied = _first(a for _, a in found[keys.THRUST_APPLIED.name] if thrust and a.command_sent_us == thrust.sent_us)
    if applied is None:  # an adapter that takes no order shows none; thrust that it applies is another order's
        after = (a for at, a in found[keys.THRUST_APPLIED.name] if at > log_us)
        applied = _first(a for a in after if a.zero_cause is not m.ZeroCause.NONE)
    pictures = list(_pictures(log, frame, log_us))
    return Moment(
        at_us=log_us,
        start_us=log.start_us,
        advisory=advisory,
        before=runs[-2].direction if len(runs) > 1 else "",
        before_us=runs[-2].begin_us if len(runs) > 1 else 0,
        tracks=_last(t for at, t in found[keys.TRACKS.name] if (t.frame_epoch, t.frame_seq) == frame),
        evidence=_first(e for _, e in found[keys.EVIDENCE.name] if (e.frame_epoch, e.frame_seq) == frame),
        order=order,
        prediction=_last(
            p for at, p in found[keys.PREDICTION.name] if 0 <= log_us - at <= keys.PREDICTION.fresh_s * 1e6
        ),
        thrust=thrust,
        applied=applied,
        picture=_first(p for p in pictures if p.topic == keys.PICTURE.name),
        mask=_first(p for p in pictures if p.topic == keys.MASK.name),
    )


def _runs(log: Log, end_us: int | None) -> Iterator[_Run]:
    decoder = msgspec.json.Decoder(_Direction)
    run: _Run | None = None
    for record in log.records([keys.ADVISORY.name], None, end_us):
        try:
            direction = decoder.decode(record.data).direction
        except UNDECODABLE:
            continue
        if run is None or run.direction != direction:
            if run is not None:
                yield run
            run = _Run(direction, record.log_us)
    if run is not None:
        yield run


def _messages(
    log: Log, topics: Iterable[keys.Topic[Any]], start_us: int, end_us: int
) -> dict[str, list[tuple[int, Any]]]:
    """(log time, message) by topic, in order; what does not decode is left out."""
    decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in topics}
    found: dict[str, list[tuple[int, Any]]] = {name: [] for name in decoders}
    for record in log.records(decoders, start_us, end_us):
        try:
            found[record.topic].append((record.log_us, decoders[record.topic].decode(record.data)))
        except UNDECODABLE:
            continue
    return found


def _pictures(log: Log, frame: tuple[int, int], near_us: int) -> Iterator[RecordedPicture]:
    """The frame and its mask, where they were recorded."""
    topics = [keys.PICTURE.name, keys.MASK.name]
    names = [*topics, *(f"{name}/header" for name in topics)]
    decoder = msgspec.json.Decoder(m.PictureHeader)
    for item in paired_pictures(log.records(names, near_us - BEFORE_US, near_us + AFTER_US), topics):
        if isinstance(item, RecordedPicture):
            try:
                header = decoder.decode(item.header)
            except UNDECODABLE:
                continue
            if (header.frame_epoch, header.frame_seq) == frame:
                yield item


def _first(found: Iterable[Any]) -> Any:
    return next(iter(found), None)


def _last(found: Iterable[Any]) -> Any:
    last = None
    for last in found:  # noqa: B007
        pass
    return last
