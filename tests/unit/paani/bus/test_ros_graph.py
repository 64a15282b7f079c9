"""Names on the wire of rmw_zenoh, as its nodes write them."""

from __future__ import annotations

from paani.bus.ros_graph import ATTACHMENT, LATCHED, RELIABLE, SENSOR_DATA, RosEndpoint

HASH = "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"


def test_a_key() -> None:
    endpoint = RosEndpoint("/otter/gps/fix", "sensor_msgs/NavSatFix", HASH, SENSOR_DATA)
    assert endpoint.key(43) == f"43/otter/gps/fix/sensor_msgs::msg::dds_::NavSatFix_/{HASH}"


def test_quality_of_service() -> None:
    """What is rmw's default is left out: reliable, volatile, keep last, no deadline."""
    assert (RELIABLE.text, SENSOR_DATA.text) == ("::,10:,:,:,,", "2::,5:,:,:,,")
    assert LATCHED.text == ":1:,1:,:,:,,"


def test_an_attachment_is_sequence_time_and_gid() -> None:
    packed = ATTACHMENT.pack(3, 1_700_000_000_000_000_000, 16, bytes(range(16)))
    assert packed == (3).to_bytes(8, "little") + (1_700_000_000_000_000_000).to_bytes(8, "little") + b"\x10" + bytes(
        range(16)
    )
