"""Services never read each other's section of the configuration."""

from __future__ import annotations

import ast
from pathlib import Path

import msgspec
import pytest

import paani_services
from paani.config import Config

SERVICES = Path(paani_services.__path__[0])
SECTIONS = {field.name for field in msgspec.structs.fields(Config)} - {"profile"}
SHARED = {"bus", "calibration"}  # how processes find each other; where the camera is on the boat
KNOWN = {  # section that another process owns, and why it is read
    ("advisor", "perception"): "the corridors that the evidence was measured in",
    ("advisor", "camera"): "whether the pictures are the simulator's, whose lens `eye` states",
    ("advisor", "eye"): "the lens of the simulator's pictures",
    ("navigator", "perception"): "the own hull in the picture, in which nothing was looked for",
    ("navigator", "localization"): "the origin of the map, at which routes and fences in degrees are placed",
    ("operator", "navigator"): "the margin that missions of clients keep from their fence",
    ("mavlink", "advisor"): "the parameters of the policy that ground stations read",
    ("mavlink", "navigator"): "the cruise speed that ground stations read",
    ("mavlink", "recorder"): "the folder whose recordings ground stations download",
    ("ros2", "navigator"): "the speed that a hand gets at full stick, by which `cmd_vel` is scaled",
    ("foxglove", "perception"): "the corridors that are drawn over the picture and on the water",
    ("foxglove", "localization"): "the origin of the map, at which route and fence are placed on the earth",
    ("dashboard", "recorder"): "the folder whose recordings the page lists and plays",
    ("dashboard", "camera"): "what the page shows of the source of pictures",
    ("dashboard", "world"): "what the page shows of the simulated world",
    ("dashboard", "perception"): "the corridors that the page draws",
    ("dashboard", "advisor"): "the weights of the risks that the page explains",
    ("dashboard", "navigator"): "the radius of a waypoint that the page draws",
}


def sections_read(service: Path) -> set[str]:
    """Sections of the configuration that the modules of a service name as `config.<section>`."""
    found = set()
    for path in service.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr in SECTIONS and _is_config(node.value):
                found.add(node.attr)
    return found


def _is_config(node: ast.expr) -> bool:
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name.strip("_") in {"config", "configuration"}


@pytest.mark.parametrize("service", sorted(path.name for path in SERVICES.iterdir() if (path / "__init__.py").exists()))
def test_a_service_reads_its_own_section_and_shared_ones(service: str) -> None:
    """What else it reads is listed with the reason, and what is listed is read."""
    others = sections_read(SERVICES / service) - SHARED - {service}
    assert others == {section for reader, section in KNOWN if reader == service}


@pytest.mark.slow
def test_the_sections_are_found() -> None:
    """The search sees what services read of their own."""
    own = {service for service in SECTIONS if (SERVICES / service).is_dir()}
    assert {"advisor", "navigator", "perception", "controller", "localization"} <= own
    assert {service for service in own if service in sections_read(SERVICES / service)} == own
