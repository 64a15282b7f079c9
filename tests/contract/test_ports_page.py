"""The table of what goes in and out by which port: every name in it is one that the port has."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import common as dialect

from paani import keys
from paani.keys import PORTS, Graph
from paani_services.foxglove.channels import channels
from paani_services.ros2 import topics
from tests.places import ROOT

PAGE = (ROOT / "docs" / "how-to" / "ports.md").read_text(encoding="utf-8")
SENTENCES = (ROOT / "services" / "paani_services" / "nmea" / "sentences.py").read_text(encoding="utf-8")
MODE_WORDS = {"WHEEL"}
SETTINGS = {"ros2.accept_commands"}


def columns() -> dict[str, list[str]]:
    """Names in backticks, by port."""
    found: dict[str, list[str]] = {port: [] for port in PORTS}
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and len(cells) == len(PORTS) + 1:
            for port, cell in zip(PORTS, cells[1:], strict=True):
                found[port] += re.findall(r"`([^`]+)`", cell)
    return found


MESSAGES = {kind.msgname for kind in dialect.mavlink_map.values()}
ROS_NAMES = {topic.name for topic in (*topics.SENT, *topics.COMMANDS)}
IS_KNOWN: dict[str, Callable[[str], bool]] = {
    "mavlink": lambda name: name in MESSAGES or hasattr(dialect, name),
    "ros2": lambda name: name in ROS_NAMES | MODE_WORDS | SETTINGS,
    "foxglove": lambda name: name in channels(Graph.SIMULATION),
    "nmea": lambda name: f'sentence("{name}"' in SENTENCES,
}


def test_the_table_has_a_column_for_each_port_and_each_has_its_page() -> None:
    assert f"| {' | '.join(PORTS)} |" in PAGE
    assert all(f"({port}.md)" in PAGE and (ROOT / "docs" / "how-to" / f"{port}.md").is_file() for port in PORTS)


@pytest.mark.parametrize("port", PORTS)
@pytest.mark.slow
def test_every_name_is_one_that_the_port_has(port: str) -> None:
    names = columns()[port]
    assert names
    assert [name for name in names if not IS_KNOWN[port](name)] == []


def test_everything_that_ros_nodes_hear_and_say_is_in_it() -> None:
    assert ROS_NAMES - set(columns()["ros2"]) == set()


def test_ports_that_ask_the_operators_process_are_those_with_commands() -> None:
    """By the access rules of the bus, nobody else may."""
    may_ask = {topic.producer for topic in keys.ASKED} & set(PORTS)
    stop = next(line for line in PAGE.splitlines() if line.startswith("| STOP"))
    cells = [cell.strip() for cell in stop.strip("|").split("|")][1:]
    assert {port for port, cell in zip(PORTS, cells, strict=True) if cell != "-"} == may_ask
