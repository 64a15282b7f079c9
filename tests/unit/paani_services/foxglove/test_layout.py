"""The layout that viewers open: every topic, field and frame that it names is there, of the type its panel draws."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib import resources
from typing import Any

import msgspec
import pytest

from paani import keys
from paani.logs import protobuf as pb
from paani_services.foxglove.channels import Channel, channels
from paani_services.foxglove.transforms import BASE_FRAME, ODOM_FRAME

LAYOUT: dict[str, Any] = json.loads(resources.files("paani_services.foxglove").joinpath("layout.json").read_bytes())
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
OFFERED = channels(keys.Graph.SIMULATION)
FRAMES = {BASE_FRAME, ODOM_FRAME, "map", "camera_optical"}
DRAWN_IN_3D = {pb.SCENE_UPDATE, pb.POSE_IN_FRAME, pb.CAMERA_CALIBRATION}


def placed(node: Any) -> Iterator[str]:
    """Panels of a mosaic, those inside its tabs among them."""
    if isinstance(node, str):
        yield node
        for tab in PANELS[node].get("tabs", ()):
            yield from placed(tab["layout"])
    else:
        assert 10 <= node["splitPercentage"] <= 90
        yield from placed(node["first"])
        yield from placed(node["second"])


def leaf(path: str) -> str:
    """The type of the value at the end of a message path (`topic.field.field`). Fails where there is none."""
    match = re.fullmatch(r"([\w/]+)\.([\w.]+)", path)
    assert match, path
    channel, names = OFFERED[match[1]], match[2].split(".")
    assert channel.encoding == "json", "the paths of this layout read JSON"
    schema = msgspec.json.decode(channel.schema)
    for name in names:
        schema = schema["properties"][name]
    return str(schema["type"])


def named(kind: str) -> list[dict[str, Any]]:
    found = [config for panel, config in PANELS.items() if panel.startswith(f"{kind}!")]
    assert found
    return found


def kind_of(topic: str) -> str:
    return OFFERED[topic].kind


def test_every_panel_has_its_place_once() -> None:
    assert sorted(placed(LAYOUT["layout"])) == sorted(PANELS)


def test_pictures_and_what_is_drawn_over_them() -> None:
    for config in named("Image"):
        mode = config["imageMode"]
        assert kind_of(mode["imageTopic"]) == pb.COMPRESSED_IMAGE
        assert kind_of(mode.get("calibrationTopic", "viewer/calibration")) == pb.CAMERA_CALIBRATION
        assert {kind_of(topic) for topic in mode["annotations"]} <= {pb.IMAGE_ANNOTATIONS}
        if mode["annotations"]:
            assert mode["synchronize"], "what is drawn is shown with the picture of the same time alone"
        assert {kind_of(topic) for topic in config["topics"]} <= DRAWN_IN_3D


def test_the_scene() -> None:
    for config in named("3D"):
        assert config["followTf"] in FRAMES
        assert {layer["frameId"] for layer in config["layers"].values()} <= FRAMES
        assert {kind_of(topic) for topic in config["topics"]} <= DRAWN_IN_3D
        assert config["topics"]["viewer/scene"]["visible"]


def test_the_chart() -> None:
    for config in named("map"):
        assert {kind_of(topic) for topic in (config["followTopic"], *config["topicColors"])} == {pb.LOCATION_FIX}


@pytest.mark.parametrize("config", named("Plot"), ids=lambda config: config["title"])
def test_plots_plot_numbers(config: dict[str, Any]) -> None:
    assert {leaf(path["value"]) for path in config["paths"]} <= {"number", "integer"}


def test_states_are_words_or_truth_values() -> None:
    for config in named("StateTransitions"):
        assert {leaf(path["value"]) for path in config["paths"]} <= {"string", "boolean"}


def test_log_and_messages() -> None:
    assert [kind_of(config["topicToRender"]) for config in named("RosOut")] == [pb.LOG]
    assert all(isinstance(OFFERED[config["topicPath"]], Channel) for config in named("RawMessages"))


def test_no_address_is_in_it() -> None:
    assert "http" not in json.dumps(LAYOUT)
