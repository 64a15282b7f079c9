"""Recordings as the page has them: named by file name alone, neither deleted while written nor while protected."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.errors import UserError
from paani.logs.reader import open_log
from paani_services.dashboard import recording_reader
from paani_services.dashboard.frames import LENGTH, decode_frame
from paani_services.dashboard.page_state import PageSettings
from paani_services.dashboard.recordings import RecordingFolder, RecordingRefusedError
from tests.unit.paani.logs.small_logs import NAME, START_US, STEP_US, begin, fill, finished, put

LATER = "20231114T221330Z-2.mcap"


def refusal(folder: RecordingFolder, name: str) -> tuple[int, str]:
    with pytest.raises(RecordingRefusedError) as caught:
        folder.delete(name)
    return caught.value.status, str(caught.value)


@pytest.mark.slow
def test_the_list_says_what_each_is(tmp_path: Path) -> None:
    finished(tmp_path)
    (tmp_path / "notes.mcap").write_bytes(b"not a recording of ours")
    log = begin(tmp_path, LATER)
    fill(log, 20, 10)
    folder = RecordingFolder(str(tmp_path))
    folder.protect(NAME, protected=True)
    newest, oldest = folder.list().recordings
    assert (newest.name, newest.running, newest.duration_s, newest.protected) == (LATER, True, None, False)
    assert (oldest.name, oldest.running, oldest.protected) == (NAME, False, True)
    assert oldest.duration_s == pytest.approx(59 * STEP_US * 1e-6)
    assert oldest.start_us == START_US // 1_000_000 * 1_000_000
    assert oldest.size_bytes == (tmp_path / NAME).stat().st_size
    log.abandon()
    assert not folder.list().recordings[0].running


@pytest.mark.slow
def test_what_is_protected_or_being_written_is_not_deleted(tmp_path: Path) -> None:
    path, log = finished(tmp_path), begin(tmp_path, LATER)
    folder = RecordingFolder(str(tmp_path))
    folder.protect(NAME, protected=True)
    assert refusal(folder, NAME) == (409, f"{NAME} is protected: take its protection off first")
    assert refusal(folder, LATER) == (409, f"{LATER} is being written")
    assert path.exists()
    assert (tmp_path / LATER).exists()
    folder.protect(NAME, protected=False)
    folder.delete(NAME)
    log.abandon()
    folder.delete(LATER)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["../secret.mcap", "/etc/passwd", "notes.mcap", "", ".", NAME, f"../{NAME}", NAME + "\0"]
)
@pytest.mark.slow
def test_nothing_else_is_a_recording(tmp_path: Path, name: str) -> None:
    folder, outside = tmp_path / "in", finished(tmp_path)
    folder.mkdir()
    (folder / "notes.mcap").write_bytes(b"")
    assert refusal(RecordingFolder(str(folder)), name)[0] == 404
    assert outside.exists()
    (folder / NAME).symlink_to(outside)
    assert refusal(RecordingFolder(str(folder)), NAME)[0] == 404, "a link leads elsewhere"
    assert outside.exists()


def test_without_a_recorder_there_is_no_folder() -> None:
    folder = RecordingFolder("")
    assert (folder.list().folder, folder.list().recordings) == ("", ())
    status, text = refusal(folder, NAME)
    assert (status, "recorder.folder" in text) == (404, True)


@pytest.mark.slow
def test_the_series_of_a_recording(tmp_path: Path) -> None:
    log = begin(tmp_path)
    for number in range(3):
        at_us = START_US + number * 400_000
        is_stopped = number > 0
        stopped = m.OperatorState(
            source_us=at_us, sent_us=at_us, epoch=5, armed=False, stopped=is_stopped, stops=int(is_stopped), by="stop"
        )
        put(log, keys.OPERATOR_STATE, stopped)
        advisory = m.Advisory(
            source_us=at_us, sent_us=at_us + 50_000, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK
        )
        put(log, keys.ADVISORY, advisory)
    fill(log, 60, 10)
    log.finish({})
    series = recording_reader.read_series(open_log(log.path))
    columns = dict(zip(series.samples.names, series.samples.values, strict=True))
    end_us = START_US + 59 * STEP_US
    assert columns["at_us"] == (START_US, START_US + 1_000_000, START_US + 2_000_000, end_us)
    assert columns["speed_mps"][1:] == (0.5, 0.5, 0.5)
    assert columns["latency_ms"][1] == 50.0
    assert columns["mode"][1:3] == ("STOPPED", ""), "stale a second later"
    assert [(event.level, event.text) for event in series.events] == [
        ("info", "the operator's process is here: not armed"),
        ("info", "LEFT: CENTER_RISK"),
        ("stop", "STOP requested by paani stop"),
    ]


@pytest.mark.slow
def test_the_frames_of_a_recording(tmp_path: Path) -> None:
    packed = recording_reader.read_frames(open_log(finished(tmp_path)), START_US + 500_000, START_US + 1_500_000)
    frames, at = [], 0
    while at < len(packed):
        end = at + LENGTH.size + LENGTH.unpack_from(packed, at)[0]
        frames.append(decode_frame(packed[at + LENGTH.size : end]))
        at = end
    key, _, body = frames[0]
    assert (key, msgspec.json.decode(body, type=PageSettings).mode) == ("dashboard/settings", "replay")
    moments = [header.at_us - START_US for key, header, _ in frames if key == keys.ODOMETRY.name]
    assert moments == [500_000 + step * 100_000 for step in range(11)], "ten a second of twenty"
    pictures = [(header, body) for key, header, body in frames if key == keys.PICTURE.name]
    assert [header.at_us - START_US for header, _ in pictures] == [500_000, 750_000, 1_000_000, 1_250_000, 1_500_000]
    assert pictures[0][1].startswith(b"\xff\xd8")
    assert msgspec.json.decode(pictures[0][0].picture, type=m.PictureHeader).frame_seq == 2


@pytest.mark.slow
def test_too_much_at_once_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_reader, "MAX_BYTES", 9000)
    with pytest.raises(UserError, match="more than"):
        recording_reader.read_frames(open_log(finished(tmp_path)), START_US, START_US + 3_000_000)


def test_what_cannot_be_read_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / NAME).write_bytes(b"junk")
    assert recording_reader.main(["0", "series", str(tmp_path / NAME)]) == 2
    assert "not an MCAP file" in capsys.readouterr().err
