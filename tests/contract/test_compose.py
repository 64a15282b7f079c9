"""The compose files: each side's processes, closed and bounded. Whether an engine runs them: tests/deploy."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from paani.config import load_config
from paani.keys import PORTS, Graph
from paani.sides import Side, services_on
from tests.places import ROOT

SIDES = [Side.BOARD, Side.HOST]
SETUP = "setup"  # runs to its end before the others
MAY_WRITE_STATE = {SETUP, "operator"}


def services(side: Side) -> dict[str, dict[str, Any]]:
    text = (ROOT / "deploy" / f"compose.{side}.yaml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(text)["services"])


def started(side: Side, *profiles: str) -> set[str]:
    """What runs with these profiles."""
    return {name for name, one in services(side).items() if not one.get("profiles") or {*one["profiles"]} & {*profiles}}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("graph", "profile"), [(Graph.SIMULATION, "sim"), (Graph.HULL, "hull")])
def test_a_file_starts_its_sides_processes(side: Side, graph: Graph, profile: str) -> None:
    """A5; in a hull all control is the board's. Ports run where somebody asks for them, all or each alone."""
    own = set(services_on(side, graph)) - {*PORTS}
    profiles = (profile, "mcu", "button", "record")
    assert started(side, *profiles) - {SETUP} == own
    assert started(side, *profiles, "ports") - {SETUP} == set(services_on(side, graph))
    for port in PORTS:
        assert started(side, *profiles, port) - {SETUP} - own == {port} & {*services_on(side, graph)}


@pytest.mark.parametrize("side", SIDES)
def test_every_process_is_confined(side: Side) -> None:
    for name, one in services(side).items():
        assert one["read_only"], name
        assert one["cap_drop"] == ["ALL"], name
        assert one["security_opt"] == ["no-new-privileges"], name
        assert one["mem_limit"], name
        assert one["pids_limit"], name
        assert one["logging"]["options"]["max-size"], name
        assert not one.get("privileged"), name
        if name != SETUP:
            assert one["cpus"], name
            assert one["command"][:2] == ["run", name]
            assert one["healthcheck"]["test"] == ["CMD", "beats", name]
            assert one["restart"] == "unless-stopped", name
        writes_state = any(volume == "state:/var/lib/paani" for volume in one["volumes"])
        assert writes_state == (name in MAY_WRITE_STATE), name


@pytest.mark.parametrize("side", SIDES)
def test_only_the_boards_router_the_page_and_ports_have_a_door(side: Side) -> None:
    doors = {name: one["ports"] for name, one in services(side).items() if one.get("ports")}
    assert set(doors) == ({"router"} if side is Side.BOARD else {"dashboard", *PORTS})
    if side is Side.HOST:
        assert all(len(door) == 1 and door[0].startswith("127.0.0.1:") for door in doors.values())


def test_only_ports_take_the_image_with_what_they_need() -> None:
    """It is built where a port is asked for."""
    host = services(Side.HOST)
    assert {name for name, one in host.items() if one["image"] == "paani-ports"} == {*PORTS}
    assert {one.get("build", {}).get("target") for name, one in host.items() if name not in PORTS} == {"host", None}


def test_what_a_port_says_in_its_container_reaches_its_door() -> None:
    """Each listens where its container is reached, at the port that is published."""
    host = services(Side.HOST)
    settings = {name: value for name, value in host[SETUP]["environment"].items() if "${" not in value}
    config = load_config(environ=settings)
    listening = {
        "mavlink": config.mavlink.tcp,
        "ros2": config.ros2.listen.removeprefix("tcp/"),
        "foxglove": f"{config.foxglove.host}:{config.foxglove.port}",
        "nmea": config.nmea.listen,
    }
    assert listening == {name: f"0.0.0.0:{host[name]['ports'][0].rsplit(':', 1)[1]}" for name in PORTS}


@pytest.mark.parametrize("side", SIDES)
def test_whoever_has_no_door_is_on_the_bus_alone(side: Side) -> None:
    for name, one in services(side).items():
        if not one.get("ports") and name not in {SETUP, "router"}:
            assert one["networks"] == ["bus"], name
