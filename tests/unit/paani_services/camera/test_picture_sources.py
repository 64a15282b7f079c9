"""Recordings: order, timing, loops, sizes, and what a user gets wrong."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np
import pytest

from paani.clock import patience_us
from paani.config import CameraConfig, load_config
from paani.errors import UserError
from paani.messages import TimeBase
from paani_services.camera.own_pictures import _make_header, encode_jpeg
from paani_services.camera.picture_sources import Webcam, parse_webcam_index, play_frames, shrink_to_fit
from tests.pictures import river

FIXED = CameraConfig(rate_hz=5.0, loop=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b", "a", "c"):
        (tmp_path / f"{name}.jpg").write_bytes(encode_jpeg(river(ord(name)), 85))
    (tmp_path / "notes.txt").write_text("no picture")
    return tmp_path


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Thirty frames at 15 Hz; frame i is of grey level 5 i."""
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 15.0, (320, 240))
    for i in range(30):
        writer.write(np.full((240, 320, 3), 5 * i, np.uint8))
    writer.release()
    return path


def test_a_folder_plays_by_name(folder: Path) -> None:
    """A8, I17: pictures have no time of their own; their index over the rate is labelled as such."""
    frames = list(play_frames(folder, FIXED))
    assert [Path(f.name).name for f in frames] == ["a.jpg", "b.jpg", "c.jpg"]
    assert [f.media_us for f in frames] == [0, 200_000, 400_000]
    assert {f.time_base for f in frames} == {TimeBase.FRAME_INDEX}
    assert [f.wait_s for f in frames] == [0.0, 0.2, 0.2]
    assert not any(f.restarted for f in frames)


def test_folders_below_are_played_too(folder: Path) -> None:
    (folder / "below").mkdir()
    (folder / "a.jpg").rename(folder / "below" / "a.jpg")
    assert [Path(f.name).name for f in play_frames(folder, FIXED)] == ["b.jpg", "a.jpg", "c.jpg"]


def test_the_first_frame_of_each_later_pass_is_marked(folder: Path) -> None:
    """B2: the first frame of each later pass."""
    frames = list(itertools.islice(play_frames(folder, CameraConfig(loop=True)), 7))
    assert [f.restarted for f in frames] == [False, False, False, True, False, False, True]


def test_a_single_picture_is_a_camera_that_shows_the_same(folder: Path) -> None:
    frames = list(itertools.islice(play_frames(folder / "a.jpg", CameraConfig(loop=True)), 4))
    assert not any(f.restarted for f in frames)
    assert [f.media_us for f in frames] == [0, 200_000, 400_000, 600_000]


@pytest.mark.slow
def test_a_video_at_a_fixed_rate_keeps_its_media_time(video: Path) -> None:
    """I17: every frame, 0.2 s apart on the bus, 1/15 s apart in the recording."""
    frames = list(play_frames(video, FIXED))
    assert len(frames) == 30
    assert {f.time_base for f in frames} == {TimeBase.MEDIA}
    assert {f.wait_s for f in frames[1:]} == {0.2}
    steps_us = np.diff([f.media_us for f in frames])
    assert steps_us == pytest.approx(1e6 / 15.0, abs=2000)
    assert [round(float(f.bgr.mean()) / 5) for f in frames if f.bgr is not None] == list(range(30))


def test_a_video_at_its_own_times_skips_frames_beyond_the_rate(video: Path) -> None:
    frames = list(play_frames(video, CameraConfig(rate_hz=5.0, loop=False, timing="original")))
    assert len(frames) == 10
    assert sum(f.wait_s for f in frames) == pytest.approx(27 / 15, abs=0.01)
    assert [f.wait_s for f in frames[1:]] == pytest.approx([0.2] * 9, abs=0.002)


@pytest.mark.parametrize(
    ("size_wh", "expected_wh"), [((1920, 1080), (480, 270)), ((320, 240), (320, 240)), ((600, 1200), (240, 480))]
)
def test_large_pictures_are_scaled_down_with_their_aspect(
    size_wh: tuple[int, int], expected_wh: tuple[int, int]
) -> None:
    small = shrink_to_fit(np.zeros((size_wh[1], size_wh[0], 3), np.uint8), 320)
    assert (small.shape[1], small.shape[0]) == expected_wh


def test_a_damaged_file_in_a_folder_is_a_frame_without_a_picture(folder: Path) -> None:
    (folder / "b.jpg").write_bytes(b"spoilt")
    assert [f.bgr is None for f in play_frames(folder, FIXED)] == [False, True, False]


def test_an_unusable_path_is_named(tmp_path: Path) -> None:
    spoilt, empty, movie = tmp_path / "x.jpg", tmp_path / "empty", tmp_path / "x.mp4"
    spoilt.write_bytes(b"spoilt")
    movie.write_bytes(b"spoilt")
    empty.mkdir()
    for path in (tmp_path / "missing.jpg", spoilt, empty, movie):
        with pytest.raises(UserError, match=str(path)):
            next(play_frames(path, FIXED))


def test_a_missing_webcam_is_named() -> None:
    with pytest.raises(UserError, match=r"webcam:77.*/dev/video77"):
        Webcam(77, 320, 240)


class UvcCamera:
    """Stands for V4L2: takes what is asked for, and gives pictures of increasing grey, faster than they are read."""

    asked: ClassVar[dict[int, float]] = {}

    def __init__(self, index: int, api: int) -> None:
        assert (index, api) == (7, cv2.CAP_V4L2)

    def set(self, name: int, value: float) -> bool:
        self.asked[name] = value
        return True

    def isOpened(self) -> bool:
        return True

    def read(self) -> tuple[bool, np.ndarray]:
        wh = (int(self.asked[cv2.CAP_PROP_FRAME_WIDTH]), int(self.asked[cv2.CAP_PROP_FRAME_HEIGHT]))
        return True, np.zeros((wh[1], wh[0], 3), np.uint8)


def test_a8_a_webcam_is_asked_for_320_by_240_and_its_newest_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """A8: by the `paper` profile's size; with one picture of buffer what is read is the newest."""
    monkeypatch.setattr(cv2, "VideoCapture", UvcCamera)
    monkeypatch.setattr(Path, "exists", lambda path: path == Path("/dev/video7"))
    paper = load_config(profile="paper").camera
    picture = Webcam(7, paper.width_px, paper.height_px).read()
    assert picture is not None
    assert picture.shape == (240, 320, 3)
    assert UvcCamera.asked[cv2.CAP_PROP_BUFFERSIZE] == 1


def test_webcam_sources_are_parsed() -> None:
    assert [parse_webcam_index(s) for s in ("webcam", "webcam:2", "sim", "webcams/film.mp4")] == [0, 2, None, None]
    with pytest.raises(UserError, match="webcam:x"):
        parse_webcam_index("webcam:x")


@pytest.mark.parametrize(("rate_hz", "patience_s"), [(0.5, 1.98), (5.0, 0.18), (50.0, 0.01)])
def test_the_rate_limit_tolerates_jitter_alone_a8(rate_hz: float, patience_s: float) -> None:
    """A8, J17: one picture every two seconds is every two seconds; the tolerance is for jitter alone."""
    assert patience_us(rate_hz) == pytest.approx(patience_s * 1e6)


def test_i17_the_index_over_the_rate_is_the_time_of_a_picture_and_the_header_says_so(folder: Path) -> None:
    frames = list(play_frames(folder, CameraConfig(rate_hz=4.0, loop=False)))
    assert [frame.media_us for frame in frames] == [0, 250_000, 500_000]
    headers = [_make_header(frame.bgr, 9, frame) for frame in frames if frame.bgr is not None]
    assert [(each.time_base, each.media_us) for each in headers] == [
        (TimeBase.FRAME_INDEX, frame.media_us) for frame in frames
    ]
