"""Messages of the bus as ROS messages: units, frames, stamps, and what is withheld; read back by rosbags."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from paani import keys
from paani import messages as m
from paani.config import CalibrationConfig
from paani.occupancy_cells import pack_cells
from paani_services.ros2 import schemas, topics
from paani_services.ros2.frames import Frames
from paani_services.ros2.translation import UNKNOWN_VARIANCE, RosMessage, Translator
from tests.places import ROOT

NOW_US = 1_700_000_000_123_456
CALIBRATED = CalibrationConfig(valid=True, hfov_deg=70.0, height_m=0.9, forward_m=0.4, pitch_down_deg=8.0)
METRES = st.floats(-1e5, 1e5)
ANGLE = st.floats(-math.pi, math.pi)
TILT = st.floats(-1.0, 1.0)


def translator(calibration: CalibrationConfig = CALIBRATED, prefix: str = "") -> Translator:
    return Translator(Frames(prefix), calibration)


def read(sent: list[RosMessage]) -> list[tuple[str, Any]]:
    """What a ROS node makes of it."""
    return [(each.topic.name, schemas.decode(each.data, each.topic.type)) for each in sent]


def only(sent: list[RosMessage], topic: topics.RosTopic) -> Any:
    [message] = [message for name, message in read(sent) if name == topic.name]
    return message


def odometry(**changes: Any) -> m.Odometry:
    values: dict[str, Any] = {
        "source_us": NOW_US, "x_m": 3.0, "y_m": -4.0, "yaw_rad": 0.5, "surge_mps": 0.6, "sway_mps": -0.1,
        "yaw_rate_radps": 0.2, "position_std_m": 0.5, "yaw_std_rad": 0.1, "healthy": True,
    }  # fmt: skip
    return m.Odometry(**(values | changes))


def yaw_of(orientation: Any) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad], by scipy."""
    yaw, pitch, roll = Rotation.from_quat((orientation.x, orientation.y, orientation.z, orientation.w)).as_euler("ZYX")
    return float(roll), float(pitch), float(yaw)


def stamp_us(header: Any) -> int:
    return int(header.stamp.sec) * 1_000_000 + int(header.stamp.nanosec) // 1000


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.floats(0.0, 100.0))
def test_a_fix(latitude_deg: float, longitude_deg: float, std_m: float) -> None:
    fix = m.GpsFix(
        source_us=NOW_US, latitude_deg=latitude_deg, longitude_deg=longitude_deg, sog_mps=1.0, cog_rad=0.0,
        position_std_m=std_m,
    )  # fmt: skip
    message = only(translator().translate(keys.GPS.name, fix), topics.GPS_FIX)
    assert (stamp_us(message.header), message.header.frame_id) == (NOW_US, "base_link")
    assert (message.status.status, message.status.service) == (0, 1)
    assert (message.latitude, message.longitude) == (latitude_deg, longitude_deg)
    assert math.isnan(message.altitude)
    assert message.position_covariance_type == 1
    assert np.diag(message.position_covariance.reshape(3, 3)) == pytest.approx((std_m**2, std_m**2, UNKNOWN_VARIANCE))


def test_no_fix_is_no_position() -> None:
    fix = m.GpsFix(
        source_us=NOW_US, latitude_deg=0.0, longitude_deg=0.0, sog_mps=0.0, cog_rad=0.0, position_std_m=0.0, fix=False
    )
    message = only(translator().translate(keys.GPS.name, fix), topics.GPS_FIX)
    assert message.status.status == -1
    assert math.isnan(message.latitude)
    assert math.isnan(message.longitude)
    assert message.position_covariance_type == 0


def imu(**changes: Any) -> m.ImuSample:
    values = {
        "source_us": NOW_US, "gyro_x_radps": 0.1, "gyro_y_radps": 0.2, "gyro_z_radps": 0.3, "accel_x_mps2": 0.4,
        "accel_y_mps2": 0.5, "accel_z_mps2": 9.8,
    }  # fmt: skip
    return m.ImuSample(**(values | changes))


@given(TILT, TILT, ANGLE)
def test_an_inertial_sample(roll_rad: float, pitch_rad: float, yaw_rad: float) -> None:
    sample = imu(orientation_available=True, roll_rad=roll_rad, pitch_rad=pitch_rad, yaw_rad=yaw_rad)
    message = only(translator().translate(keys.IMU.name, sample), topics.IMU)
    assert (stamp_us(message.header), message.header.frame_id) == (NOW_US, "base_link")
    rates, forces = message.angular_velocity, message.linear_acceleration
    assert (rates.x, rates.y, rates.z) == (0.1, 0.2, 0.3)
    assert (forces.x, forces.y, forces.z) == (0.4, 0.5, 9.8)
    assert np.cos(np.subtract(yaw_of(message.orientation), (roll_rad, pitch_rad, yaw_rad))) == pytest.approx(1.0)
    assert message.orientation_covariance[0] == 0.0


def test_a_sample_without_a_compass_says_so() -> None:
    message = only(translator().translate(keys.IMU.name, imu()), topics.IMU)
    assert message.orientation_covariance[0] == -1.0
    assert message.orientation.w == 1.0


@given(METRES, METRES, ANGLE)
def test_the_estimate_in_the_map(x_m: float, y_m: float, yaw_rad: float) -> None:
    pose = odometry(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, roll_rad=0.1, pitch_rad=-0.05)
    message = only(translator().translate(keys.ODOMETRY.name, pose), topics.GLOBAL_ODOMETRY)
    assert (stamp_us(message.header), message.header.frame_id, message.child_frame_id) == (NOW_US, "map", "base_link")
    at, twist = message.pose.pose, message.twist.twist
    assert (at.position.x, at.position.y, at.position.z) == (x_m, y_m, 0.0)
    assert np.cos(np.subtract(yaw_of(at.orientation), (0.1, -0.05, yaw_rad))) == pytest.approx(1.0)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.6, -0.1, 0.2)
    variances = np.diag(message.pose.covariance.reshape(6, 6))
    assert variances == pytest.approx((0.25, 0.25, *[UNKNOWN_VARIANCE] * 3, 0.01))
    assert np.diag(message.twist.covariance.reshape(6, 6)) == pytest.approx([UNKNOWN_VARIANCE] * 6)


@given(METRES, METRES, ANGLE, METRES, METRES, ANGLE)
@pytest.mark.slow
def test_the_transforms_lead_from_the_map_to_the_boat(
    x_m: float, y_m: float, yaw_rad: float, odom_x_m: float, odom_y_m: float, odom_yaw_rad: float
) -> None:
    """However the two estimates differ, map to odom to base_link is the estimate in the map (REP 105)."""
    port = translator()
    local = odometry(x_m=odom_x_m, y_m=odom_y_m, yaw_rad=odom_yaw_rad)
    links = only(port.translate(keys.LOCAL_ODOMETRY.name, local), topics.TRANSFORM).transforms
    whole = port.translate(keys.ODOMETRY.name, odometry(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad))
    links += only(whole, topics.TRANSFORM).transforms
    chain = {link.child_frame_id: link for link in links}
    assert {child: link.header.frame_id for child, link in chain.items()} == {
        "base_link": "odom", "camera_optical": "base_link", "odom": "map",
    }  # fmt: skip
    assert {stamp_us(link.header) for link in links} == {NOW_US}
    (outer_at, outer), (inner_at, inner) = (_rigid(chain[name].transform) for name in ("odom", "base_link"))
    assert outer_at + outer.apply(inner_at) == pytest.approx((x_m, y_m, 0.0), abs=1e-6)
    heading = (outer * inner).as_euler("ZYX")[0]
    assert math.cos(heading - yaw_rad) == pytest.approx(1.0)


def _rigid(transform: Any) -> tuple[Any, Rotation]:
    at, turn = transform.translation, transform.rotation
    return np.array((at.x, at.y, at.z)), Rotation.from_quat((turn.x, turn.y, turn.z, turn.w))


def test_the_two_estimates_of_one_moment_meet_in_either_order() -> None:
    for first, second in ((keys.ODOMETRY, keys.LOCAL_ODOMETRY), (keys.LOCAL_ODOMETRY, keys.ODOMETRY)):
        port = translator()
        frames = [
            link.header.frame_id
            for topic in (first, second)
            for name, message in read(port.translate(topic.name, odometry()))
            if name == topics.TRANSFORM.name
            for link in message.transforms
        ]
        assert frames.count("map") == 1
    port = translator()
    port.translate(keys.LOCAL_ODOMETRY.name, odometry())
    later = port.translate(keys.ODOMETRY.name, odometry(source_us=NOW_US + 50_000))
    assert [each.topic for each in later] == [topics.GLOBAL_ODOMETRY], "of two moments, nobody knows the way"


def test_what_is_unhealthy_is_withheld() -> None:
    port = translator()
    assert port.translate(keys.ODOMETRY.name, odometry(healthy=False)) == []
    local = port.translate(keys.LOCAL_ODOMETRY.name, odometry())
    assert [link.header.frame_id for link in only(local, topics.TRANSFORM).transforms] == ["odom", "base_link"]
    assert port.translate(keys.LOCAL_ODOMETRY.name, odometry(healthy=False)) == []
    whole = port.translate(keys.ODOMETRY.name, odometry())
    assert [each.topic for each in whole] == [topics.GLOBAL_ODOMETRY]


def test_a_camera_that_nobody_measured_has_no_place() -> None:
    local = translator(CalibrationConfig(hfov_deg=70.0, height_m=0.9)).translate(keys.LOCAL_ODOMETRY.name, odometry())
    assert [link.child_frame_id for link in only(local, topics.TRANSFORM).transforms] == ["base_link"]


def test_a_prefix_stands_before_every_frame() -> None:
    port = translator(prefix="otter/")
    sent = port.translate(keys.LOCAL_ODOMETRY.name, odometry()) + port.translate(keys.ODOMETRY.name, odometry())
    frames = set[str]()
    for name, message in read(sent):
        for part in message.transforms if name == topics.TRANSFORM.name else [message]:
            frames |= {part.header.frame_id, part.child_frame_id}
    assert frames == {"otter/map", "otter/odom", "otter/base_link", "otter/camera_optical"}


@pytest.mark.parametrize(("media_type", "coding"), [("image/jpeg", "jpeg"), ("image/png", "png")])
def test_a_picture(media_type: str, coding: str) -> None:
    header = m.PictureHeader(
        source_us=NOW_US, frame_seq=1, frame_epoch=1, width_px=320, height_px=240, media_type=media_type
    )
    data = b"\xff\xd8" + bytes(range(256)) + b"\xff\xd9"
    sent = translator().picture(header, data)
    message = only([sent], topics.IMAGE)
    assert (stamp_us(message.header), message.header.frame_id) == (NOW_US, "camera_optical")
    assert (message.format, message.data.tobytes(), sent.source_us) == (coding, data, NOW_US)


EVIDENCE = m.Evidence(
    source_us=NOW_US, frame_seq=7, frame_epoch=2, width_px=320, height_px=240, usable=True,
    detections=(
        m.Detection(label=m.Label.PERSON, confidence=0.75, box_xyxy=(0.25, 0.5, 0.5, 0.75)),
        m.Detection(label=m.Label.BUOY, confidence=0.5, box_xyxy=(0.0, 0.0, 1.0, 1.0)),
    ),
)  # fmt: skip


def boxes(message: Any) -> list[tuple[str, str, float, float, float, float, float]]:
    return [
        (
            each.id, each.results[0].hypothesis.class_id, each.results[0].hypothesis.score,
            each.bbox.center.position.x, each.bbox.center.position.y, each.bbox.size_x, each.bbox.size_y,
        )
        for each in message.detections
    ]  # fmt: skip


def test_detections_are_in_pixels_of_the_picture() -> None:
    message = only(translator().translate(keys.EVIDENCE.name, EVIDENCE), topics.DETECTIONS)
    assert (stamp_us(message.header), message.header.frame_id) == (NOW_US, "camera_optical")
    assert boxes(message) == [
        ("", "person", 0.75, 120.0, 150.0, 80.0, 60.0),
        ("", "buoy", 0.5, 160.0, 120.0, 320.0, 240.0),
    ]
    assert message.detections[0].results[0].pose.covariance[0] == -1.0
    nothing = msgspec.structs.replace(EVIDENCE, detections=())
    assert only(translator().translate(keys.EVIDENCE.name, nothing), topics.DETECTIONS).detections == []


def test_a_picture_that_is_no_evidence_shows_nothing() -> None:
    """An empty array would say that the water is free."""
    port = translator()
    assert port.translate(keys.EVIDENCE.name, msgspec.structs.replace(EVIDENCE, usable=False)) == []
    assert port.translate(keys.TRACKS.name, tracks()) == []


def tracks(**changes: Any) -> m.Tracks:
    track = m.Track(
        id=12, label=m.Label.VESSEL, hazard=m.Hazard.CRAFT, confidence=0.9, box_xyxy=(0.5, 0.5, 0.75, 1.0), hits=3,
        confirmed=True, immediate_danger=False, accepted=True, held=False, age_s=0.0, urgency=0.1,
    )  # fmt: skip
    unsure = msgspec.structs.replace(track, id=13, accepted=False)
    values: dict[str, Any] = {"source_us": NOW_US, "frame_seq": 7, "frame_epoch": 2, "tracks": (track, unsure)}
    return m.Tracks(**(values | changes))


def test_tracks_that_count_have_their_number() -> None:
    port = translator()
    assert port.translate(keys.TRACKS.name, tracks()) == [], "the size of the picture is not known yet"
    port.translate(keys.EVIDENCE.name, EVIDENCE)
    message = only(port.translate(keys.TRACKS.name, tracks()), topics.TRACKS)
    assert boxes(message) == [("12", "vessel", 0.9, 200.0, 180.0, 80.0, 120.0)]
    assert port.translate(keys.TRACKS.name, tracks(frame_seq=8)) == [], "another picture"


def test_the_advisory_is_its_own_json() -> None:
    advisory = m.Advisory(
        source_us=NOW_US, direction=m.Direction.SLIGHT_LEFT, reason=m.Reason.CENTER_RISK, explanation="a boat ahead"
    )
    text = only(translator().translate(keys.ADVISORY.name, advisory), topics.ADVISORY).data
    assert msgspec.json.decode(text, type=m.Advisory) == advisory


def test_a_time_that_ros_cannot_say_is_refused() -> None:
    with pytest.raises(ValueError, match="format"):
        translator().translate(keys.GPS.name, m.GpsFix(
            source_us=2**31 * 1_000_000, latitude_deg=0.0, longitude_deg=0.0, sog_mps=0.0, cog_rad=0.0,
            position_std_m=0.0,
        ))  # fmt: skip


def test_every_translated_topic_is_in_the_table() -> None:
    """And every row but the pictures' and the diagnostics' has its translation."""
    sources = {name for topic in topics.SENT for name in topic.source.split(", ")}
    assert sources - {keys.PICTURE.name, "health/*"} == set(translator().sources)
    assert {topic.frame for topic in topics.SENT} <= {"", "base_link", "map", "odom", "map, odom", "camera_optical"}


def test_the_manual_has_the_table() -> None:
    text = (ROOT / "docs/how-to/ros2.md").read_text(encoding="utf-8")
    for topic in topics.SENT:
        kept = ", transient local" if topic.qos.transient_local else ""
        service = f"{'best effort' if topic.qos.best_effort else 'reliable'}{kept}, {topic.qos.depth}"
        cells = (f"`{topic.name}`", topic.type, service, topic.frame or "-", f"{topic.rate_hz:g}", f"`{topic.source}`")
        assert f"| {' | '.join(cells)} |" in text


def grid(values_of_rows: list[list[int]], **changes: Any) -> m.OccupancyGrid:
    values = np.array(values_of_rows, np.uint8)
    rows, columns = values.shape
    fields: dict[str, Any] = {"source_us": NOW_US, "west_m": -4.0, "south_m": 7.0, "cell_m": 0.25, "columns": columns}
    return m.OccupancyGrid(**(fields | {"rows": rows, "cells": pack_cells(values)} | changes))


def test_a_grid_lies_in_the_map_with_its_first_cell_in_the_south_west() -> None:
    """What no camera sees is unknown (-1); free is 0 and occupied 100, row after row from the south."""
    seen = grid([[m.Occupancy.UNKNOWN, m.Occupancy.FREE, m.Occupancy.OCCUPIED], [m.Occupancy.BLIND_ZONE] * 3])
    message = only(translator(prefix="otter/").translate(keys.OCCUPANCY.name, seen), topics.OCCUPANCY)
    assert (message.header.frame_id, stamp_us(message.header)) == ("otter/map", NOW_US)
    assert message.data.tolist() == [-1, 0, 100, -1, -1, -1]
    info = message.info
    assert (info.width, info.height, info.resolution) == (3, 2, 0.25)
    corner = info.origin
    assert (corner.position.x, corner.position.y, corner.position.z) == (-4.0, 7.0, 0.0)
    assert yaw_of(corner.orientation) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("changes", [{"rows": 200}, {"columns": 40}, {"cells": b""}])
def test_a_grid_of_other_cells_than_it_says_is_no_map(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="are not the cells of"):
        translator().translate(keys.OCCUPANCY.name, grid([[1] * 5] * 2, **changes))
