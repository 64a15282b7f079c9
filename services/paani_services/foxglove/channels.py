"""Every channel that a viewer is offered, by name: what its messages are, and their schema. Pure.

Channels that a recording has as well carry the same name and the same schema there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from paani import keys
from paani.logs import protobuf as pb
from paani.logs import viewer
from paani.logs.schema import json_schema

MASK, CORRIDORS, CALIBRATION = "viewer/mask", "viewer/corridors", "viewer/calibration"
TRANSFORMS, SCENE, CHART = "viewer/transforms", "viewer/scene", "viewer/chart"
DRAWN: Mapping[str, str] = {
    keys.PICTURE.name: pb.COMPRESSED_IMAGE,
    MASK: pb.COMPRESSED_IMAGE,
    **viewer.CHANNELS,
    CORRIDORS: pb.IMAGE_ANNOTATIONS,
    CALIBRATION: pb.CAMERA_CALIBRATION,
    TRANSFORMS: pb.FRAME_TRANSFORMS,
    SCENE: pb.SCENE_UPDATE,
    CHART: pb.GEO_JSON,
}


class Channel(NamedTuple):
    """encoding: of its messages. kind, language, schema: as the protocol's `schemaName`, `schemaEncoding`, `schema`."""

    encoding: str
    kind: str
    language: str
    schema: bytes


def forwarded_topics(graph: keys.Graph) -> tuple[keys.Topic[Any], ...]:
    """Topics that go out as they are, in JSON: all but the simulator's truth, requests, and steps of deciders."""
    left_out = {row.name for row in (*keys.STEPS.values(), *keys.ASKED)}
    rows = (
        topic
        for topic in keys.topics_in(graph)
        if topic.stance is not keys.Stance.PICTURE and topic.name not in left_out and not topic.name.startswith("@")
    )
    return (*rows, *(keys.health(name) for name in keys.services_in(graph)))


def channels(graph: keys.Graph) -> dict[str, Channel]:
    """All channels in this graph."""
    offered = {name: Channel("protobuf", kind, "protobuf", pb.descriptors(kind)) for name, kind in DRAWN.items()}
    for topic in forwarded_topics(graph):
        offered[topic.name] = Channel("json", f"paani.{topic.type.__name__}", "jsonschema", json_schema(topic.type))
    return offered
