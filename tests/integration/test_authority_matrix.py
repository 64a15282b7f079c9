"""Build 6: every identity x every key x everything that can be done there, against the table of keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani import keys
from paani.keys import Graph
from tests.integration.authority_matrix import bus_in, expected_answers, expected_heard, try_everything

pytestmark = pytest.mark.integration


@pytest.mark.parametrize(
    ("graph", "by_certificate"),
    [(Graph.SIMULATION, False), (Graph.SIMULATION, True), (Graph.HULL, True)],
    ids=["simulation-password", "simulation-certificate", "hull-certificate"],
)
def test_nobody_does_more_or_less_than_the_table_says(tmp_path: Path, graph: Graph, by_certificate: bool) -> None:
    """Forged 0, by wildcards 0, and what is allowed arrives: a router that lets nothing through fails as well."""
    matrix = try_everything(bus_in(tmp_path, graph, by_certificate=by_certificate))
    assert matrix.stray == []
    for topic in keys.every_topic(graph):
        for user in matrix.users:
            assert matrix.heard.get((user, topic.name), set()) == expected_heard(graph, user, topic), (user, topic.name)
            assert matrix.answers.get((user, topic.name), set()) == expected_answers(user, topic), (user, topic.name)
    assert matrix.wide_answers == 0
    assert matrix.forged_tokens == set()
    assert matrix.own_tokens == set(keys.services_in(graph))
