"""Board and host: every process has one side, and the link lets through what that side may write and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from paani import authority, keys
from paani.bus.routing import listening
from paani.config import BusConfig, Config, load_config
from paani.errors import UserError
from paani.keys import Graph
from paani.link_access import LINK
from paani.sides import (
    ECHOES,
    ON_BOARD,
    ROUTER,
    Side,
    is_sent_from,
    pictures_sent,
    services_on,
    topics_sent,
    writers_on,
)

SIDES = (Side.BOARD, Side.HOST)
PROFILE = {Graph.SIMULATION: "paani", Graph.HIL: "hil", Graph.HULL: "hull"}
PREFIX = "paani/43/otter/"


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder with every graph's passwords; nobody changes it."""
    folder = str(tmp_path_factory.mktemp("runtime"))
    for graph in Graph:
        authority.ensure_credentials(BusConfig(runtime_dir=folder, graph=graph))
    return folder


def config_on(side: Side, graph: Graph, runtime: str) -> Config:
    sets = (f"bus.side={side}", "bus.link=tcp/127.0.0.1:7448", f"bus.runtime_dir={runtime}")
    return load_config(profile=PROFILE[graph], sets=sets)


def rights(config: BusConfig, flow: str, message: str) -> dict[str, set[str]]:
    """Keys below the vessel's prefix by subject, from the router's rules themselves."""
    control: Any = authority.access_control(config)
    rules: Mapping[str, Any] = {rule["id"]: rule for rule in control["rules"]}
    found: dict[str, set[str]] = {}
    for policy in control["policies"]:
        for subject in policy["subjects"]:
            for rule in (rules[name] for name in policy["rules"]):
                if flow in rule["flows"] and message in rule["messages"]:
                    found.setdefault(subject, set()).update(key.removeprefix(PREFIX) for key in rule["key_exprs"])
    return found


@pytest.mark.parametrize("graph", Graph)
def test_every_process_has_one_side(graph: Graph) -> None:
    board, host = (set(services_on(side, graph)) for side in SIDES)
    assert board & host == {ROUTER}
    assert board | host == set(keys.services_in(graph)) == set(services_on(Side.BOTH, graph))
    assert ON_BOARD[graph] <= set(keys.services_in(graph))


@pytest.mark.parametrize("graph", Graph)
def test_stop_may_be_asked_for_on_either_machine_and_arming_only_where_the_operator_is(graph: Graph) -> None:
    for side in SIDES:
        clients = set(writers_on(side, graph)) - set(services_on(side, graph))
        asks = ({"mission"} | {"arm"} - keys.ABSENT[graph]) if side is Side.HOST else set()
        assert clients == {"stop", "shore"} | asks
        assert ("arm" in asks) is (side is Side.HOST and graph is Graph.SIMULATION)


def test_the_papers_split_and_a_hulls() -> None:
    """Seeing and judging on the board; of a hull all control too, and the operator where the person is."""
    assert services_on(Side.BOARD, Graph.HIL) == services_on(Side.BOARD, Graph.SIMULATION)
    assert services_on(Side.BOARD, Graph.SIMULATION) == (
        "router",
        "camera",
        "perception",
        "advisor",
        "bridge",
        "button",
    )
    assert {"plant", "eye", "localization", "navigator", "controller"} <= set(services_on(Side.HOST, Graph.SIMULATION))
    assert {"localization", "navigator", "controller", "thrusters"} <= set(services_on(Side.BOARD, Graph.HULL))
    assert keys.ARMING.producer in services_on(Side.HOST, Graph.HULL)


@pytest.mark.parametrize("graph", [Graph.SIMULATION, Graph.HIL])
def test_x2_the_board_sees_and_advises_and_the_host_estimates_and_applies_the_thrust(graph: Graph) -> None:
    board, host = ({topic.name for topic in topics_sent(side, graph)} for side in SIDES)
    assert {"camera/picture", "perception/evidence", "advisor/tracks", "advisor/advisory"} <= board - host
    assert {"sensors/gps", "sensors/imu", "localization/odometry", "controller/thrust"} <= host - board
    assert "plant/thrust_applied" in host - board
    assert [topic.name for topic in keys.TOPICS if topic.producer == "bridge"] == ["bridge/state"]


@pytest.mark.parametrize("graph", Graph)
@pytest.mark.parametrize("side", SIDES)
def test_the_link_lets_in_what_the_other_side_may_write(side: Side, graph: Graph, runtime: str) -> None:
    """No picture is pushed, no truth crosses, and nobody of the other side writes here by another way."""
    bus = config_on(side, graph, runtime).bus
    writers = rights(bus, "ingress", "put")
    pictures = {topic.name for topic in pictures_sent(side.other, graph)}
    assert writers[LINK] == {topic.name for topic in topics_sent(side.other, graph)} - pictures
    assert not any(name.startswith("@truth") or name.endswith(f"/{ROUTER}") for name in writers[LINK])
    own = {name: set(authority.written_by(name, graph)) for name in writers_on(side, graph)}
    if side is Side.HOST:
        own[ROUTER] |= pictures
    assert {user: names for user, names in writers.items() if user != LINK} == own


@pytest.mark.parametrize("graph", Graph)
@pytest.mark.parametrize("message", ["put", "delete", "declare_subscriber", "liveliness_token"])
def test_what_one_side_lets_out_the_other_lets_in(graph: Graph, message: str, runtime: str) -> None:
    board, host = (config_on(side, graph, runtime).bus for side in SIDES)
    for here, there in ((board, host), (host, board)):
        sent, taken = (rights(here, "egress", message)[LINK], rights(there, "ingress", message)[LINK])
        assert sent == taken
        assert sent
        assert not any("*" in name for name in sent)


@pytest.mark.parametrize("graph", Graph)
def test_pictures_are_asked_for_at_the_board_alone(graph: Graph, runtime: str) -> None:
    board, host = (config_on(side, graph, runtime).bus for side in SIDES)
    asked = {topic.name for topic in pictures_sent(Side.BOARD, graph)}
    offered = {topic.name for topic in pictures_sent(Side.HOST, graph)}
    assert rights(board, "ingress", "query")[LINK] == asked == rights(board, "egress", "reply")[LINK]
    assert rights(board, "egress", "query").get(LINK, set()) == offered
    for flow in ("ingress", "egress"):
        for message in ("query", "reply", "declare_queryable"):
            assert LINK not in rights(host, flow, message)


def test_each_router_knows_the_other_by_what_it_is_told(runtime: str) -> None:
    """A user name comes from whoever connects; of whom it connects to, a router is told the id alone."""
    subjects = {}
    for side in SIDES:
        control: Any = authority.access_control(config_on(side, Graph.SIMULATION, runtime).bus)
        (subjects[side],) = (subject for subject in control["subjects"] if subject["id"] == LINK)
    board_id = authority.board_router_id(config_on(Side.HOST, Graph.SIMULATION, runtime).bus)
    assert subjects == {
        Side.BOARD: {"id": LINK, "usernames": [LINK]},
        Side.HOST: {"id": LINK, "zids": [board_id]},
    }
    assert len(board_id) == 32
    assert board_id != authority.board_router_id(config_on(Side.HOST, Graph.HULL, runtime).bus)


def test_the_shore_signs_in_at_the_board_where_there_are_two_machines(runtime: str) -> None:
    """At a door of its own, and only where one is set."""
    sets = ("bus.shore=tcp/127.0.0.1:7450", "bus.link=tcp/127.0.0.1:7448", f"bus.runtime_dir={runtime}")
    doors = {side: listening(load_config(sets=(f"bus.side={side}", *sets)).bus) for side in Side}
    router = Config().bus.router
    assert doors[Side.BOTH] == [router, "tcp/127.0.0.1:7450"]
    assert doors[Side.BOARD] == [router, "tcp/127.0.0.1:7448", "tcp/127.0.0.1:7450"]
    assert doors[Side.HOST] == [router] == listening(Config().bus)


def test_one_machine_has_no_link(runtime: str) -> None:
    control: Any = authority.access_control(load_config(sets=(f"bus.runtime_dir={runtime}",)).bus)
    assert LINK not in {subject["id"] for subject in control["subjects"]}
    assert not any(str(rule["id"]).startswith("link") for rule in control["rules"])


def test_a_host_takes_the_boards_credentials_and_makes_none(tmp_path: Path) -> None:
    host = BusConfig(runtime_dir=str(tmp_path), side=Side.HOST, link="tcp/127.0.0.1:7448")
    with pytest.raises(UserError, match="not the board's credentials; copy there the folder that the board has made"):
        authority.ensure_credentials(host)
    assert not authority.credentials_folder(host).exists()
    made = authority.ensure_credentials(BusConfig(runtime_dir=str(tmp_path), side=Side.BOARD, link=host.link))
    assert authority.ensure_credentials(host) == made


@pytest.mark.parametrize("graph", Graph)
def test_who_echoes_for_its_side_has_a_pulse_and_is_on_no_other(graph: Graph) -> None:
    for side in SIDES:
        assert ECHOES[side] in keys.VITAL_SERVICES
        assert is_sent_from(side, keys.pulse(ECHOES[side]), graph)
        assert not is_sent_from(side.other, keys.pulse(ECHOES[side]), graph)
        assert keys.pulse(ECHOES[side]).name in {topic.name for topic in topics_sent(side, graph)}
    assert not any(is_sent_from(side, keys.health(ROUTER), graph) for side in SIDES)


@pytest.mark.parametrize("graph", Graph)
@pytest.mark.parametrize("side", SIDES)
def test_l4_on_either_machine_the_truth_reaches_nobody_that_decides(side: Side, graph: Graph, runtime: str) -> None:
    reaching = rights(config_on(side, graph, runtime).bus, "egress", "put")
    readers = {user for user, names in reaching.items() if any(name.startswith("@truth") for name in names)}
    assert readers <= {"eye", "dashboard", "recorder", authority.OBSERVER}
