"""The compose files: each side's processes, closed and bounded. Whether an engine runs them: tests/deploy."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

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
    """A5; in a hull all control is the board's. Ports run where somebody asks for them."""
    assert started(side, profile, "mcu", "record") - {SETUP} == set(services_on(side, graph)) - {*PORTS}


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
def test_only_the_boards_router_and_the_page_have_a_door(side: Side) -> None:
    doors = {name: one["ports"] for name, one in services(side).items() if one.get("ports")}
    assert set(doors) == ({"router"} if side is Side.BOARD else {"dashboard"})
    if side is Side.HOST:
        assert all(port.startswith("127.0.0.1:") for port in doors["dashboard"])


@pytest.mark.parametrize("side", SIDES)
def test_whoever_has_no_door_is_on_the_bus_alone(side: Side) -> None:
    for name, one in services(side).items():
        if not one.get("ports") and name not in {SETUP, "router"}:
            assert one["networks"] == ["bus"], name
