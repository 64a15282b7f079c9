"""A ROS 2 node as zenoh-ros2-sdk makes it, `python -m tests.ros2_peer`: it knows nothing of ours but names and hashes.

Arguments: the port of the router, the domain, and what to subscribe to (`TOPIC=TYPE=HASH`). Each message becomes a line
of JSON on standard output, `{"topic": ..., "message": ...}`. Lines on standard input ask for more: `{"publish": TOPIC,
"type": TYPE, "hash": HASH, "fields": {...}}`, `{"put": KEY, "data": HEX}`, `{"tokens": true}`, `{"latched": KEY}`: the
last message of a transient local topic, as rmw_zenoh asks for it.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import sys
import threading
from typing import Any

import numpy as np
import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession

from paani_services.ros2.schemas import VISION_MSGS

SPEAKING = threading.Lock()


def main(port: int, domain_id: int, wanted: list[str]) -> None:
    manager = ZenohSession.get_instance("127.0.0.1", port)
    _preload(manager)
    subscribed = []
    for words in wanted:
        topic, kind, type_hash = words.split("=")
        tell = functools.partial(_tell, topic)
        subscribed.append(ROS2Subscriber(topic, kind, tell, domain_id=domain_id, type_hash=type_hash))
    foreign = manager.session.declare_subscriber("paani/**", lambda sample: _say({"leaked": str(sample.key_expr)}))
    _say({"ready": True})
    publishers: dict[str, Any] = {}
    late: list[zenoh.ext.AdvancedSubscriber[None]] = []
    for line in sys.stdin:
        request = json.loads(line)
        if "publish" in request:
            topic = request["publish"]
            if topic not in publishers:
                publishers[topic] = ROS2Publisher(
                    topic, request["type"], domain_id=domain_id, type_hash=request["hash"]
                )
            publishers[topic].publish(**{name: _filled(manager, value) for name, value in request["fields"].items()})
        elif "put" in request:
            manager.session.put(request["put"], bytes.fromhex(request["data"]))
        elif "latched" in request:
            late.append(_subscribe_latched(manager, request["latched"]))
        else:
            found = manager.session.liveliness().get(f"@ros2_lv/{domain_id}/**", timeout=2.0)
            _say({"tokens": [str(reply.ok.key_expr) for reply in found if reply.ok]})
    foreign.undeclare()
    manager.close()


def _subscribe_latched(manager: ZenohSession, key: str) -> zenoh.ext.AdvancedSubscriber[None]:
    def receive(sample: zenoh.Sample) -> None:
        _say({"latched": sample.payload.to_bytes().hex()})

    return zenoh.ext.declare_advanced_subscriber(
        manager.session, key, receive, subscriber_detection=True,
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
    )  # fmt: skip


def _preload(manager: ZenohSession) -> None:
    """Types that the SDK would clone from the network."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in VISION_MSGS.items():
        manager.store.register(get_types_from_msg(text, name))
        manager._registered_types[name] = name
    manager.store.types.update(store.types)
    manager.store.fielddefs.update(store.fielddefs)
    manager._registered_types.update({name: name for name in store.types})


def _filled(manager: Any, value: Any) -> Any:
    """A field: an object of the type that it names, and without one a vector."""
    if not isinstance(value, dict):
        return value
    fields = {name: _filled(manager, field) for name, field in value.items() if name != "type"}
    return manager.store.types[value.get("type", "geometry_msgs/msg/Vector3")](**fields)


def _tell(topic: str, message: Any) -> None:
    _say({"topic": topic, "message": _plain(message)})


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return bytes(value).hex() if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if dataclasses.is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return value


def _say(words: dict[str, Any]) -> None:
    with SPEAKING:
        print(json.dumps(words), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
