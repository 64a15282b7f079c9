"""Types and CDR: hashes as a ROS 2 system has them, and what is no message refused."""

from __future__ import annotations

import contextlib
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.ros2 import schemas, topics

# As rmw_zenoh nodes announce them, from Humble to Lyrical.
HASHES = {
    "sensor_msgs/NavSatFix": "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
    "sensor_msgs/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "nav_msgs/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "nav_msgs/OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    "sensor_msgs/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "diagnostic_msgs/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "std_msgs/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "vision_msgs/Detection2DArray": "214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968",
}
VECTOR = schemas.make("geometry_msgs/Vector3", x=1.0, y=-2.0, z=0.5)
TWIST = schemas.make("geometry_msgs/Twist", linear=VECTOR, angular=VECTOR)


@pytest.mark.parametrize("kind", HASHES)
def test_hashes_are_those_of_ros(kind: str) -> None:
    assert schemas.type_hash(kind) == f"RIHS01_{HASHES[kind]}"


def test_every_type_that_is_sent_has_a_known_hash() -> None:
    """But TF's, which the messages themselves are tested by."""
    assert {topic.type for topic in topics.SENT} - {"tf2_msgs/TFMessage"} == set(HASHES)


def test_cdr_is_little_endian_and_comes_back() -> None:
    data = schemas.encode(TWIST)
    assert data == b"\x00\x01\x00\x00" + struct.pack("<6d", 1.0, -2.0, 0.5, 1.0, -2.0, 0.5)
    assert schemas.decode(data, "geometry_msgs/Twist") == TWIST
    big_endian = b"\x00\x00\x00\x00" + struct.pack(">6d", 1.0, -2.0, 0.5, 1.0, -2.0, 0.5)
    assert schemas.decode(big_endian, "geometry_msgs/Twist") == TWIST


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"", "geometry_msgs/Twist"),
        (schemas.encode(TWIST)[:-1], "geometry_msgs/Twist"),  # cut short
        (schemas.encode(TWIST)[:4], "geometry_msgs/Twist"),
        (schemas.encode(TWIST) + bytes(8), "geometry_msgs/Twist"),  # longer than the type
        (b"\x00\x07" + schemas.encode(TWIST)[2:], "geometry_msgs/Twist"),  # another encoding
        (schemas.encode(TWIST), "std_msgs/Bool"),  # another type
        (schemas.encode(TWIST), "std_msgs/String"),
        (struct.pack("<BBHI", 0, 1, 0, 2**31) + b"abc", "std_msgs/String"),  # claims a length that it has not
        (struct.pack("<BBHI", 0, 1, 0, 4) + b"\xff\xff\xff\0", "std_msgs/String"),  # no UTF-8
        (b'{"data": true}', "std_msgs/Bool"),
    ],
)
def test_what_is_no_message_is_refused(data: bytes, kind: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        schemas.decode(data, kind)


@given(st.sampled_from(sorted({topic.type for topic in (*topics.SENT, *topics.COMMANDS)})), st.binary(max_size=200))
@pytest.mark.slow
def test_bytes_of_anybody_are_a_message_or_refused(kind: str, data: bytes) -> None:
    for payload in (data, b"\x00\x01\x00\x00" + data):
        with contextlib.suppress(ValueError):
            schemas.decode(payload, kind)


def test_a_number_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"."):
        schemas.encode(schemas.make("builtin_interfaces/Time", sec=2**31, nanosec=0))


def test_a_definition_names_what_it_contains() -> None:
    text = schemas.definition("vision_msgs/Detection2DArray")
    assert "vision_msgs/Detection2D[] detections" in text
    assert "MSG: vision_msgs/Point2D" in text
