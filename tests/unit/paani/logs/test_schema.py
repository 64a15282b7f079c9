"""Schemas of messages, judged by the rules of the viewers' parsers."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, Literal

import msgspec
import pytest

from paani import keys
from paani.logs.schema import json_schema
from paani.logs.viewer import CHANNELS
from tests.places import ROOT

SCALARS = {"boolean", "integer", "number", "string"}
UNKNOWN_WORDS = {"$ref", "$defs", "anyOf", "oneOf", "allOf", "additionalProperties", "patternProperties", "const"}


def viewer_fields(schema: dict[str, Any], path: str = "") -> dict[str, str]:
    """Field types as Lichtblick's `parseJsonSchema` finds them; an assertion where it throws."""
    assert schema.get("type") == "object", f'{path}: expected "type": "object", got {schema.get("type")}'
    assert not schema.keys() & UNKNOWN_WORDS, path
    found = {}
    for name, field in schema.get("properties", {}).items():
        below = f"{path}.{name}"
        assert not field.keys() & UNKNOWN_WORDS, below
        kind = field.get("type")
        if kind == "array":
            items = field["items"]
            assert not items.keys() & UNKNOWN_WORDS, below
            assert items.get("type") in SCALARS | {"object"}, f"{below}: array of {items.get('type')}"
            found[below] = f"{items['type']}[]"
            if items["type"] == "object":
                found |= viewer_fields(items, f"{below}[]")
        elif kind == "object":
            found |= viewer_fields(field, below)
        else:
            assert kind in SCALARS, f"{below}: {kind}"
            found[below] = kind
    return found


@pytest.mark.parametrize("topic", keys.every_topic(), ids=lambda topic: topic.name)
def test_every_published_type_has_a_schema_that_viewers_parse(topic: keys.Topic[Any]) -> None:
    schema = msgspec.json.decode(json_schema(topic.type))
    found = viewer_fields(schema)
    assert found[".source_us"] == found[".seq"] == "integer"
    assert found[".producer"] == "string"
    assert schema["title"] == topic.type.__name__
    assert "source_us" in schema["required"]


def test_an_advisory_in_full() -> None:
    found = viewer_fields(msgspec.json.decode(json_schema(keys.ADVISORY.type)))
    assert found[".direction"] == "string"
    assert found[".left.risk"] == "number"
    assert found[".left.occupied"] == "boolean"
    assert found[".contributing_track_ids"] == "integer[]"
    tracks = viewer_fields(msgspec.json.decode(json_schema(keys.TRACKS.type)))
    assert tracks[".tracks"] == "object[]"
    assert tracks[".tracks[].box_xyxy"] == "number[]"


class Inner(msgspec.Struct):
    x: float = 0.0


class Optional(msgspec.Struct):
    inner: Inner | None = None
    word: Literal["a", "b"] = "a"


class OpenDict(msgspec.Struct):
    things: dict[str, int]


class Union(msgspec.Struct):
    thing: int | str


class Recursive(msgspec.Struct):
    inner: tuple[Recursive, ...] = ()


class Nested(msgspec.Struct):
    grid: tuple[tuple[float, ...], ...]


class Mixed(msgspec.Struct):
    pair: tuple[int, str]


class Anything(msgspec.Struct):
    thing: Any


class Number(IntEnum):
    ONE = 1


class Numbered(msgspec.Struct):
    thing: Number


def test_what_may_be_none_is_what_it_may_be() -> None:
    found = viewer_fields(msgspec.json.decode(json_schema(Optional)))
    assert found == {".inner.x": "number", ".word": "string"}


@pytest.mark.parametrize("kind", [OpenDict, Union, Recursive, Nested, Mixed, Anything, Numbered])
def test_what_is_open_is_refused_with_its_path(kind: type[msgspec.Struct]) -> None:
    field = next(iter(kind.__struct_fields__))
    with pytest.raises(TypeError, match=rf"{kind.__name__}\.{field}"):
        json_schema(kind)


def test_the_viewer_s_layout_names_what_is_recorded() -> None:
    """The layout that ships shows topics and fields that there are."""
    layout = msgspec.json.decode((ROOT / "deploy" / "viewer" / "foxglove-layout.json").read_bytes())
    paths = [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", [])] + [
        layout["configById"]["RawMessages!why"]["topicPath"]
    ]
    topics = {topic.name: topic for topic in keys.every_topic()}
    for path in paths:
        name, _, field = path.partition(".")
        assert f".{field}" in viewer_fields(msgspec.json.decode(json_schema(topics[name].type))), path
    image = layout["configById"]["Image!camera"]["imageMode"]
    assert topics[image["imageTopic"]].stance is keys.Stance.PICTURE
    named = {*image["annotations"], *layout["configById"]["3D!pose"]["topics"]}
    named |= {layout["configById"]["map!track"]["followTopic"], layout["configById"]["RosOut!log"]["topicToRender"]}
    assert named == set(CHANNELS)
    assert set(panels(layout["layout"])) == set(layout["configById"])


def panels(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else [*panels(tree["first"]), *panels(tree["second"])]
