"""A recording in Rerun, read back by Rerun's own reader."""

from __future__ import annotations

import collections
import math
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.config import CalibrationConfig, Config, encode_config
from paani.errors import UserError
from paani.logs.writer import LogWriter
from paani_tools.logs.command import main
from tests.unit.paani.logs import small_logs
from tests.unit.paani.logs.small_logs import JPEG, START_US, STEP_US, odometry, put

pytest.importorskip("rerun", reason="the extra rerun is not installed")
N, PICTURES_EVERY = 80, 10
SIZE_PX = (320, 240)
CALIBRATION = CalibrationConfig(valid=True, hfov_deg=70.0, height_m=0.9, forward_m=0.55, pitch_down_deg=6.0)
PICTURES = [START_US + number * STEP_US for number in range(0, N, PICTURES_EVERY)]


def at(number: int) -> dict[str, Any]:
    now_us = START_US + number * STEP_US
    return {"source_us": now_us, "sent_us": now_us + 1, "seq": number, "epoch": 5}


def picture_header(number: int, **changes: Any) -> m.PictureHeader:
    frame = {"frame_seq": number, "frame_epoch": 1, "width_px": SIZE_PX[0], "height_px": SIZE_PX[1]}
    return m.PictureHeader(**(at(number) | frame | changes))


def tracks(number: int) -> m.Tracks:
    track = m.Track(
        id=7, label=m.Label.BUOY, hazard=m.Hazard.MARKER, confidence=0.81, box_xyxy=(0.25, 0.5, 0.5, 0.75), hits=3,
        confirmed=True, immediate_danger=False, accepted=True, held=False, age_s=1.0, urgency=0.0,
    )  # fmt: skip
    unseen = msgspec.structs.replace(track, id=8, held=True, accepted=False)
    return m.Tracks(**at(number), frame_seq=number, frame_epoch=1, tracks=(track, unseen))


def write_drive(log: LogWriter) -> None:
    """Four seconds: poses, pictures with masks, boxes for the first of them, one plan at the start."""
    mask = cv2.imencode(".png", np.ones((6, 8), np.uint8))[1].tobytes()
    plan = (m.Waypoint(x_m=0.0, y_m=0.0), m.Waypoint(x_m=5.0, y_m=1.0))
    obstacle = m.MovingObstacle(track_id=7, x_m=9.0, y_m=2.0, radius_m=0.75, east_mps=0.3, north_mps=0.4)
    put(log, keys.PREDICTION, m.Prediction(**at(0), path=plan, obstacles=(obstacle,), home=plan[:1]))
    put(log, keys.ROUTE, m.Route(**at(0), name="r", waypoints=plan, repeat=False))
    area = m.FenceArea(keep=m.Keep.IN, corners=(*plan, m.Waypoint(x_m=5.0, y_m=9.0)))
    put(log, keys.MISSION, m.Mission(**at(0), name="x", legs=(), fence=(area,), rally=plan))
    put(log, keys.MISSION, m.Mission(**at(N // 2), name="x", legs=(), fence=(area,)))
    for number in range(N):
        put(log, keys.ODOMETRY, odometry(number, yaw_rad=0.6, healthy=number >= 10))
        risk = m.LaneRisk(risk=0.2, blocked=False)
        direction = m.Direction.STRAIGHT if number < 30 else m.Direction.LEFT
        put(
            log, keys.ADVISORY,
            m.Advisory(**at(number), direction=direction, reason=m.Reason.CENTER_CLEAR, left=risk, center=risk),
        )  # fmt: skip
        if number % PICTURES_EVERY == 0:
            put(log, keys.PICTURE, picture_header(number), JPEG)
            put(log, keys.MASK, picture_header(number, media_type="image/png", width_px=8, height_px=6), mask)
        if number < 2 * PICTURES_EVERY:  # the advisor says it again until the next frame comes
            put(log, keys.TRACKS, msgspec.structs.replace(tracks(number), frame_seq=number // 10 * 10))


class Entity:
    """The rows of one entity in the order of time, each with the components that it has."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def column(self, name: str) -> list[Any]:
        """One component, of the rows that have it."""
        return [row[name] for row in self.rows if row.get(name) is not None]

    def times_us(self, name: str) -> list[int]:
        """When one component was said."""
        return [_micros(row["time"]) for row in self.rows if row.get(name) is not None]


def read(path: Path) -> dict[str, Entity]:
    """Every entity of the file."""
    from rerun.chunk import RrdReader  # noqa: PLC0415  # of an extra

    found = collections.defaultdict[str, Entity](Entity)
    for chunk in RrdReader(path).stream():
        found[chunk.entity_path].rows += chunk.to_record_batch().to_pylist()
    for entity in found.values():
        entity.rows.sort(key=lambda row: (_micros(row.get("time")), row["rerun.controls.RowId"]))
    return found


def _micros(time: Any) -> int:
    """Since 1970 [us]; 0 of what is static."""
    return 0 if time is None else int(np.datetime64(time, "us").astype(int))


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Entity]:
    folder = tmp_path_factory.mktemp("rerun")
    about = small_logs.about()
    config = encode_config(Config(calibration=CALIBRATION))
    changed = msgspec.structs.replace(about, attachments={**about.attachments, "config.json": config})
    log = LogWriter(folder / small_logs.NAME, changed, keys.every_topic(), START_US)
    write_drive(log)
    log.finish({})
    out = folder / "drive.rrd"
    assert main(["view", str(log.path), "--rerun", "--out", str(out)]) == 0
    assert sorted(path.name for path in folder.iterdir()) == sorted([small_logs.NAME, "drive.rrd"])
    return read(out)


@pytest.mark.slow
def test_every_pose_is_there(rrd: dict[str, Entity]) -> None:
    boat = rrd["/map/boat"]
    places = boat.column("Transform3D:translation")
    assert len(places) == N - 10, "only where the estimate was healthy"
    assert places[10] == [pytest.approx([2.0, 0.0, 0.0])]
    assert boat.column("Transform3D:quaternion")[10] == [pytest.approx([0.0, 0.0, math.sin(0.3), math.cos(0.3)])]
    assert boat.times_us("Transform3D:translation")[10] == START_US + 20 * STEP_US
    [[line]] = rrd["/map/track"].column("LineStrips3D:strips")
    assert len(line) == N - 10
    [[earth]] = rrd["/earth/track"].column("GeoLineStrings:line_strings")
    assert earth[0] == pytest.approx([52.0 + 1e-5, 4.0])


@pytest.mark.slow
def test_pictures_are_the_recorded_bytes_at_their_own_time(rrd: dict[str, Entity]) -> None:
    picture = rrd["/map/boat/camera/picture"]
    assert [bytes(row[0]) for row in picture.column("EncodedImage:blob")] == [JPEG] * len(PICTURES)
    assert picture.times_us("EncodedImage:blob") == PICTURES == rrd["/mask"].times_us("EncodedImage:blob")
    [[pinhole]] = picture.column("Pinhole:image_from_camera")
    assert pinhole[0] == pytest.approx(160.0 / math.tan(math.radians(35.0)), rel=1e-6)


@pytest.mark.slow
def test_boxes_lie_on_their_own_picture_and_on_no_later_one(rrd: dict[str, Entity]) -> None:
    """Each picture begins without boxes; those of a frame come once, at its time."""
    boxes = rrd["/map/boat/camera/picture/tracks"]
    assert boxes.times_us("Clear:is_recursive") == PICTURES
    assert boxes.times_us("Boxes2D:labels") == PICTURES[:2]
    assert ["Clear:is_recursive" in row for row in boxes.rows[:4]] == [True, False, True, False]
    assert boxes.column("Boxes2D:labels") == [["#7 buoy 0.81"]] * 2
    assert boxes.column("Boxes2D:centers")[0] == [[120.0, 150.0]]
    assert boxes.column("Boxes2D:half_sizes")[0] == [[40.0, 30.0]]


@pytest.mark.slow
def test_what_was_not_renewed_is_cleared_when_it_went_stale(rrd: dict[str, Entity]) -> None:
    stale_us = START_US + 1 + round(keys.PREDICTION.fresh_s * 1e6)
    for name in ("/map/plan", "/map/obstacles", "/map/home"):
        assert rrd[name].times_us("Clear:is_recursive") == [stale_us]
    assert rrd["/map/route"].times_us("Clear:is_recursive") == []
    assert rrd["/map/obstacles"].column("Cylinders3D:labels") == [["#7 0.5 m/s"]]
    assert len(rrd["/map/fence"].column("LineStrips3D:strips")[0][0]) == 4, "closed"
    assert len(rrd["/map/route"].column("LineStrips3D:strips")[0][0]) == 2, "not closed, as it does not repeat"


def test_home_and_rally_points_lie_on_the_map_until_others_are_in_force(rrd: dict[str, Entity]) -> None:
    assert rrd["/map/home"].column("Points3D:positions") == [[[0.0, 0.0, 0.0]]]
    assert rrd["/map/home"].column("Points3D:labels") == [["home"]]
    rally = rrd["/map/rally"]
    assert rally.column("Points3D:positions") == [[[0.0, 0.0, 0.0], [5.0, 1.0, 0.0]], []]
    assert rally.column("Points3D:labels")[0] == ["rally", "rally"]
    assert rally.times_us("Points3D:positions") == [START_US + number * STEP_US + 1 for number in (0, N // 2)]


def test_plots_and_log(rrd: dict[str, Entity]) -> None:
    assert rrd["/plots/speed/estimated"].column("Scalars:scalars") == [[0.5]] * N
    assert rrd["/plots/risk/left"].column("Scalars:scalars") == [[pytest.approx(0.2)]] * N
    lines = [row[0].split(" ")[0] for row in rrd["/log/advisor"].column("TextLog:text")]
    assert lines == ["STRAIGHT", "LEFT"]


@pytest.mark.slow
def test_without_a_screen_a_file_has_to_be_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(UserError, match=r"no screen here; name a file to write.*--out FILE"):
        main(["view", str(small_logs.finished(tmp_path)), "--rerun"])


@pytest.mark.slow
def test_the_viewer_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="say in what: --rerun"):
        main(["view", str(small_logs.finished(tmp_path))])
