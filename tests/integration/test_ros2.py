"""The ROS 2 port as a process, with a node of an implementation that is not ours: zenoh-ros2-sdk.

What the node hears is what the bus says; what it says reaches nothing but STOP.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import os
import struct
import sys
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani.occupancy_cells import pack_cells
from paani.operator_client import OperatorClient
from paani_services.ros2 import topics
from paani_services.ros2.schemas import decode, type_hash
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.places import ROOT
from tests.transcript import Transcript
from tests.unit.paani_services.ros2.test_schemas import HASHES

pytestmark = [pytest.mark.integration, pytest.mark.timeout(90)]
CLOCK = WallClock()
JPEG = b"\xff\xd8" + bytes(range(256)) * 40 + b"\xff\xd9"
GRID = m.OccupancyGrid(
    source_us=CLOCK.now_us(), west_m=-4.0, south_m=7.0, cell_m=0.2, columns=3, rows=2,
    cells=pack_cells(np.array([[0, 1, 2], [3, 1, 2]], np.uint8)),
)  # fmt: skip
BOOL = type_hash("std_msgs/Bool")
STOP_KEY = f"43/otter/stop/std_msgs::msg::dds_::Bool_/{BOOL}"


class Node:
    """The node, in a process of its own."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self.transcript = Transcript()
        self._asked = ""
        self.heard: dict[str, list[Any]] = {}
        self.leaked: list[str] = []
        self.tokens: list[str] = []
        self.latched: list[str] = []
        self.ready = False

    async def listen(self) -> None:
        assert self._process.stdout is not None
        while line := await self._process.stdout.readline():
            words = json.loads(line)
            if "topic" in words:
                self.heard.setdefault(words["topic"], []).append(words["message"])
            self.ready = self.ready or "ready" in words
            self.leaked += [words["leaked"]] if "leaked" in words else []
            self.tokens = words.get("tokens", self.tokens)
            self.latched += [words["latched"]] if "latched" in words else []

    def ask(self, **words: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(words).encode() + b"\n")
        if "publish" in words and (asked := f"publishes {words['publish']} {compact(words['fields'])}") != self._asked:
            self._asked = asked  # a stick is said again and again
            self.transcript.note("node", asked)

    async def until(self, condition: Callable[[], bool], what: str, act: Callable[[], None] | None = None) -> None:
        try:
            async with asyncio.timeout(20):
                while not condition():
                    if act is not None:
                        act()
                    await asyncio.sleep(0.1)
        except TimeoutError:
            pytest.fail(f"not within 20 s: {what}; heard { ({name: len(all_) for name, all_ in self.heard.items()}) }")
        self.transcript.note("checked", what)


def compact(fields: dict[str, Any]) -> str:
    """Fields of a message in one line, the names of their types left out."""

    def without_types(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: without_types(each) for name, each in value.items() if name != "type"}
        return value[:20] if isinstance(value, str) else value

    return json.dumps(without_types(fields)).replace('"', "")


@contextlib.asynccontextmanager
async def joined(port: int, *wanted: topics.RosTopic, mode: str = "peer") -> AsyncIterator[Node]:
    """mode: `peer` as every ROS node, which also speaks to other nodes directly; a `client` has the router alone."""
    hashes = {"tf2_msgs/TFMessage": type_hash("tf2_msgs/TFMessage")}
    hashes |= {kind: f"RIHS01_{digits}" for kind, digits in HASHES.items()}
    arguments = ["=".join((t.full_name("otter"), t.type.replace("/", "/msg/"), hashes[t.type])) for t in wanted]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.ros2_peer", str(port), "43", *arguments, cwd=ROOT,
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, limit=1 << 22,
        env={**os.environ, "ZENOH_CONFIG_OVERRIDE": f'mode="{mode}"'},
    )  # fmt: skip
    node = Node(process)
    listening = asyncio.create_task(node.listen())
    try:
        await node.until(lambda: node.ready, "the node is there")
        yield node
    finally:
        assert process.stdin is not None
        process.stdin.close()
        try:
            async with asyncio.timeout(5):
                await process.wait()
        except TimeoutError:
            process.kill()
            await process.wait()
        await listening


async def test_a_node_hears_a_drive(spawn: Spawn, open_as: OpenAs, transcript: Transcript) -> None:
    """A boat adrift in the simulated river: its real estimate, beside what other processes would say."""
    listen = find_free_port()
    observer = await open_as("observer")
    poses = observer.queue(keys.ODOMETRY, 4096)
    camera = (await open_as("camera")).picture_publisher(keys.PICTURE)
    evidence = (await open_as("perception")).publisher(keys.EVIDENCE)
    advisory = (await open_as("advisor")).publisher(keys.ADVISORY)
    map_of = (await open_as("navigator")).publisher(keys.OCCUPANCY)
    estimates: dict[int, m.Odometry] = {}

    def show() -> None:
        map_of.put(GRID)

    def speak() -> None:
        now_us = CLOCK.now_us()
        camera.put_picture(m.PictureHeader(source_us=now_us, frame_seq=1, frame_epoch=1, width_px=8, height_px=8), JPEG)
        evidence.put(m.Evidence(
            source_us=now_us, frame_seq=1, frame_epoch=1, width_px=320, height_px=240, usable=True,
            detections=(m.Detection(label=m.Label.BUOY, confidence=0.5, box_xyxy=(0.0, 0.0, 0.5, 0.5)),),
        ))  # fmt: skip
        advisory.put(m.Advisory(source_us=now_us, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK))
        estimates.update({pose.source_us: pose for pose in poses.drain()})

    async with (
        spawn("plant"),
        spawn("localization"),
        spawn("ros2", f"ros2.listen=tcp/127.0.0.1:{listen}"),
        joined(listen, *(topic for topic in topics.SENT if topic is not topics.TRACKS)) as node,
    ):
        node.transcript = transcript
        names = {topic.full_name("otter") for topic in topics.SENT} - {"/otter/tracks"}
        await node.until(lambda: "/otter/occupancy" in node.heard, "the map", show)
        node.ask(latched=topics.OCCUPANCY.endpoint("otter").key(43))
        await node.until(lambda: bool(node.latched), "the map that was said before a node came")
        await node.until(lambda: set(node.heard) == names, f"all of {sorted(names)}", speak)
        await node.until(lambda: len(node.heard["/otter/odometry/global"]) >= 20, "a second of odometry", speak)
        node.ask(tokens=True)
        await node.until(lambda: bool(node.tokens), "the graph")
        speak()
    for name, heard in sorted(node.heard.items()):
        transcript.note("node", f"has heard {name}, {len(heard)} of them")
    for heard in node.heard["/otter/odometry/global"]:
        pose = estimates[heard["header"]["stamp"]["sec"] * 1_000_000 + heard["header"]["stamp"]["nanosec"] // 1000]
        at = heard["pose"]["pose"]["position"]
        assert (at["x"], at["y"], heard["twist"]["twist"]["linear"]["x"]) == (pose.x_m, pose.y_m, pose.surge_mps)
    assert bytes.fromhex(node.heard["/otter/camera/image/compressed"][0]["data"]) == JPEG
    assert node.heard["/otter/detections"][0]["detections"][0]["results"][0]["hypothesis"]["class_id"] == "buoy"
    grid = node.heard["/otter/occupancy"][0]
    assert (grid["header"]["frame_id"], grid["info"]["width"], grid["info"]["height"]) == ("map", 3, 2)
    assert (grid["info"]["origin"]["position"]["x"], grid["data"]) == (-4.0, [-1, 0, 100, -1, 0, 100])
    later = decode(bytes.fromhex(node.latched[-1]), "nav_msgs/OccupancyGrid")
    assert later.data.tolist() == grid["data"]
    advice = msgspec.json.decode(node.heard["/otter/advisory"][0]["data"], type=m.Advisory)
    assert advice.direction is m.Direction.LEFT
    children = {link["child_frame_id"] for message in node.heard["/tf"] for link in message["transforms"]}
    assert children == {"odom", "base_link"}
    assert abs(node.heard["/otter/imu/data"][0]["linear_acceleration"]["z"] - 9.81) < 2.0
    ours = [token for token in node.tokens if "/%otter/paani" in token]
    assert sum("/NN/" in token for token in ours) == 1
    assert sum("/MP/" in token for token in ours) == len(topics.SENT)
    assert sum("/MS/" in token for token in ours) == 1, "STOP is heard, and nothing else"
    assert any("%otter%imu%data/sensor_msgs::msg::dds_::Imu_/RIHS01_" in token for token in ours)


TWIST = type_hash("geometry_msgs/Twist")
STRING = f"RIHS01_{HASHES['std_msgs/String']}"


POSE = type_hash("geometry_msgs/PoseStamped")
ROUTE = m.Route(
    source_us=CLOCK.now_us(), name="a", waypoints=(m.Waypoint(x_m=0.0, y_m=0.0), m.Waypoint(x_m=9.0, y_m=0.0))
)


def goal(frame: str) -> dict[str, Any]:
    """Fields of a PoseStamped 12 m east and 3 m south of the origin of a frame, without a stamp."""
    stamp = {"type": "builtin_interfaces/msg/Time", "sec": 0, "nanosec": 0}
    position = {"type": "geometry_msgs/msg/Point", "x": 12.0, "y": -3.0, "z": 0.0}
    orientation = {"type": "geometry_msgs/msg/Quaternion", "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    return {
        "header": {"type": "std_msgs/msg/Header", "stamp": stamp, "frame_id": frame},
        "pose": {"type": "geometry_msgs/msg/Pose", "position": position, "orientation": orientation},
    }


def vector(x: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": 0.0, "z": z}


async def test_a_node_drives_while_its_hand_holds_and_no_longer(
    spawn: Spawn, open_as: OpenAs, transcript: Transcript
) -> None:
    """`cmd_vel` moves the boat in MANUAL alone, which a word begins; whoever falls silent has let go."""
    listen = find_free_port()
    observer, station = await open_as("observer"), await open_as("dashboard")
    orders, health = observer.latest(keys.OPERATOR_ORDER), observer.latest(keys.health("ros2"))
    missions = observer.latest(keys.ORDERED_MISSION)
    routes = (await open_as("navigator")).publisher(keys.ROUTE)

    def order() -> m.OperatorOrder:
        assert orders.value is not None
        return orders.value

    def drops() -> dict[str, int]:
        return {drop.cause: drop.count for drop in health.value.drops} if health.value else {}

    async with (
        spawn("operator"),
        spawn("ros2", f"ros2.listen=tcp/127.0.0.1:{listen}", "ros2.accept_commands=true"),
        joined(listen) as node,
    ):
        node.transcript = transcript
        with station.alive():
            hand = OperatorClient(station, CLOCK)

            def steer(linear_x: float = 0.3) -> None:
                fields = {"linear": vector(x=linear_x), "angular": vector(z=0.07)}
                node.ask(publish="/otter/cmd_vel", type="geometry_msgs/msg/Twist", hash=TWIST, fields=fields)

            def say(word: str) -> None:
                node.ask(publish="/otter/mode", type="std_msgs/msg/String", hash=STRING, fields={"data": word})

            def drive() -> None:
                if order().mode is not m.DriveMode.MANUAL:
                    say("MANUAL")
                steer()

            async def counted(cause: str, act: Callable[[], None], why: str) -> None:
                before = drops().get(cause, 0)
                await node.until(lambda: drops().get(cause, 0) > before, why, act)

            def go(frame: str) -> None:
                node.ask(
                    publish="/otter/goal_pose", type="geometry_msgs/msg/PoseStamped", hash=POSE, fields=goal(frame)
                )
                routes.put(ROUTE)

            await counted("not_manual", steer, "a stick without MANUAL is passed over")
            await node.until(
                lambda: missions.value is not None and bool(missions.value.legs), "a goal", lambda: go("map")
            )
            assert missions.value is not None
            (leg,) = missions.value.legs
            assert (leg.kind, leg.waypoints) == (m.LegKind.HOLD_STATION, (m.Waypoint(x_m=12.0, y_m=-3.0),))
            await counted("refused", lambda: go("odom"), "a goal of another frame")
            await counted("refused", lambda: say("MANUAL"), "a boat that is not armed takes no MANUAL")
            assert order().mode is m.DriveMode.ROUTE
            assert await hand.hold_to_arm(5.0) is m.ArmRefusal.NONE
            transcript.note("page", "armed by hand")
            await node.until(lambda: order().surge > 0.0, "the boat is steered", drive)
            assert (order().mode, order().by) == (m.DriveMode.MANUAL, "ros2")
            assert (order().surge, order().turn) == pytest.approx((0.5, 0.2))
            await counted("non_finite", lambda: steer(math.nan), "no number is no stick")
            await node.until(lambda: order().mode is m.DriveMode.IDLE, "a hand that is silent has let go")
            for _ in range(10):
                steer()
                await asyncio.sleep(0.1)
                assert order().mode is m.DriveMode.IDLE, "a stick that moves again begins nothing"
            for _ in range(2):  # two reports on, all that was counted until now is told
                await health.next()
            await counted("not_manual", steer, "and is counted")
            await counted("undecodable", lambda: say("M" * 70_000), "longer than any command")
            await counted("out_of_range", lambda: say("FULL AHEAD"), "a word that is no mode")
            assert await hand.take_wheel(5.0) is m.ModeRefusal.NONE
            transcript.note("page", "has taken the wheel")
            await counted("refused", lambda: say("HOLD"), "another hand holds the wheel")
            accepted = missions.value
            await counted("refused", lambda: go("map"), "and the mission")
            assert accepted is not None
            assert missions.value is not None
            assert missions.value.accepted_us == accepted.accepted_us
            await node.until(lambda: order().by == "ros2", "which that word alone takes", lambda: say("WHEEL"))

            def is_newer() -> bool:
                return missions.value is not None and missions.value.accepted_us > accepted.accepted_us

            await node.until(is_newer, "whose hand may send a goal", lambda: go("map"))


async def test_a_node_stops_the_boat_and_can_say_nothing_else(spawn: Spawn, open_as: OpenAs) -> None:
    listen = find_free_port()
    observer = await open_as("observer")
    state = observer.latest(keys.OPERATOR_STATE)
    health = observer.latest(keys.health("ros2"))
    thrust, requests = observer.queue(keys.THRUST, 64), observer.queue(keys.REQUESTS["dashboard"], 64)
    forged = _forged_thrust(await open_as("controller"))
    async with (
        spawn("operator"),
        spawn("ros2", f"ros2.listen=tcp/127.0.0.1:{listen}"),
        joined(listen, topics.DIAGNOSTICS) as first,
        joined(listen, topics.DIAGNOSTICS, mode="client") as second,
    ):
        await first.until(lambda: bool(first.heard and second.heard), "the port is heard")

        def refused() -> int:
            drops = health.value.drops if health.value else ()
            return sum(drop.count for drop in drops if drop.cause == "undecodable")

        async def is_refused(data: bytes) -> None:
            before, words = refused(), {"put": STOP_KEY, "data": data.hex()}
            await first.until(lambda: refused() > before, f"{data[:8]!r} is counted", lambda: first.ask(**words))

        for key in (STOP_KEY.replace("Bool_", "String_"), "43/otter/**"):  # of another type, and of no exact name
            first.ask(put=key, data="0001000001")
        for key in ("paani/43/otter/controller/thrust", "paani/**", "**"):
            first.ask(put=key, data=forged.hex())
        first.ask(put="43/other/topic", data="00")

        first.ask(put=STOP_KEY, data="0001000000")  # false: nobody asks to stop
        await is_refused(b"\x00\x01\x00\x00")
        await is_refused(struct.pack("<BBH6d", 0, 1, 0, *[1.0] * 6))
        await is_refused(bytes(1 << 17))
        assert state.value is not None
        assert state.value.stops == 0
        stop = {"publish": "/otter/stop", "type": "std_msgs/msg/Bool", "hash": BOOL, "fields": {"data": True}}
        await first.until(
            lambda: state.value is not None and state.value.stops > 0, "STOP is latched", lambda: first.ask(**stop)
        )
        assert (state.value.stopped, state.value.by) == (True, "ros2")
    assert second.leaked == [], "the graph's router hands on nothing but what is ROS"
    assert (thrust.drain(), requests.drain()) == ([], [])
    assert observer.drops == {}


def _forged_thrust(controller: Bus) -> bytes:
    """A message that the bus would take from the process `controller`."""
    publisher = controller.publisher(keys.THRUST)
    now_us = CLOCK.now_us()
    stamped = publisher._stamp(m.Thrust(source_us=now_us, left=1.0, right=1.0, enabled=True, echo_us=now_us))
    return msgspec.json.encode(stamped)
