"""Hostile messages for every key, made from the table of keys and the types of the messages. Pure, from a seed.

A message begins as a valid one of its type, with values at and between their bounds. Then either something is done to
it for which every receiver has to refuse it, or something odd that a receiver may take or refuse.
"""

from __future__ import annotations

import base64
import json
import math
import random
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from msgspec import inspect

from paani import keys
from paani import messages as m
from paani.bus.admission import MAX_MESSAGE_BYTES

NESTED = 3000  # deeper than any recursion limit
OUTSIZE_ONCE_IN = 200  # payloads of a megabyte take most of the time
HUGE_INT = 10**30
MAX_ITEMS = 3
JUNK = (
    '"\x00\x01"',
    '"\\ud800"',
    '"' + "é" * 50 + '"',
    '"\U0001f6a3"',
    "1e400",
    "-0",
    "[" * 100 + "]" * 100,
    "{}",
    "null",
)

# What nobody hostile may say, as it would be an order of whoever may give it, and no fault of form.
HARMLESS: dict[type[m.Message], dict[str, Any]] = {
    m.Arming: {"armed": False},
    m.OperatorRequest: {"act": m.RequestAct.HOLD.value},
}


class Payload(NamedTuple):
    """Bytes for a key. `fault`: what was done to the message; `is_refused`: no receiver may take it."""

    data: bytes
    fault: str
    is_refused: bool


class Site(NamedTuple):
    """A place in a message: the object or array that holds it, where in there, and its type."""

    holder: Any
    at: Any
    type: inspect.Type


class HostileMessages:
    """Payloads for one topic, one after the other; each pretends to be its producer's next message.

    heard_epoch: an epoch that the receivers have heard; while it is set, messages of earlier ones come again.
    """

    def __init__(self, topic: keys.Topic[Any], domain: int, rng: random.Random) -> None:
        self._topic, self._domain, self._rng = topic, domain, rng
        self._info = inspect.type_info(topic.type)
        self._seq = 0
        self.heard_epoch = 0
        self._faults: dict[str, Callable[[dict[str, Any]], bytes]] = {
            "bytes": lambda tree: rng.randbytes(rng.randrange(120)),
            "cut": self._cut,
            "not UTF-8": lambda tree: _text(tree).replace(b'"producer": "', b'"producer": "\xff\xfe', 1),
            "UTF-16": lambda tree: json.dumps(tree).encode("utf-16"),
            "no object": lambda tree: _text(rng.choice(([tree], None, 5, "text", []))),
            "nested": self._nested,
            "missing": self._missing,
            "other type": self._swapped,
            "out of range": self._beyond,
            "not a number": self._not_finite,
            "twice": self._twice,
            "other domain": lambda tree: _text({**tree, "domain": self._other_domain()}),
            "other producer": lambda tree: _text({**tree, "producer": self._other_producer()}),
            "other topic": lambda tree: _text({**tree, "topic": rng.choice(("", "x", f"{topic.name}/x"))}),
            "future": self._future,
        }

    def next(self, now_us: int, *, refused: bool = False) -> Payload:
        """A payload at this time [us]; `refused`: one that no receiver may take."""
        tree = self.valid(now_us)
        if refused or self._rng.random() < 0.7:
            if self._rng.randrange(OUTSIZE_ONCE_IN) == 0:
                return Payload(_text({**tree, "x": "x" * MAX_MESSAGE_BYTES}), "oversized", is_refused=True)
            fault = self._rng.choice([*self._faults, *(["replayed"] if self.heard_epoch else [])])
            if fault == "replayed":
                return Payload(_text({**tree, "epoch": self._rng.randrange(self.heard_epoch)}), fault, is_refused=True)
            return Payload(self._faults[fault](tree), fault, is_refused=True)
        if self._rng.random() < 0.2 and self._topic.type not in HARMLESS:
            return Payload(self._flipped(tree), "flipped", is_refused=False)
        return Payload(self._odd(tree), "odd", is_refused=False)

    def valid(self, now_us: int) -> dict[str, Any]:
        """A valid message of the topic as a tree, its producer's next."""
        tree = _value(self._info, self._rng)
        assert isinstance(tree, dict)
        self._seq += 1
        tree |= {"seq": self._seq, "epoch": now_us // 1000, "domain": self._domain, "producer": self._topic.producer}
        tree["topic"] = self._topic.name
        tree |= {"source_us": now_us, "sent_us": now_us}
        if issubclass(self._topic.type, m.PictureHeader):
            tree["frame_epoch"] = min(tree["frame_epoch"], now_us // 1000)
        return tree | HARMLESS.get(self._topic.type, {})

    def _cut(self, tree: dict[str, Any]) -> bytes:
        data = _text(tree)
        return data[: self._rng.randrange(len(data))]

    def _flipped(self, tree: dict[str, Any]) -> bytes:
        """A few other bytes somewhere."""
        data = bytearray(_text(tree))
        for _ in range(self._rng.randrange(1, 4)):
            data[self._rng.randrange(len(data))] = self._rng.randrange(256)
        return bytes(data)

    def _nested(self, tree: dict[str, Any]) -> bytes:
        opening, closing = self._rng.choice((("[", "]"), ('{"a":', "}")))
        name = self._rng.choice([*tree, "x"])
        inside = opening * NESTED + "1" + closing * self._rng.choice((0, NESTED))
        rest = _text({key: value for key, value in tree.items() if key != name})
        return rest[:-1] + f', "{name}": {inside}}}'.encode()

    def _missing(self, tree: dict[str, Any]) -> bytes:
        """Without a field that it needs; where an inner object needs one, perhaps without that."""
        needed = [site for site in _fields(self._info, tree) if site.at in _required(site.type)]
        site = self._rng.choice(needed)
        del site.holder[site.at]
        return _text(tree)

    def _swapped(self, tree: dict[str, Any]) -> bytes:
        site = self._rng.choice(list(_sites(self._info, tree)))
        site.holder[site.at] = self._rng.choice(_wrong(site.type))
        return _text(tree)

    def _beyond(self, tree: dict[str, Any]) -> bytes:
        bounded = [(site, beyond) for site in _sites(self._info, tree) if (beyond := _outside(site.type))]
        site, beyond = self._rng.choice(bounded)
        site.holder[site.at] = self._rng.choice(beyond)
        return _text(tree)

    def _not_finite(self, tree: dict[str, Any]) -> bytes:
        numbers = [
            s for s in _sites(self._info, tree) if isinstance(_plain(s.type), inspect.FloatType | inspect.IntType)
        ]
        site = self._rng.choice(numbers)
        site.holder[site.at] = "@"
        word = self._rng.choice((b"NaN", b"Infinity", b"-Infinity", b"nan", b"1e999", b"-1e999", b"0x10", b"1_0"))
        return _text(tree).replace(b'"@"', word, 1)

    def _twice(self, tree: dict[str, Any]) -> bytes:
        """A field twice, wrong the first or the second time."""
        site = self._rng.choice([s for s in _sites(self._info, tree) if s.holder is tree])
        wrong = _text({site.at: self._rng.choice(_wrong(site.type))})[1:-1]
        inside = [_text(tree)[1:-1], wrong]
        self._rng.shuffle(inside)
        return b"{" + b", ".join(inside) + b"}"

    def _future(self, tree: dict[str, Any]) -> bytes:
        names = ["source_us", "sent_us", "epoch"]
        name = self._rng.choice(names)
        ahead_us = self._rng.choice((3_000_000, 3_600_000_000))
        tree[name] = self._rng.choice((2**53, tree["source_us"] + ahead_us))
        return _text(tree)

    def _odd(self, tree: dict[str, Any]) -> bytes:
        """Valid or nearly: unknown fields, odd texts and numbers, other order and spacing, skipped sequences."""
        if self._rng.random() < 0.3:
            tree["seq"] += self._rng.choice((1000, 2**32, 2**52))
            self._seq = 0
        data = _text(tree, indent=self._rng.choice((None, 0, 3)))
        for _ in range(self._rng.randrange(3)):
            name = self._rng.choice(("x", "", "__class__", "$", "Left", "a" * 300))
            junk = self._rng.choice(JUNK)
            data = data[:-1].rstrip() + f', "{name}": {junk}}}'.encode()
        if self._rng.random() < 0.2:
            texts = [s for s in _sites(self._info, tree) if isinstance(_plain(s.type), inspect.StrType)]
            site = self._rng.choice([s for s in texts if s.at != "producer"] or texts)
            site.holder[site.at] = "@"
            data = _text(tree).replace(b'"@"', self._rng.choice(JUNK[:4]).encode(), 1)
        return data

    def _other_domain(self) -> Any:
        return self._rng.choice([domain for domain in (0, 1, 44, 2**53) if domain != self._domain])

    def _other_producer(self) -> str:
        others = [name for name in (*keys.SERVICES, "", "observer", "x" * 400) if name != self._topic.producer]
        return self._rng.choice(others)


def _text(tree: Any, indent: int | None = None) -> bytes:
    return json.dumps(tree, indent=indent).encode()


def _plain(info: inspect.Type) -> inspect.Type:
    """The type without None and without its metadata."""
    match info:
        case inspect.Metadata():
            return _plain(info.type)
        case inspect.UnionType():
            return _plain(next(each for each in info.types if not isinstance(each, inspect.NoneType)))
    return info


def _value(info: inspect.Type, rng: random.Random) -> Any:
    """A valid value of a type."""
    match _plain(info):
        case inspect.StructType(fields=fields):
            given = [field for field in fields if field.required or rng.random() < 0.6]
            return {field.encode_name: _value(field.type, rng) for field in given}
        case inspect.IntType(ge=low, le=high):
            low, high = low or 0, high if high is not None else 2**53
            return rng.choice((low, high, rng.randint(low, high), min(high, low + rng.randrange(10))))
        case inspect.FloatType(ge=low, gt=above, le=high, lt=below):
            first = low if low is not None else math.nextafter(above, math.inf) if above is not None else -1e9
            last = high if high is not None else math.nextafter(below, -math.inf) if below is not None else 1e9
            return rng.choice((first, last, rng.uniform(first, last), max(first, min(last, rng.uniform(-1.0, 1.0)))))
        case inspect.BoolType():
            return rng.random() < 0.5
        case inspect.StrType(max_length=longest, pattern=pattern):
            return "text" if pattern else rng.choice(("", "text", "t" * (longest or 20)))
        case inspect.BytesType(max_length=longest):
            return base64.b64encode(rng.randbytes(rng.choice((0, 4, longest or 20)))).decode()
        case inspect.EnumType(cls=kind):
            return rng.choice([member.value for member in kind])
        case inspect.TupleType(item_types=types):
            return [_value(item, rng) for item in types]
        case inspect.VarTupleType(item_type=item, min_length=least, max_length=most):
            count = rng.randint(least or 0, max(least or 0, min(MAX_ITEMS, most or MAX_ITEMS)))
            return [_value(item, rng) for _ in range(count)]
    raise TypeError(f"no value of {info}")


def _fields(info: inspect.Type, value: Any) -> Iterator[Site]:
    """Every field of every object in a value; its type is the object's."""
    match _plain(info):
        case inspect.StructType(fields=fields) as kind:
            for field in fields:
                if field.encode_name in value:
                    yield Site(value, field.encode_name, kind)
                    yield from _fields(field.type, value[field.encode_name])
        case inspect.VarTupleType(item_type=item):
            for each in value:
                yield from _fields(item, each)


def _required(info: inspect.Type) -> frozenset[str]:
    assert isinstance(info, inspect.StructType)
    return frozenset(field.encode_name for field in info.fields if field.required)


def _sites(info: inspect.Type, value: Any) -> Iterator[Site]:
    """Every place below a value."""
    items: list[tuple[Any, inspect.Type]] = []
    match _plain(info):
        case inspect.StructType(fields=fields):
            items = [(field.encode_name, field.type) for field in fields if field.encode_name in value]
        case inspect.TupleType(item_types=types):
            items = list(enumerate(types))
        case inspect.VarTupleType(item_type=item):
            items = [(index, item) for index in range(len(value))]
    for at, kind in items:
        yield Site(value, at, kind)
        if value[at] is not None:
            yield from _sites(kind, value[at])


def _wrong(info: inspect.Type) -> list[Any]:
    """Values of other types than this one."""
    match _plain(info):
        case inspect.StructType():
            wrong: list[Any] = [[], 5, "text", True]
        case inspect.IntType():
            wrong = ["5", 0.5, True, [], {}]
        case inspect.FloatType():
            wrong = ["0.5", True, [], {}]
        case inspect.BoolType():
            wrong = [0, 1, "true", [], {}]
        case inspect.StrType() | inspect.BytesType():
            wrong = [5, True, [], {}]
        case inspect.EnumType():
            wrong = [5, "no such word", True, [], {}]
        case inspect.TupleType(item_types=types):
            wrong = [{}, "text", 5, [0.5] * (len(types) + 1), [None] * len(types)]
        case _:
            wrong = [{}, "text", 5, True]
    return wrong if _takes_none(info) else [*wrong, None]


def _takes_none(info: inspect.Type) -> bool:
    match info:
        case inspect.Metadata():
            return _takes_none(info.type)
        case inspect.UnionType():
            return info.includes_none
    return isinstance(info, inspect.NoneType)


def _outside(info: inspect.Type) -> list[Any]:
    """Values of the type beyond its bounds."""
    match _plain(info):
        case inspect.IntType(ge=low, le=high):
            return [
                *([low - 1, -HUGE_INT] if low is not None else []),
                *([high + 1, HUGE_INT] if high is not None else []),
            ]
        case inspect.FloatType(ge=low, le=high):
            return [
                *([low - max(1e-6, abs(low) * 1e-6), -1e300] if low is not None else []),
                *([high + max(1e-6, abs(high) * 1e-6), 1e300] if high is not None else []),
            ]
        case inspect.StrType(max_length=longest):
            return ["t" * (longest + 1)] if longest is not None else []
    return []


def hostile_topics(graph: keys.Graph, domain: int, rng: random.Random) -> dict[str, HostileMessages]:
    """What is hostile on each key of a graph, by the name of its topic."""
    return {topic.name: HostileMessages(topic, domain, rng) for topic in keys.every_topic(graph)}
