"""A node of a ROS 2 graph, on the wire of rmw_zenoh (its `docs/design.md`): keys, attachments and liveliness tokens.

The graph has a router and a session of its own, which this process opens beside the bus and joins to nothing: what a
ROS node writes can reach no key of the bus, whatever it is called. The router lets ROS names through, and nothing else.
Messages are CDR, which others write and read.
"""

from __future__ import annotations

import asyncio
import hashlib
import itertools
import struct
from typing import NamedTuple

import zenoh
import zenoh.ext

from paani.bus.inbox import Queue
from paani.bus.publish import PRIORITY
from paani.bus.routing import ACCEPT_MS, MAX_PENDING, require_free
from paani.bus.session import MAX_BYTES, zenoh_config
from paani.clock import Clock
from paani.errors import UserError
from paani.keys import Stance

TOKENS = "@ros2_lv"
ROOT_ENCLAVE = "%"
MAX_CDR_BYTES = 1 << 16  # of what is heard: commands alone
ATTACHMENT = struct.Struct("<qqB16s")  # sequence, source time [ns], length of the gid, gid
MISS_PERIOD_S = 0.5  # rmw_zenoh's own: how soon a node learns that it missed the last message of a latched topic
LEASE_MS = 10_000  # Zenoh's own: a ROS node that hangs costs nobody anything
# Everything that a ROS node says and asks; all of it within the keys of its domain.
MESSAGES = [
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip


class RosQos(NamedTuple):
    """Quality of service: the newest `depth` messages of a topic. transient_local: who comes later gets them too."""

    depth: int
    best_effort: bool = False
    transient_local: bool = False

    @property
    def text(self) -> str:
        """As in a liveliness token; what is left out has rmw's default."""
        durability = "1" if self.transient_local else ""
        return f"{'2' if self.best_effort else ''}:{durability}:,{self.depth}:,:,:,,"


SENSOR_DATA = RosQos(5, best_effort=True)
RELIABLE = RosQos(10)
TRANSFORMS = RosQos(100)
LATCHED = RosQos(1, transient_local=True)  # as maps have it


class RosEndpoint(NamedTuple):
    """What a topic is called on the wire. name: from the root, `/otter/imu/data`; type: `sensor_msgs/Imu`."""

    name: str
    type: str
    type_hash: str
    qos: RosQos

    @property
    def type_key(self) -> str:
        """The name of the type in a key: `sensor_msgs::msg::dds_::Imu_`."""
        package, _, name = self.type.partition("/")
        return f"{package}::msg::dds_::{name}_"

    def key(self, domain_id: int) -> str:
        """Where its messages are written."""
        return f"{domain_id}/{self.name.removeprefix('/')}/{self.type_key}/{self.type_hash}"


class RosPublisher:
    """Writes one topic. Never blocks: a node that is too slow loses the newest."""

    def __init__(self, session: zenoh.Session, key: str, token: str, qos: RosQos) -> None:
        self._gid = hashlib.blake2b(token.encode(), digest_size=16).digest()
        self._sequence = itertools.count(1)
        priority = PRIORITY[Stance.PICTURE if qos.best_effort else Stance.STATE]
        drop = zenoh.CongestionControl.DROP
        self._publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher
        if qos.transient_local:
            self._publisher = zenoh.ext.declare_advanced_publisher(
                session, key, priority=priority, congestion_control=drop, publisher_detection=True,
                cache=zenoh.ext.CacheConfig(qos.depth),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=MISS_PERIOD_S),
            )  # fmt: skip
        else:
            self._publisher = session.declare_publisher(key, priority=priority, congestion_control=drop)
        self._token = session.liveliness().declare_token(token)

    def put(self, data: bytes, source_us: int) -> None:
        """Publish one message. source_us: when what it says was measured."""
        gid = self._gid
        attachment = ATTACHMENT.pack(next(self._sequence), source_us * 1000, len(gid), gid)
        self._publisher.put(data, attachment=attachment)

    def is_watched(self) -> bool:
        """Does any node subscribe to it? Of a topic that is kept for whoever comes later, somebody may at any time."""
        publisher = self._publisher
        if isinstance(publisher, zenoh.ext.AdvancedPublisher):
            return True
        return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]  # zenoh's stubs


class RosGraph:
    """One node, `/<namespace>/<node>`, and the endpoints that it declares. Made by `open_ros_graph`."""

    def __init__(self, session: zenoh.Session, domain_id: int, namespace: str, node: str, clock: Clock) -> None:
        self._session, self._domain_id, self._clock = session, domain_id, clock
        self._owner = f"{ROOT_ENCLAVE}/%{namespace}/{node}"
        self._entities = itertools.count(1)
        self._space = f"{TOKENS}/{domain_id}/{session.info.zid()}/0"
        self._declared: list[object] = [self._declare_token(f"{self._space}/0/NN/{self._owner}")]

    def publisher(self, endpoint: RosEndpoint) -> RosPublisher:
        """Declare a publisher; ROS nodes see it at once."""
        return RosPublisher(self._session, endpoint.key(self._domain_id), self._token_of(endpoint, "MP"), endpoint.qos)

    def subscribe(self, endpoint: RosEndpoint, depth: int) -> Queue[bytes]:
        """Declare a subscriber; a queue of what is written on exactly its key, not longer than commands are."""
        inbox, key = Queue[bytes](self._clock, depth), endpoint.key(self._domain_id)

        def receive(sample: zenoh.Sample) -> None:
            if str(sample.key_expr) == key and sample.kind == zenoh.SampleKind.PUT:
                data = sample.payload.to_bytes() if len(sample.payload) <= MAX_CDR_BYTES else b""
                inbox.offer(data)

        self._declared.append(self._session.declare_subscriber(key, zenoh.handlers.Callback(receive, indirect=False)))
        self._declared.append(self._declare_token(self._token_of(endpoint, "MS")))
        return inbox

    async def close(self) -> None:
        """Leave the graph: nodes see the endpoints go."""
        await asyncio.to_thread(self._session.close)

    def _token_of(self, endpoint: RosEndpoint, kind: str) -> str:
        name = endpoint.name.replace("/", "%")
        return (
            f"{self._space}/{next(self._entities)}/{kind}/{self._owner}/{name}/{endpoint.type_key}"
            f"/{endpoint.type_hash}/{endpoint.qos.text}"
        )

    def _declare_token(self, token: str) -> zenoh.LivelinessToken:
        return self._session.liveliness().declare_token(token)


async def open_ros_graph(listen: str, domain_id: int, namespace: str, node: str, clock: Clock) -> RosGraph:
    """Listen for the nodes of a ROS domain, and join it. Raises UserError where the address is taken or wrong."""
    require_free("ros2.listen", listen)
    try:
        session = await asyncio.to_thread(lambda: zenoh.open(ros_router_config(listen, domain_id)))
    except zenoh.ZError as error:
        raise UserError(f"ros2.listen {listen}: {error}") from error
    return RosGraph(session, domain_id, namespace, node, clock)


async def join_ros_graph(router: str, domain_id: int, namespace: str, node: str, clock: Clock) -> RosGraph:
    """Join a graph that another process listens for, as ROS nodes do. Raises UserError where nobody answers there."""
    settings = {"mode": "client", "connect/endpoints": [router], "scouting/multicast/enabled": False}
    try:
        session = await asyncio.to_thread(lambda: zenoh.open(zenoh_config(settings)))
    except zenoh.ZError as error:
        raise UserError(f"{router}: {error}") from error
    return RosGraph(session, domain_id, namespace, node, clock)


def ros_router_config(listen: str, domain_id: int) -> zenoh.Config:
    """A router that ROS nodes connect to, and find each other by. It denies by default and connects to nobody."""
    names = [f"{domain_id}/**", f"{domain_id}/**/@adv/**", f"{TOKENS}/{domain_id}/**"]
    return zenoh_config(
        {
            "mode": "router",
            "listen/endpoints": [listen],
            "connect/endpoints": [],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": True,
            "scouting/gossip/autoconnect": {"router": [], "peer": [], "client": []},
            "scouting/delay": 0,
            "transport/link/tx/lease": LEASE_MS,
            "transport/unicast/accept_timeout": ACCEPT_MS,
            "transport/unicast/accept_pending": MAX_PENDING,
            "transport/shared_memory/enabled": False,
            "transport/link/rx/max_message_size": MAX_BYTES,
            "access_control": {
                "enabled": True,
                "default_permission": "deny",
                "rules": [
                    {
                        "id": "ros", "permission": "allow", "flows": ["ingress", "egress"],
                        "messages": MESSAGES, "key_exprs": names,
                    }
                ],
                "subjects": [{"id": "anyone"}],
                "policies": [{"rules": ["ros"], "subjects": ["anyone"]}],
            },
        }
    )  # fmt: skip
