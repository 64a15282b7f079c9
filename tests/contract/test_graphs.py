"""Graphs: in each its own producers, and access control that knows nobody else (A7)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
import zenoh

from paani import authority, keys
from paani.config import BusConfig, Config, load_config
from paani.decider import decider_of, deciders
from paani.errors import UserError
from paani.keys import Graph

GRAPHS = tuple(Graph)
PROFILE = {Graph.SIMULATION: "paani", Graph.HIL: "hil", Graph.HULL: "hull"}


def config_in(graph: Graph) -> Config:
    return load_config(profile=PROFILE[graph])


def access(graph: Graph) -> Any:
    return authority.access_control(config_in(graph).bus)


def written(graph: Graph) -> dict[str, set[str]]:
    """Keys below the vessel's prefix that each subject may put, from the router's rules themselves."""
    control, prefix = access(graph), "paani/43/otter/"
    rules: Mapping[str, Any] = {rule["id"]: rule for rule in control["rules"]}
    found: dict[str, set[str]] = {}
    for policy in control["policies"]:
        (subject,) = policy["subjects"]
        for name in policy["rules"]:
            rule = rules[name]
            if "ingress" in rule["flows"] and "put" in rule["messages"]:
                found.setdefault(subject, set()).update(key.removeprefix(prefix) for key in rule["key_exprs"])
    return found


@pytest.mark.parametrize("graph", GRAPHS)
def test_who_has_no_place_is_no_subject(graph: Graph) -> None:
    """A7: by access control, not by convention; everybody else is a subject once."""
    control = access(graph)
    named = [subject["id"] for subject in control["subjects"]]
    assert sorted(named) == sorted(
        {*keys.SERVICES, *keys.COMMAND_LINE_CLIENTS, authority.OBSERVER} - keys.ABSENT[graph]
    )
    assert {name for policy in control["policies"] for name in policy["subjects"]} == set(named)
    assert control["default_permission"] == "deny"


def test_a_simulator_and_a_hull_share_no_graph() -> None:
    """A7: what is simulated has no place on a hull, and what moves a hull none in a simulation."""
    assert keys.ABSENT[Graph.HULL] >= {"plant", "eye"}
    assert keys.ABSENT[Graph.SIMULATION] >= {"thrusters", "sensors"}
    assert not any("@truth" in key for rule in access(Graph.HULL)["rules"] for key in rule["key_exprs"])


def test_no_graph_but_hil_and_hull_has_a_publisher_to_motors() -> None:
    """By default there is no physical motor publisher: the process that speaks to a motor controller has no place."""
    assert [graph for graph in GRAPHS if "thrusters" in keys.services_in(graph)] == [Graph.HIL, Graph.HULL]
    assert load_config().bus.graph is Graph.SIMULATION
    assert "thrusters" not in written(Graph.SIMULATION)


@pytest.mark.parametrize("profile", ["paani", "paper"])
def test_k10_a_simulation_starts_no_process_that_drives_motors(profile: str) -> None:
    config = load_config(profile=profile)
    assert config.bus.graph is Graph.SIMULATION
    assert "plant" in config.services
    assert not {"thrusters", "sensors"} & set(config.services)


@pytest.mark.parametrize("graph", GRAPHS)
def test_l4_truth_reaches_nobody_that_estimates_or_decides(graph: Graph) -> None:
    """L4: the router lets the eye, the page, the recorder and an observer hear it; no decider asks for it."""
    control = access(graph)
    rules: Mapping[str, Any] = {rule["id"]: rule for rule in control["rules"]}
    readers = {
        subject
        for policy in control["policies"]
        for name in policy["rules"]
        if "egress" in rules[name]["flows"] and "put" in rules[name]["messages"]
        and any("@truth" in key for key in rules[name]["key_exprs"])
        for subject in policy["subjects"]
    }  # fmt: skip
    assert readers == (set() if graph is Graph.HULL else {"eye", "dashboard", "recorder", authority.OBSERVER})
    for decider in deciders().values():
        assert not any(topic.name.startswith("@truth/") for topic in (*decider.inputs, *decider.own))


def test_b8_b9_b10_who_judges_what() -> None:
    """B8, B9, B10: evidence is judged where tracks and advice are made, and the navigator hears that advice."""
    advisor, navigator, controller = (decider_of(name) for name in keys.DECIDING_SERVICES)
    assert keys.EVIDENCE.producer == "perception"
    assert keys.TRACKS.producer == keys.ADVISORY.producer == "advisor"
    assert keys.EVIDENCE in advisor.inputs
    assert {keys.TRACKS, keys.ADVISORY} <= set(advisor.outputs)
    assert {keys.ADVISORY, keys.ODOMETRY, keys.ARMING} <= set(navigator.inputs)
    assert navigator.outputs == (keys.COMMAND,)
    assert keys.COMMAND in controller.inputs
    assert controller.outputs == (keys.THRUST,)


def test_y1_each_interface_has_its_producer_and_those_who_decide_by_it() -> None:
    """B1, B5, B9 - B12, and the estimate that navigator and controller go by."""
    found = {
        topic.name: (topic.producer, {name for name, decider in deciders().items() if topic in decider.inputs})
        for topic in (
            keys.PICTURE, keys.EVIDENCE, keys.TRACKS, keys.ADVISORY, keys.COMMAND, keys.THRUST, keys.ODOMETRY,
        )
    }  # fmt: skip
    assert found == {
        "camera/picture": ("camera", set()),
        "perception/evidence": ("perception", {"advisor", "navigator"}),
        "advisor/tracks": ("advisor", {"navigator"}),
        "advisor/advisory": ("advisor", {"navigator"}),
        "navigator/command": ("navigator", {"controller"}),
        "controller/thrust": ("controller", set()),
        "localization/odometry": ("localization", {"advisor", "navigator", "controller"}),
    }


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_topic_has_one_writer_in_a_graph_and_it_is_there(graph: Graph) -> None:
    rights = written(graph)
    for topic in keys.TOPICS:
        row = keys.topic_in(topic, graph)
        writers = {user for user, names in rights.items() if topic.name in names}
        assert writers == ({row.producer} if row.producer else set()), topic.name
        assert row.producer not in keys.ABSENT[graph]


def test_what_each_graph_changes() -> None:
    """The clock that commands echo is the thrust adapter's own; sensors are those of the boat there is."""
    names = ("plant/clock", "plant/thrust_applied", "sensors/gps", "sensors/imu", "@truth/pose", "eye/picture")
    rows = {topic.name: topic for topic in keys.TOPICS}
    producers = {graph: [keys.topic_in(rows[name], graph).producer for name in names] for graph in GRAPHS}
    assert producers == {
        Graph.SIMULATION: ["plant", "plant", "plant", "plant", "plant", "eye"],
        Graph.HIL: ["thrusters", "thrusters", "plant", "plant", "plant", "eye"],
        Graph.HULL: ["thrusters", "thrusters", "sensors", "sensors", "", ""],
    }


@pytest.mark.parametrize("graph", GRAPHS)
def test_services_start_where_they_have_a_place(graph: Graph) -> None:
    assert not set(config_in(graph).services) & keys.ABSENT[graph]
    for service in keys.ABSENT[graph]:
        with pytest.raises(UserError, match=rf"bus\.graph {graph}: {service} has no place"):
            authority.password_of(config_in(graph).bus, service)


def test_a_graph_has_credentials_of_its_own(tmp_path: Any) -> None:
    """Those of a simulation open no hull, and making the one leaves the other."""
    folders = {}
    for graph in GRAPHS:
        bus = BusConfig(runtime_dir=str(tmp_path), graph=graph)
        folders[graph] = authority.ensure_credentials(bus)
        users = {path.name for path in folders[graph].iterdir()} - {authority.USERS_FILE}
        assert users == set(authority.users_in(graph))
        assert authority.ensure_credentials(bus) == folders[graph]
        (folders[graph] / ".nfs0001").touch()
        word = (folders[graph] / "controller").read_text()
        assert (authority.ensure_credentials(bus) / "controller").read_text() == word, (
            "a stranger's file changes nothing"
        )
    words = {graph: (folder / "controller").read_text() for graph, folder in folders.items()}
    assert len(set(words.values())) == len(GRAPHS)
    (folders[Graph.HULL] / "plant").write_text("of another day")
    authority.ensure_credentials(BusConfig(runtime_dir=str(tmp_path), graph=Graph.HULL))
    assert not (folders[Graph.HULL] / "plant").exists()
    assert "plant:" not in (folders[Graph.HULL] / authority.USERS_FILE).read_text()


@pytest.mark.parametrize(
    ("profile", "sets", "named"),
    [
        (None, ["bus.graph=hull"], r"bus\.graph 'hull' is set by the profiles hil and hull alone"),
        ("wide", ["bus.graph=hil"], r"bus\.graph 'hil' .* profile 'wide' has the graph 'simulation'"),
        ("hull", ["bus.graph=simulation"], r"bus\.graph 'simulation' .* profile 'hull'"),
        ("hull", ["bus.graph=hil"], r"bus\.graph 'hil'"),
        ("hull", ["camera.source=sim"], r"camera\.source 'sim': a hull has no simulated camera"),
        (
            None,
            ["thrusters.autopilot.line=serial:/dev/ttyUSB0@57600"],
            r"thrusters\.autopilot\.line .* drives a real boat alone",
        ),
        ("hil", ["thrusters.line=serial:/dev/ttyUSB0@115200"], r"thrusters\.line .* drives an emulator alone"),
        ("hull", ["up.arm_at_start=true"], r"up\.arm_at_start: profile hull waits for its operator"),
        ("hil", ["up.arm_at_start=true"], r"up\.arm_at_start: profile hil waits for its operator"),
    ],
)
def test_a_graph_is_named_on_purpose(profile: str | None, sets: list[str], named: str) -> None:
    with pytest.raises(UserError, match=named) as refusal:
        load_config(profile=profile, sets=sets)
    assert "\n" not in str(refusal.value)


def test_a_profile_of_a_later_layer_wins(tmp_path: Any) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('profile = "paani"\n[advisor]\nrate_hz = 4.0\n')
    config = load_config(file=file, sets=["profile=hull"])
    assert (config.profile, config.bus.graph, config.advisor.rate_hz) == ("hull", Graph.HULL, 4.0)


@pytest.mark.parametrize("graph", GRAPHS)
def test_b13_no_rule_but_the_controllers_reaches_thrust(graph: Graph) -> None:
    thrust = zenoh.KeyExpr(keys.THRUST.name)
    writers = {
        user for user, names in written(graph).items() if any(zenoh.KeyExpr(name).intersects(thrust) for name in names)
    }
    assert writers == {"controller"}
