"""One table of everything on the bus: who may write what, how often, how old it may be, how it travels.

The routers' access control, the health checks, the README's table and the dashboard's inspector are
generated from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Generic, TypeVar

import msgspec

from paani import messages as m

T = TypeVar("T", bound=m.Message)


class Graph(StrEnum):
    """Which processes may exist together, and what their thrust moves.

    SIMULATION: a simulated boat, whose plant applies the thrust. HIL (hardware in the loop): the same boat, driven by
    the PWM of an emulated microcontroller alone. HULL: a real boat; no simulator.
    """

    SIMULATION = "simulation"
    HIL = "hil"
    HULL = "hull"


class Stance(StrEnum):
    """How a topic travels.

    STATE is republished, newest wins; EVENT keeps a short queue; COMMAND is newest-wins and urgent;
    PICTURE is encoded bytes with a `PictureHeader` attached, pushed on one machine and pulled across machines.
    """

    STATE = "state"
    EVENT = "event"
    COMMAND = "command"
    PICTURE = "picture"


class Topic(msgspec.Struct, Generic[T], frozen=True, kw_only=True):
    """A row of the table. `name` is the key below `paani/<domain>/<vessel>/`.

    `producer` writes it in a simulation; `topic_in` gives the row of another graph. Without one, nobody may.
    """

    name: str
    type: type[T]
    producer: str
    rate_hz: float
    fresh_s: float
    stance: Stance
    summary: str

    def key(self, domain: int, vessel: str) -> str:
        return f"paani/{domain}/{vessel}/{self.name}"

    def stamp(self, message: T, *, domain: int, seq: int, epoch: int, sent_us: int, steady_us: int = 0) -> T:
        """The message with the header of its publisher: this topic, its producer, and these."""
        return msgspec.structs.replace(
            message,
            seq=seq,
            epoch=epoch,
            domain=domain,
            producer=self.producer,
            sent_us=sent_us,
            steady_us=steady_us,
            topic=self.name,
        )

    @property
    def media_type(self) -> str:
        """Zenoh encoding of the payload."""
        if self.stance is Stance.PICTURE:
            return "image/jpeg"
        return f"application/json;paani.{self.type.__name__}"


# One row, one glance.
# fmt: off
PICTURE = Topic(
    name="camera/picture", type=m.PictureHeader, producer="camera", rate_hz=5.0, fresh_s=0.8,
    stance=Stance.PICTURE, summary="the camera's newest picture",
)
RENDERED = Topic(
    name="eye/picture", type=m.PictureHeader, producer="eye", rate_hz=5.0, fresh_s=0.8,
    stance=Stance.PICTURE, summary="picture rendered from the true pose",
)
MASK = Topic(
    name="perception/mask", type=m.PictureHeader, producer="perception", rate_hz=5.0, fresh_s=0.8,
    stance=Stance.PICTURE, summary="class mask (PNG: 0 water, 1 obstacle, 2 sky) of the frame it names",
)
EVIDENCE = Topic(
    name="perception/evidence", type=m.Evidence, producer="perception", rate_hz=5.0, fresh_s=0.8,
    stance=Stance.STATE, summary="usability, detections and corridors of one picture",
)
TRACKS = Topic(
    name="advisor/tracks", type=m.Tracks, producer="advisor", rate_hz=5.0, fresh_s=0.8,
    stance=Stance.STATE, summary="tracked boxes with identity, acceptance and motion",
)
ADVISORY = Topic(
    name="advisor/advisory", type=m.Advisory, producer="advisor", rate_hz=5.0, fresh_s=3.5,
    stance=Stance.COMMAND, summary="advised direction with the evidence that decided it",
)
COMMAND = Topic(
    name="navigator/command", type=m.NavCommand, producer="navigator", rate_hz=10.0, fresh_s=0.5,
    stance=Stance.COMMAND, summary="heading, speed and enable, together",
)
ROUTE = Topic(
    name="navigator/route", type=m.Route, producer="navigator", rate_hz=0.5, fresh_s=10.0,
    stance=Stance.STATE, summary="the route being followed",
)
MISSION = Topic(
    name="navigator/mission", type=m.Mission, producer="navigator", rate_hz=0.5, fresh_s=10.0,
    stance=Stance.STATE, summary="the legs of the mission, the fence, and rally points",
)
PREDICTION = Topic(
    name="navigator/prediction", type=m.Prediction, producer="navigator", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.STATE, summary="the way ahead by the order in force, moving obstacles, and home; for people",
)
OCCUPANCY = Topic(
    name="navigator/occupancy", type=m.OccupancyGrid, producer="navigator", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.STATE, summary="occupied, free and unknown water around the boat; for people and programs",
)
THRUST = Topic(
    name="controller/thrust", type=m.Thrust, producer="controller", rate_hz=10.0, fresh_s=0.5,
    stance=Stance.COMMAND, summary="normalised thrust of the two fans",
)
LOCAL_ODOMETRY = Topic(
    name="localization/local", type=m.Odometry, producer="localization", rate_hz=20.0, fresh_s=0.3,
    stance=Stance.STATE, summary="drift-free in the short term, from the IMU alone",
)
ODOMETRY = Topic(
    name="localization/odometry", type=m.Odometry, producer="localization", rate_hz=20.0, fresh_s=0.3,
    stance=Stance.STATE, summary="pose in the map frame, from GPS and IMU",
)
ARMING = Topic(
    name="operator/arming", type=m.Arming, producer="operator", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.COMMAND, summary="the operator's arm and latched stop",
)
OPERATOR_STATE = Topic(
    name="operator/state", type=m.OperatorState, producer="operator", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.STATE, summary="armed or stopped, who asked for it, and whether the latch is on disk",
)
OPERATOR_ORDER = Topic(
    name="operator/order", type=m.OperatorOrder, producer="operator", rate_hz=10.0, fresh_s=0.5,
    stance=Stance.COMMAND, summary="the mode in force, its station, and what a hand says",
)
ORDERED_MISSION = Topic(
    name="operator/mission", type=m.Mission, producer="operator", rate_hz=0.5, fresh_s=10.0,
    stance=Stance.STATE, summary="mission, fence and rally points accepted last from a client; empty before",
)
TUNING = Topic(
    name="operator/tuning", type=m.Tuning, producer="dashboard", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.COMMAND, summary="the operator's request to try, promote or take back parameters of the policy",
)
SHADOW = Topic(
    name="advisor/shadow", type=m.Shadow, producer="advisor", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.STATE, summary="parameters tried beside those in force, and where the advice would differ",
)
SIM_TIME = Topic(
    name="plant/clock", type=m.SimTime, producer="plant", rate_hz=20.0, fresh_s=0.5,
    stance=Stance.STATE, summary="the plant's time and the stamp that commands echo",
)
GPS = Topic(
    name="sensors/gps", type=m.GpsFix, producer="plant", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.STATE, summary="position, speed and course of the receiver, with its stated error",
)
IMU = Topic(
    name="sensors/imu", type=m.ImuSample, producer="plant", rate_hz=100.0, fresh_s=0.2,
    stance=Stance.EVENT, summary="body rates, specific force, and orientation where there is one",
)
AIS = Topic(
    name="sensors/ais", type=m.AisVessels, producer="plant", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.STATE, summary="vessels that tell their position by AIS, as the receiver heard them",
)
SCAN = Topic(
    name="sensors/scan", type=m.RangeScan, producer="plant", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.STATE, summary="ranges all round of a planar scanner, where the boat has one",
)
DEPTH = Topic(
    name="sensors/depth", type=m.Depth, producer="plant", rate_hz=5.0, fresh_s=2.0,
    stance=Stance.STATE, summary="depth of the water under the boat, by its echo sounder",
)
THRUST_APPLIED = Topic(
    name="plant/thrust_applied", type=m.ThrustApplied, producer="plant", rate_hz=20.0, fresh_s=0.5,
    stance=Stance.STATE, summary="what the thrust adapter applies, and why not",
)
TRUE_POSE = Topic(
    name="@truth/pose", type=m.TruePose, producer="plant", rate_hz=20.0, fresh_s=0.5,
    stance=Stance.STATE, summary="simulator truth: eye, dashboard and scoring only",
)
BRIDGE_STATE = Topic(
    name="bridge/state", type=m.BridgeState, producer="bridge", rate_hz=10.0, fresh_s=0.6,
    stance=Stance.STATE, summary="the microcontroller that shows the advice: line, state, display, counters",
)
SENSORS_STATE = Topic(
    name="sensors/state", type=m.SensorsState, producer="sensors", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.STATE, summary="each device of a real hull: its status, rate, age and failures",
)
THRUSTERS_STATE = Topic(
    name="thrusters/state", type=m.ThrustersState, producer="thrusters", rate_hz=5.0, fresh_s=1.0,
    stance=Stance.STATE, summary="the line to the microcontroller that drives the thrusters, and what it says",
)
RECORDER_STATE = Topic(
    name="recorder/state", type=m.RecorderState, producer="recorder", rate_hz=1.0, fresh_s=3.0,
    stance=Stance.STATE, summary="what the recorder writes, dropped and never heard",
)

DECIDING_SERVICES = ("advisor", "navigator", "controller")
STEPS = {
    service: Topic(
        name=f"{service}/step", type=m.Step, producer=service, rate_hz=10.0, fresh_s=1.0, stance=Stance.EVENT,
        summary=f"what each step of the {service} had heard, and what it sent",
    )
    for service in DECIDING_SERVICES
}

# Who may ask the operator's process to stop, to arm or to drive: the page, `paani stop`, the shore of a fleet
# (`paani fleet`), a hardware button, and `paani up` for a simulated boat.
STATION, SHORE, BUTTON = "dashboard", "shore", "button"
STOPPING_COMMANDS = ("stop", SHORE)
STOPPING_CLIENTS = (*STOPPING_COMMANDS, BUTTON)  # what they hold arms nothing, and they drive nothing
COMMAND_LINE_CLIENTS = (*STOPPING_COMMANDS, "arm", "mission")
# Processes that carry the bus to what others use, and run only where `up.ports` names them. Some of them ask the
# operator's process for what a person asks of them.
PORTS = ("mavlink", "ros2", "foxglove", "nmea")
ASKING_PORTS = ("mavlink", "ros2")
REQUESTS = {
    client: Topic(
        name=f"operator/request/{client}", type=m.OperatorRequest, producer=client, rate_hz=10.0, fresh_s=0.6,
        stance=Stance.COMMAND, summary=f"what {client} asks of the operator's process: STOP"
        + ("" if client in STOPPING_CLIENTS else ", a hold that arms, a mode, or the wheel"),
    )
    for client in (STATION, *ASKING_PORTS, *STOPPING_CLIENTS, "arm")
}
# Who may ask it for another mission, fence or rally points; `paani mission` may ask for nothing else.
MISSION_REQUESTS = {
    client: Topic(
        name=f"operator/mission_request/{client}", type=m.MissionRequest, producer=client, rate_hz=1.0, fresh_s=2.0,
        stance=Stance.EVENT, summary=f"mission, fence or rally points that {client} asks the operator's process for",
    )
    for client in (STATION, *ASKING_PORTS, "mission")
}
# Who may ask the page's process to have parameters tried; to promote them it takes a hand on the page.
TUNING_PROPOSALS = {
    client: Topic(
        name=f"operator/tuning_proposal/{client}", type=m.TuningProposal, producer=client, rate_hz=1.0, fresh_s=2.0,
        stance=Stance.EVENT, summary=f"parameters of the policy that {client} asks the page's process to have tried",
    )
    for client in ("mavlink",)
}
# Nobody owes one of these.
ASKED: tuple[Topic[Any], ...] = (*REQUESTS.values(), *MISSION_REQUESTS.values(), *TUNING_PROPOSALS.values())

TOPICS: tuple[Topic[Any], ...] = (
    PICTURE, RENDERED, MASK, EVIDENCE, TRACKS, ADVISORY, COMMAND, ROUTE, MISSION, PREDICTION, OCCUPANCY, THRUST,
    LOCAL_ODOMETRY, ODOMETRY, ARMING, OPERATOR_STATE, OPERATOR_ORDER, ORDERED_MISSION, TUNING, SHADOW, SIM_TIME, GPS,
    IMU, AIS, SCAN, DEPTH, THRUST_APPLIED, THRUSTERS_STATE, TRUE_POSE, BRIDGE_STATE, SENSORS_STATE, RECORDER_STATE,
    *ASKED, *STEPS.values(),
)
# fmt: on

NOBODY = ""
# Who writes a topic in a graph where it is not the producer of its row.
PRODUCERS: Mapping[Graph, Mapping[str, str]] = {
    Graph.SIMULATION: {},
    Graph.HIL: {SIM_TIME.name: "thrusters", THRUST_APPLIED.name: "thrusters"},
    Graph.HULL: {
        SIM_TIME.name: "thrusters",
        THRUST_APPLIED.name: "thrusters",
        GPS.name: "sensors",
        IMU.name: "sensors",
        AIS.name: "sensors",
        SCAN.name: "sensors",
        DEPTH.name: "sensors",
        RENDERED.name: NOBODY,
        TRUE_POSE.name: NOBODY,
    },
}

SERVICES = (
    "router", "recorder", "plant", "eye", "sensors", "camera", "perception", "advisor", "navigator", "controller",
    "localization", "thrusters", "bridge", "operator", BUTTON, "dashboard", *PORTS,
)  # fmt: skip
# Who has no place in a graph: no credential there, and no rights. Only a simulated boat is armed without a hand.
ABSENT: Mapping[Graph, frozenset[str]] = {
    Graph.SIMULATION: frozenset({"thrusters", "sensors"}),
    Graph.HIL: frozenset({"sensors", "arm"}),
    Graph.HULL: frozenset({"plant", "eye", "arm"}),
}
BOARD_SERVICES = (
    "sensors", "camera", "perception", "advisor", "navigator", "controller", "thrusters", "bridge", BUTTON,
)  # fmt: skip
VITAL_SERVICES = (
    "eye", "camera", "perception", "advisor", "navigator", "controller", "localization", "operator", "dashboard",
)  # fmt: skip
BEATING_SERVICES = (*VITAL_SERVICES, BUTTON)  # a button is vital where there is one (`button.line`)


def services_in(graph: Graph) -> tuple[str, ...]:
    """Processes that have a place in this graph, in the order they start."""
    return tuple(name for name in SERVICES if name not in ABSENT[graph])


def command_line_clients_in(graph: Graph) -> tuple[str, ...]:
    """Commands that may join the bus of this graph to ask the operator's process; they are no services."""
    return tuple(name for name in COMMAND_LINE_CLIENTS if name not in ABSENT[graph])


def topic_in(topic: Topic[T], graph: Graph) -> Topic[T]:
    """The row of a topic in this graph: its producer is who may write it there, or `NOBODY`."""
    producer = PRODUCERS[graph].get(topic.name, topic.producer)
    if producer in ABSENT[graph]:
        producer = NOBODY
    return topic if producer == topic.producer else msgspec.structs.replace(topic, producer=producer)


def topics_in(graph: Graph) -> tuple[Topic[Any], ...]:
    """The rows that somebody writes in this graph."""
    rows = (topic_in(topic, graph) for topic in TOPICS)
    return tuple(row for row in rows if row.producer != NOBODY)


def topics_ashore(graph: Graph) -> tuple[Topic[Any], ...]:
    """What the shore of a fleet may hear of a vessel: where it is, what it is about, who has stopped it, and health."""
    rows = (ODOMETRY, ADVISORY, COMMAND, OPERATOR_STATE, THRUST_APPLIED)
    return (*(topic_in(row, graph) for row in rows), *(health(name) for name in services_in(graph)))


def producers_text(topic: Topic[Any]) -> str:
    """Who writes a topic, and who does in the graphs where it is another."""
    others: dict[str, list[str]] = {}
    for graph in Graph:
        if (producer := topic_in(topic, graph).producer) != topic.producer:
            others.setdefault(producer or "nobody", []).append(graph.value)
    words = [f"{', '.join(graphs)}: {producer}" for producer, graphs in others.items()]
    return f"{topic.producer} ({'; '.join(words)})" if words else topic.producer


def pulse(service: str) -> Topic[m.Pulse]:
    """The heartbeat of one process."""
    return Topic(
        name=f"pulse/{service}",
        type=m.Pulse,
        producer=service,
        rate_hz=10.0,
        fresh_s=0.4,
        stance=Stance.COMMAND,
        summary=f"heartbeat of {service}",
    )


def health(service: str) -> Topic[m.Health]:
    """The one-second report of one process."""
    return Topic(
        name=f"health/{service}",
        type=m.Health,
        producer=service,
        rate_hz=1.0,
        fresh_s=3.0,
        stance=Stance.STATE,
        summary=f"health of {service}",
    )


def every_topic(graph: Graph | None = None) -> tuple[Topic[Any], ...]:
    """What is written in this graph, every pulse and every health report of it. None: of all graphs."""
    services = SERVICES if graph is None else services_in(graph)
    pulses = (pulse(name) for name in BEATING_SERVICES if name in services)
    return (*(TOPICS if graph is None else topics_in(graph)), *pulses, *(health(name) for name in services))


# Ends the vessel's name of a recording that is played again, so that every key says so.
REPLAY_SUFFIX = "_replay"


def alive_name(service: str) -> str:
    """Liveliness token of one process, below the vessel's prefix; the verbatim chunk keeps it out of `**`."""
    return f"@alive/{service}"
