"""Every example in the navigator's README is a file that loads."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import pytest

from paani.config import load_config
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.mission_file import load_route_and_mission
from tests.places import ROOT

README = ROOT / "services" / "paani_services" / "navigator" / "README.md"
EXAMPLES = re.findall(r"```(\w+) (\w+)\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
ORIGIN = (47.6512, 9.4794)


def test_there_is_one_example_of_each_format() -> None:
    assert [(kind, what) for kind, what, _ in EXAMPLES] == [
        ("toml", "route"),
        ("toml", "mission"),
        ("toml", "fence"),
        ("geojson", "fence"),
        ("geojson", "land"),
    ]


@pytest.mark.parametrize("fence", [2, 3])
def test_the_examples_load_together(tmp_path: Path, fence: int) -> None:
    (tmp_path / "bay.toml").write_text(EXAMPLES[0][2])
    (tmp_path / "survey.toml").write_text(EXAMPLES[1][2])
    file = tmp_path / f"fence.{EXAMPLES[fence][0]}"
    file.write_text(EXAMPLES[fence][2])
    land = tmp_path / "shores.geojson"
    land.write_text(EXAMPLES[4][2])
    config = msgspec.structs.replace(
        load_config().navigator, mission=str(tmp_path / "survey.toml"), fence=str(file), land=str(land)
    )
    route, mission = load_route_and_mission(config, ORIGIN)
    assert route is not None
    assert mission is not None
    assert len(mission.legs) == 4
    assert mission.fence == load_fence(file, ORIGIN)
    assert [area.name for area in mission.land] == ["north shore"]
