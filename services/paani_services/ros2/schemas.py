"""ROS 2 message types without ROS: definitions, type hashes, and CDR in both directions, by rosbags.

Definitions are those of Jazzy; the types that the port uses have the same hashes from Humble on. vision_msgs, which
rosbags leaves out, is release 4.1.1 of ros-perception/vision_msgs.
"""

from __future__ import annotations

import struct
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

VISION_MSGS = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id\n"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n",
}

_STORE = get_typestore(Stores.ROS2_JAZZY)
_STORE.register({k: v for name, text in VISION_MSGS.items() for k, v in get_types_from_msg(text, name).items()})


def make(kind: str, /, **fields: Any) -> Any:
    """A message of a type such as `geometry_msgs/Point`, all of whose fields are given."""
    return _STORE.types[_full(kind)](**fields)


def encode(message: Any) -> bytes:
    """A message as CDR, little endian. Raises ValueError where a number does not fit its field."""
    try:
        return bytes(_STORE.serialize_cdr(message, message.__msgtype__, little_endian=True))
    except (SerdeError, struct.error) as error:
        raise ValueError(str(error)) from error


def decode(data: bytes, kind: str) -> Any:
    """The message. Raises ValueError for what is cut short, too long, or no CDR at all."""
    try:
        return _STORE.deserialize_cdr(data, _full(kind))
    except SerdeError as error:
        raise ValueError(str(error)) from error


def type_hash(kind: str) -> str:
    """`RIHS01_` and 64 hexadecimal digits, which stand in every key of a topic of this type (REP 2011)."""
    return str(_STORE.hash_rihs01(_full(kind)))


def definition(kind: str) -> str:
    """The text of the definition and of all that it contains, as bags carry it (`ros2msg`)."""
    return str(_STORE.generate_msgdef(_full(kind), ros_version=2)[0])


def _full(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name.removeprefix('msg/')}"
