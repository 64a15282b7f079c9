"""`paani logs export --ros2`: a bag that rosbags reads, with the values of the recording; and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest
from rosbags.highlevel import AnyReader

from paani import keys
from paani import messages as m
from paani.cli import main
from paani.config import Config, encode_config, load_config
from paani.logs.writer import LogWriter
from tests.unit.paani.logs import small_logs
from tests.unit.paani.logs.small_logs import JPEG, START_US, STEP_US, begin, finished, odometry, put


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert main(["logs", "export", *map(str, words)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    return line


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """By topic, each message and when it was recorded [us], by the definitions in the bag alone."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([path]) as reader:
        for connection, at_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((at_ns // 1000, message))
    return found


def record(folder: Path, config: Config | None = None) -> Path:
    """A recording with every kind of message, and some that cannot be read."""
    described = small_logs.about()
    if config is not None:
        described = msgspec.structs.replace(
            described, attachments={**described.attachments, "config.json": encode_config(config)}
        )
    log = LogWriter(folder / small_logs.NAME, described, keys.every_topic(), START_US)
    small_logs.fill(log, 45, 10)
    for number in range(45):
        now_us = START_US + number * STEP_US
        head: dict[str, Any] = {"source_us": now_us, "sent_us": now_us, "seq": number, "epoch": 5}
        put(log, keys.LOCAL_ODOMETRY, odometry(number, x_m=-1.0))
        put(log, keys.IMU, m.ImuSample(
            **head, gyro_x_radps=0.0, gyro_y_radps=0.0, gyro_z_radps=0.01 * number, accel_x_mps2=0.0, accel_y_mps2=0.0,
            accel_z_mps2=9.81,
        ))  # fmt: skip
    head = {"source_us": START_US, "sent_us": START_US}
    put(log, keys.GPS, m.GpsFix(
        **head, latitude_deg=52.25, longitude_deg=4.5, sog_mps=1.0, cog_rad=0.0, position_std_m=2.0
    ))  # fmt: skip
    put(log, keys.EVIDENCE, m.Evidence(
        **head, frame_seq=0, frame_epoch=1, width_px=320, height_px=240, usable=True,
        detections=(m.Detection(label=m.Label.PIER, confidence=0.5, box_xyxy=(0.0, 0.0, 0.5, 0.5)),),
    ))  # fmt: skip
    put(log, keys.ADVISORY, m.Advisory(**head, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK))
    put(log, keys.OCCUPANCY, m.OccupancyGrid(
        **head, west_m=-4.0, south_m=7.0, cell_m=0.25, columns=2, rows=2, cells=bytes([0b11100100])
    ))  # fmt: skip
    put(log, keys.THRUST, m.Thrust(**head, left=0.0, right=0.0, enabled=False))  # of no interest to the port
    log._add(log._channels[keys.GPS.name], START_US, START_US, 1, b"{nonsense")
    log.finish({})
    return log.path


@pytest.mark.slow
def test_values_are_those_of_the_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = record(tmp_path), tmp_path / "out.mcap"
    assert main(["logs", "export", str(path), "--ros2", str(out)]) == 0
    assert "11 topics" not in (printed := capsys.readouterr().out), "nothing was tracked"
    assert "10 topics" in printed
    assert "1 messages left out" in printed
    found = read(out)
    poses = found["/otter/odometry/global"]
    assert [at_us for at_us, _ in poses] == [START_US + STEP_US * number for number in range(45)]
    assert [pose.pose.pose.position.x for _, pose in poses] == [0.1 * number for number in range(45)]
    assert [round(sample.angular_velocity.z, 9) for _, sample in found["/otter/imu/data"]] == pytest.approx(
        [0.01 * number for number in range(45)]
    )
    images = [image.data.tobytes() for _, image in found["/otter/camera/image/compressed"]]
    assert images == [JPEG + bytes((number,)) for number in range(0, 45, 5)]
    [(_, fix)] = found["/otter/gps/fix"]
    assert (fix.latitude, fix.longitude, fix.position_covariance[0]) == (52.25, 4.5, 4.0)
    [(_, detections)] = found["/otter/detections"]
    assert detections.detections[0].bbox.size_x == 160.0
    [(_, grid)] = found["/otter/occupancy"]
    assert (grid.header.frame_id, grid.data.tolist()) == ("map", [-1, 0, 100, -1])
    assert (grid.info.origin.position.x, grid.info.origin.position.y, grid.info.resolution) == (-4.0, 7.0, 0.25)
    [(_, advisory)] = found["/otter/advisory"]
    assert msgspec.json.decode(advisory.data, type=m.Advisory).direction is m.Direction.LEFT
    parents = {link.header.frame_id for _, message in found["/tf"] for link in message.transforms}
    assert parents == {"map", "odom"}
    assert [at_us for at_us, _ in found["/diagnostics"]] == [START_US, START_US + 1_000_000, START_US + 2_000_000]


@pytest.mark.slow
def test_frames_and_names_are_those_of_the_recorded_boat(tmp_path: Path) -> None:
    config = load_config(sets=(
        "bus.vessel=beaver", "ros2.frame_prefix=beaver/",   "calibration.hfov_deg=70",
        "calibration.height_m=0.9", "calibration.valid=true",
    ))  # fmt: skip
    out = tmp_path / "out.mcap"
    assert main(["logs", "export", str(record(tmp_path, config)), "--ros2", str(out)]) == 0
    found = read(out)
    assert found["/beaver/odometry/global"][0][1].header.frame_id == "beaver/map"
    children = {link.child_frame_id for _, message in found["/tf"] for link in message.transforms}
    assert children == {"beaver/odom", "beaver/base_link", "beaver/camera_optical"}


@pytest.mark.slow
def test_what_cannot_be_exported_is_told_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, out = finished(tmp_path, 10), tmp_path / "out.mcap"
    (there := tmp_path / "there.mcap").touch()
    assert "already exists" in refused(capsys, path, "--ros2", there)
    (named := tmp_path / "named").mkdir()
    assert "bus.vessel '3otter'" in refused(
        capsys, record(named, load_config(sets=("bus.vessel=3otter",))), "--ros2", out
    )
    (empty := tmp_path / "empty").mkdir()
    log = begin(empty)
    log.finish({})
    assert "nothing in it" in refused(capsys, log.path, "--ros2", out)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert "pip install 'paani[ros2]'" in refused(capsys, path, "--ros2", out)
    assert not out.exists()
    assert [file.name for file in tmp_path.iterdir() if "partial" in file.name] == []
