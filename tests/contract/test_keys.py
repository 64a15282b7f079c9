"""The table of keys: every row complete, every type closed, every byte the same as last time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani import authority, keys
from paani import messages as m
from paani.bus.admission import Admission
from tests.places import ROOT

GOLDEN = Path(__file__).parent / "golden"
ROWS: tuple[keys.Topic[Any], ...] = (*keys.TOPICS, keys.pulse("advisor"), keys.health("advisor"))
GRAPHS = tuple(keys.Graph)


def minimal(kind: Any) -> Any:
    """A value of the type with every required field filled."""
    info = msgspec.inspect.type_info(kind)
    return msgspec.convert(_fill(info), kind)


def _fill(info: Any) -> Any:
    match info:
        case msgspec.inspect.StructType():
            return {f.name: _fill(f.type) for f in info.fields if f.required}
        case msgspec.inspect.IntType():
            return info.ge or 0
        case msgspec.inspect.FloatType():
            return 0.25
        case msgspec.inspect.BoolType():
            return True
        case msgspec.inspect.StrType():
            return "text"
        case msgspec.inspect.BytesType():
            return "AAAA"  # base64
        case msgspec.inspect.EnumType():
            return next(iter(info.cls)).value
        case msgspec.inspect.TupleType():
            return [_fill(item) for item in info.item_types]
        case msgspec.inspect.VarTupleType():
            return [_fill(info.item_type)]
    raise AssertionError(f"open or unknown type {info}")


@pytest.mark.parametrize("topic", ROWS, ids=lambda row: row.name)
def test_a_row_is_complete(topic: keys.Topic[Any]) -> None:
    """B1-B13: each interface has one producer, a rate, a freshness limit and a stance."""
    assert topic.producer in {*keys.SERVICES, *keys.COMMAND_LINE_CLIENTS}
    assert 0 < topic.rate_hz <= 100
    assert topic.fresh_s * topic.rate_hz > 1.0
    assert topic.key(43, "otter").startswith("paani/43/otter/")
    assert topic.summary


@pytest.mark.parametrize("topic", ROWS, ids=lambda row: row.name)
def test_a6_a_message_carries_the_domain_of_its_bus(topic: keys.Topic[Any]) -> None:
    for domain in (43, 7):
        assert topic.stamp(minimal(topic.type), domain=domain, seq=1, epoch=2, sent_us=3).domain == domain


def test_names_are_unique() -> None:
    names = [topic.name for topic in keys.TOPICS]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("topic", ROWS, ids=lambda row: row.name)
def test_the_wire_format_has_not_changed(topic: keys.Topic[Any], update_golden: bool) -> None:
    """Golden bytes: a field may only be added with a default, which appends to the object."""
    data = msgspec.json.encode(minimal(topic.type))
    golden = GOLDEN / f"{topic.type.__name__}.json"
    if update_golden:
        golden.write_bytes(data)
    old = msgspec.json.decode(golden.read_bytes())
    new = msgspec.json.decode(data)
    assert {name: new.get(name) for name in old} == old
    assert msgspec.json.decode(golden.read_bytes(), type=topic.type) is not None


@pytest.mark.parametrize("topic", ROWS, ids=lambda row: row.name)
def test_a_message_under_another_key_is_refused(topic: keys.Topic[Any]) -> None:
    """What a library delivers to the wrong receiver is never acted on."""
    data = msgspec.json.encode(msgspec.structs.replace(minimal(topic.type), producer=topic.producer, topic=topic.name))
    assert Admission(topic, 43, 1.0).judge(data, 1)[1] == ""
    others = [row for row in ROWS if row is not topic and row.stance is topic.stance]
    assert [row.name for row in others if Admission(row, 43, 1.0).judge(data, 1)[1] == ""] == []


@pytest.mark.parametrize("topic", ROWS, ids=lambda row: row.name)
def test_a_type_is_closed_flat_json(topic: keys.Topic[Any]) -> None:
    """No dicts, no unions, no arrays of arrays: viewers' JSON-schema parsers take it."""
    _require_flat(msgspec.inspect.type_info(topic.type), depth=0)


def _require_flat(info: Any, depth: int) -> None:
    match info:
        case msgspec.inspect.StructType():
            for field in info.fields:
                _require_flat(field.type, 0)
        case msgspec.inspect.TupleType():
            assert depth == 0
            assert len({type(item) for item in info.item_types}) == 1
            _require_flat(info.item_types[0], depth + 1)
        case msgspec.inspect.VarTupleType():
            assert depth == 0
            _require_flat(info.item_type, depth + 1)
        case _:
            assert not isinstance(info, msgspec.inspect.DictType | msgspec.inspect.UnionType | msgspec.inspect.AnyType)


def test_stamps_are_safe_in_javascript() -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(b'{"source_us": 9007199254740993}', type=m.Pulse)


@pytest.mark.parametrize("graph", GRAPHS)
def test_only_the_controller_may_write_thrust(graph: keys.Graph) -> None:
    """A7 B13: neither perception nor advisor can write anything that moves the boat."""
    orders = {keys.ARMING.name, keys.OPERATOR_ORDER.name, keys.ORDERED_MISSION.name}
    moving = {keys.THRUST.name, keys.COMMAND.name, keys.TUNING.name} | orders
    expected = {
        "controller": {keys.THRUST.name},
        "navigator": {keys.COMMAND.name},
        "operator": orders,
        "dashboard": {keys.TUNING.name},
    }
    for user in (*keys.SERVICES, *keys.COMMAND_LINE_CLIENTS):
        may = moving & set(authority.written_by(user, graph))
        assert may == expected.get(user, set())


@pytest.mark.parametrize("graph", GRAPHS)
def test_each_client_of_the_operator_writes_its_own_requests_and_only_a_simulated_boat_is_armed_by_a_command(
    graph: keys.Graph,
) -> None:
    asked = {topic.name for topic in keys.ASKED}
    for user in (*keys.SERVICES, *keys.COMMAND_LINE_CLIENTS):
        tables = (keys.REQUESTS, keys.MISSION_REQUESTS, keys.TUNING_PROPOSALS)
        rows = [each[user] for each in tables if user in each]
        own = {row.name for row in rows if user not in keys.ABSENT[graph]}
        assert asked & set(authority.written_by(user, graph)) == own
    for command in keys.COMMAND_LINE_CLIENTS:
        assert set(authority.written_by(command, graph)) <= asked
    assert set(authority.written_by("mission", graph)) == {keys.MISSION_REQUESTS["mission"].name}, "it arms nothing"
    assert ("arm" in authority.users_in(graph)) is (graph is keys.Graph.SIMULATION)


def test_the_readme_shows_the_table_of_keys() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "paani", "topics", "--markdown"], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() in (ROOT / "shared" / "README.md").read_text(encoding="utf-8")
