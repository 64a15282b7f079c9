"""Which machine each process runs on where a boat's board and its host are two, and what crosses the link between them.

`paani up --only`, the routers' access control and the deployment are made from `ON_BOARD`. The router is on both sides,
and speaks of its own machine alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from paani.keys import (
    BUTTON,
    STOPPING_CLIENTS,
    Graph,
    Stance,
    Topic,
    command_line_clients_in,
    every_topic,
    services_in,
)

ROUTER = "router"
TRUTH = "@truth/"


class Side(StrEnum):
    """The processes of a graph that run on this machine: all of them, the board's, or the host's."""

    BOTH = "both"
    BOARD = "board"
    HOST = "host"

    @property
    def other(self) -> Side:
        return {Side.BOARD: Side.HOST, Side.HOST: Side.BOARD}.get(self, self)


# The other processes of the graph are the host's. On a hull nothing that decides where it goes is the host's; but the
# operator is, without whose word the thrusters stand still: a boat out of reach of STOP does not drive on.
ON_BOARD: Mapping[Graph, frozenset[str]] = {
    Graph.SIMULATION: frozenset({"camera", "perception", "advisor", "bridge", BUTTON}),
    Graph.HIL: frozenset({"camera", "perception", "advisor", "bridge", BUTTON}),
    Graph.HULL: frozenset(
        {
            "sensors", "camera", "perception", "advisor", "navigator", "controller", "localization", "thrusters",
            "bridge", BUTTON,
        }
    ),
}  # fmt: skip

# Whose pulse tells the other machine this one's time: a vital process that its side has in every graph.
ECHOES: Mapping[Side, str] = {Side.BOARD: "advisor", Side.HOST: "operator"}


def is_sent_from(side: Side, topic: Topic[Any], graph: Graph) -> bool:
    """Whether a topic is written on this side of two alone, and not on the other."""
    return topic.producer in services_on(side, graph) and topic.producer not in services_on(side.other, graph)


def services_on(side: Side, graph: Graph) -> tuple[str, ...]:
    """Processes of this side, in the order they start."""
    services = services_in(graph)
    if side is Side.BOTH:
        return services
    is_board = side is Side.BOARD
    return tuple(name for name in services if name == ROUTER or (name in ON_BOARD[graph]) is is_board)


def writers_on(side: Side, graph: Graph) -> tuple[str, ...]:
    """Who writes at the router of this side: its processes, and the commands that ask the operator's process.

    STOP may be asked for on either machine; arming only where the operator is.
    """
    clients = tuple(
        name for name in command_line_clients_in(graph) if name in STOPPING_CLIENTS or side is not Side.BOARD
    )
    return (*services_on(side, graph), *clients)


def topics_on(side: Side, graph: Graph) -> tuple[Topic[Any], ...]:
    """What is written on this side."""
    writers = writers_on(side, graph)
    return tuple(topic for topic in every_topic(graph) if topic.producer in writers)


def topics_sent(side: Side, graph: Graph) -> tuple[Topic[Any], ...]:
    """What this side sends to the other by itself: all it writes but the simulator's truth and its router's health.

    Pictures are among them, but only on being asked for.
    """
    return tuple(
        topic
        for topic in topics_on(side, graph)
        if side is not Side.BOTH and topic.producer != ROUTER and not topic.name.startswith(TRUTH)
    )


def pictures_sent(side: Side, graph: Graph) -> tuple[Topic[Any], ...]:
    """Pictures of this side that the other may pull."""
    return tuple(topic for topic in topics_sent(side, graph) if topic.stance is Stance.PICTURE)
