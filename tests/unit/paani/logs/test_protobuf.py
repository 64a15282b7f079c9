"""Our few Foxglove messages, read back by the official library."""

from __future__ import annotations

import importlib
import math
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.logs import protobuf as pb
from paani.logs import viewer

NOW_US = 1_700_000_000_123_456
KINDS = (
    pb.COMPRESSED_IMAGE, pb.LOCATION_FIX, pb.POSE_IN_FRAME, pb.IMAGE_ANNOTATIONS, pb.LOG, pb.CAMERA_CALIBRATION,
    pb.GEO_JSON, pb.FRAME_TRANSFORMS, pb.SCENE_UPDATE,
)  # fmt: skip


def decoder(kind: str) -> Any:
    """The class that the library makes of our own FileDescriptorSet."""
    pytest.importorskip("google.protobuf", reason="protobuf is not installed")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # noqa: PLC0415

    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(pb.descriptors(kind)).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(kind))


def derived(*messages: tuple[keys.Topic[Any], m.Message]) -> list[Any]:
    """What the messages add to the viewer's channels, decoded."""
    view = viewer.Viewer()
    made = [one for topic, message in messages for one in view.derive(topic.name, msgspec.json.encode(message))]
    return [(one.channel, decoder(viewer.CHANNELS[one.channel]).FromString(one.data)) for one in made]


@pytest.mark.parametrize("kind", KINDS)
def test_the_schema_stands_alone(kind: str) -> None:
    assert {field.name for field in decoder(kind).DESCRIPTOR.fields} == set(pb.MESSAGES[kind])


@pytest.mark.parametrize("kind", [kind for kind in pb.MESSAGES if kind.startswith("foxglove.")])
def test_every_field_is_as_published(kind: str) -> None:
    """Number, type and repetition, against Foxglove's own compiled definitions; its enumerations too."""
    published = pytest.importorskip(
        "foxglove_schemas_protobuf", reason="foxglove-schemas-protobuf is not installed"
    ) and importlib.import_module(f"foxglove_schemas_protobuf.{kind.removeprefix('foxglove.')}_pb2")
    message = published.DESCRIPTOR.message_types_by_name[kind.removeprefix("foxglove.")]
    for name, field in pb.MESSAGES[kind].items():
        found = message.fields_by_name[name]
        of = found.message_type or found.enum_type
        assert field == (found.number, found.type, of.full_name if of else "", found.is_repeated), name
    for enum in message.enum_types:
        assert pb.ENUMS[enum.full_name] == tuple(value.name for value in enum.values)
    if kind.startswith(("foxglove.Scene", "foxglove.Frame")) or "Primitive" in kind:
        assert set(pb.MESSAGES[kind]) == set(message.fields_by_name), "a viewer reads every list of an entity"


def test_a_varint_beyond_one_byte() -> None:
    """300 is AC 02, the encoding guide's own example; field 1 of a Timestamp."""
    assert pb.encode(pb.TIME, {"seconds": 300}) == bytes((0x08, 0xAC, 0x02))


def test_a_picture() -> None:
    header = m.PictureHeader(source_us=NOW_US, frame_seq=1, frame_epoch=1, width_px=320, height_px=240)
    image = decoder(pb.COMPRESSED_IMAGE).FromString(viewer.picture(header, b"\xff\xd8 bytes"))
    assert (image.data, image.format, image.frame_id) == (b"\xff\xd8 bytes", "jpeg", "camera_optical")
    assert image.timestamp.seconds * 1_000_000 + image.timestamp.nanos // 1000 == NOW_US


def test_a_position() -> None:
    fix = m.GpsFix(
        source_us=NOW_US, latitude_deg=-33.5, longitude_deg=151.25, sog_mps=0.3, cog_rad=0.0, position_std_m=2.0
    )
    [(channel, found)] = derived((keys.GPS, fix))
    assert channel == "viewer/gps"
    assert (found.latitude, found.longitude) == (-33.5, 151.25)
    assert list(found.position_covariance) == [4.0, 0, 0, 0, 4.0, 0, 0, 0, 0]
    assert derived((keys.GPS, msgspec.structs.replace(fix, fix=False))) == []


def test_a_pose() -> None:
    odometry = m.Odometry(source_us=NOW_US, x_m=3.0, y_m=-4.0, yaw_rad=math.pi / 2, surge_mps=0.5)
    [(channel, found)] = derived((keys.ODOMETRY, odometry))
    assert (channel, found.frame_id) == ("viewer/pose", "map")
    assert (found.pose.position.x, found.pose.position.y) == (3.0, -4.0)
    assert found.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert found.pose.orientation.w == pytest.approx(math.sqrt(0.5))


def test_boxes_lie_on_the_picture() -> None:
    evidence = m.Evidence(source_us=NOW_US, frame_seq=1, frame_epoch=1, width_px=320, height_px=240, usable=True)
    track = m.Track(
        id=7, label=m.Label.BUOY, hazard=m.Hazard.MARKER, confidence=0.81, box_xyxy=(0.25, 0.5, 0.5, 0.75), hits=3,
        confirmed=True, immediate_danger=False, accepted=True, held=False, age_s=1.0, urgency=0.0,
    )  # fmt: skip
    tracks = m.Tracks(source_us=NOW_US, frame_seq=1, frame_epoch=1, tracks=(track,))
    *_, (channel, found) = derived((keys.EVIDENCE, evidence), (keys.TRACKS, tracks))
    assert channel == "viewer/annotations"
    [box], [text] = found.points, found.texts
    assert [(p.x, p.y) for p in box.points] == [(80, 120), (160, 120), (160, 180), (80, 180)]
    assert box.type == pb.LINE_LOOP
    assert text.text == "#7 buoy 0.81"


def test_a_line_when_something_changes() -> None:
    straight = m.Advisory(
        source_us=NOW_US, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR, explanation="clear, 0.21"
    )
    again = msgspec.structs.replace(straight, explanation="clear, 0.22")
    stop = msgspec.structs.replace(straight, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE)
    lines = [found for _, found in derived(*((keys.ADVISORY, a) for a in (straight, again, stop, straight)))]
    assert [line.message.split(" ")[0] for line in lines] == ["STRAIGHT", "STOP", "STRAIGHT"]
    assert [line.level for line in lines] == [pb.INFO, pb.WARNING, pb.INFO]
    assert {line.name for line in lines} == {"advisor"}


def test_what_cannot_be_decoded_is_not_shown() -> None:
    assert viewer.Viewer().derive("sensors/gps", b'{"source_us": "no"}') == []
    assert viewer.Viewer().derive("sensors/gps", b"\xff\xfe") == []
    assert viewer.Viewer().derive("sensors/imu", b"{}") == []
