"""Files that follow one another, a disk that fills up or fails, and what is said of it."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from paani import keys
from paani.config import Config, RecorderConfig, decode_config, load_config
from paani.errors import UserError
from paani.logs.folder import Recording as File
from paani.logs.folder import free_path, recordings, require_folder, too_old
from paani.logs.reader import open_log
from paani.logs.repair import is_finished, repair
from paani.logs.writer import read_head
from paani_services.recorder.backlog import QueuedMessage
from paani_services.recorder.recording import Recording, remove_empty_files
from paani_services.recorder.system_description import describe_system
from tests.unit.paani.logs.small_logs import START_US, STEP_US, finished, odometry

TOPICS = (keys.ODOMETRY, keys.PICTURE)


def settings(folder: Path, **changes: Any) -> RecorderConfig:
    values: dict[str, Any] = {"folder": str(folder), "min_free_mib": 0.0}
    return RecorderConfig(**(values | changes))


def heard(number: int, padding: int = 0) -> QueuedMessage:
    data = msgspec.json.encode(odometry(number)) + b" " * padding
    return QueuedMessage(keys.ODOMETRY, START_US + number * STEP_US, read_head(data), data, b"")


def now_us(number: int) -> int:
    return START_US + number * STEP_US


def record(recording: Recording, numbers: range) -> None:
    for number in numbers:
        one = heard(number)
        recording.counts.count_received(one.topic.name, one.head)
        recording.write([one], now_us(number))


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def poses(folder: Path) -> list[int]:
    return [record.seq for record in open_log(folder).records([keys.ODOMETRY.name])]


def counted(recording: Recording) -> tuple[int, int]:
    [topic] = recording.counts.topics()
    return topic.written, topic.dropped


@pytest.mark.slow
def test_parts_follow_one_another_without_a_gap(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path, part_s=2.0), describe_system(Config()), TOPICS)
    record(recording, range(100))
    recording.close([], now_us(100))
    assert names(tmp_path) == ["20231114T221320Z-1.mcap", "20231114T221322Z-2.mcap", "20231114T221324Z-3.mcap"]
    assert poses(tmp_path) == list(range(100))
    log = open_log(tmp_path)
    assert log.problems == []
    assert log.config() == Config()
    parts = [open_log(path).metadata("paani")["part"] for path in sorted(tmp_path.iterdir())]
    assert parts == ["1", "2", "3"]
    written = [open_log(path).metadata("recorder")[keys.ODOMETRY.name] for path in sorted(tmp_path.iterdir())]
    assert sum(int(line.split()[0].removeprefix("written=")) for line in written) == 100
    assert counted(recording) == (100, 0)


@pytest.mark.slow
def test_a_part_ends_when_it_is_large(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path, part_mib=0.06, flush_s=0.1), describe_system(Config()), TOPICS)
    record(recording, range(1500))
    recording.close([], now_us(1500))
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert len(sizes) > 2
    assert max(sizes) < 0.06 * 2**20 * 1.6
    assert poses(tmp_path) == list(range(1500))


@pytest.mark.slow
def test_a_crash_loses_at_most_what_was_not_flushed(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path, flush_s=0.5), describe_system(Config()), TOPICS)
    record(recording, range(95))
    path = recording.path
    assert path is not None
    assert not is_finished(path)
    with pytest.raises(UserError, match="is being written"):
        repair(path)
    crashed = tmp_path / "crashed"
    crashed.mkdir()
    shutil.copy(path, crashed)
    repair(crashed / path.name)
    kept = poses(crashed)
    assert kept == list(range(len(kept)))
    assert (95 - len(kept)) * STEP_US <= 0.5e6
    recording.close([], now_us(95))


@pytest.mark.slow
def test_a_clock_set_back_begins_a_part_that_is_flushed(tmp_path: Path) -> None:
    """What is heard after it is in a file of its own, in order of time, and on the disk within `flush_s`."""
    recording = Recording(settings(tmp_path, flush_s=0.5, part_s=3600.0), describe_system(Config()), TOPICS)
    record(recording, range(1000, 1100))
    record(recording, range(100))
    first, second = names(tmp_path)
    assert is_finished(tmp_path / first) is not is_finished(tmp_path / second)
    size_bytes = recording.path.stat().st_size if recording.path is not None else 0
    record(recording, range(100, 300))
    assert recording.path is not None
    assert recording.path.stat().st_size > size_bytes
    recording.close([], now_us(300))
    assert [len(list(open_log(tmp_path / name).records([keys.ODOMETRY.name]))) for name in (first, second)] == [
        300,
        100,
    ]


@pytest.mark.slow
def test_beyond_the_budget_the_oldest_recording_is_deleted_unless_kept(tmp_path: Path) -> None:
    """P3: rotation."""
    finished(tmp_path, name="20200101T000000Z-1.mcap")
    size = finished(tmp_path, name="20210101T000000Z-1.mcap").stat().st_size
    finished(tmp_path, name="20220101T000000Z-1.mcap")
    (tmp_path / "20200101T000000Z-1.mcap.keep").touch()
    (tmp_path / "notes.mcap").write_bytes(b"x" * 10 * size)
    budget_mib = 2.5 * size / 2**20
    recording = Recording(settings(tmp_path, budget_mib=budget_mib), describe_system(Config()), TOPICS)
    record(recording, range(1))
    assert "20210101T000000Z-1.mcap" not in names(tmp_path)
    assert "20200101T000000Z-1.mcap" in names(tmp_path)
    assert "20220101T000000Z-1.mcap" in names(tmp_path)
    assert "notes.mcap" in names(tmp_path), "only recordings by their own name"
    recording.close([], now_us(1))


@pytest.mark.slow
def test_no_recorder_deletes_what_another_is_writing(tmp_path: Path) -> None:
    """Two of them in one folder, with room for either and not for both."""
    size = finished(tmp_path, name="20200101T000000Z-1.mcap").stat().st_size
    few = settings(tmp_path, budget_mib=1.5 * size / 2**20)
    one, other = (Recording(few, describe_system(Config()), TOPICS) for _ in range(2))
    record(one, range(400))
    record(other, range(400, 800))
    assert one.path is not None
    assert one.path.exists()
    assert other.path is not None
    assert other.path.exists()
    assert one.size_bytes + other.size_bytes > few.budget_mib * 2**20
    assert "20200101T000000Z-1.mcap" not in names(tmp_path)
    for recording in (one, other):
        recording.close([], now_us(800))


@pytest.mark.slow
def test_kept_recordings_that_fill_the_budget_end_the_recording(tmp_path: Path) -> None:
    size = finished(tmp_path, name="20200101T000000Z-1.mcap").stat().st_size
    (tmp_path / "20200101T000000Z-1.mcap.keep").touch()
    recording = Recording(settings(tmp_path, budget_mib=0.9 * size / 2**20), describe_system(Config()), TOPICS)
    record(recording, range(5))
    assert recording.path is None
    assert "recorder.budget_mib" in recording.problem
    assert counted(recording) == (0, 5)


def test_too_old_takes_no_more_than_it_must() -> None:
    found = [File(Path(str(n)), 10, kept=n == 1) for n in range(5)]
    assert too_old(found, 50) == []
    assert too_old(found, 49) == [Path("0")]
    assert too_old(found, 25) == [Path("0"), Path("2"), Path("3")]
    assert too_old(found, 0) == [Path("0"), Path("2"), Path("3"), Path("4")]


def test_a_nearly_full_disk_pauses_the_recording(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path, min_free_mib=1e9), describe_system(Config()), TOPICS)
    record(recording, range(10))
    assert recording.path is None
    assert "recorder.min_free_mib" in recording.problem
    assert counted(recording) == (0, 10)
    recording.close([], now_us(10))
    assert names(tmp_path) == []


@contextlib.contextmanager
def small_files() -> Iterator[None]:
    """The system refuses to let a file grow beyond 60 kB, as a full disk would."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.slow
def test_a_write_that_fails_is_counted_and_tried_again(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path, flush_s=0.1), describe_system(Config()), TOPICS)
    with small_files():
        record(recording, range(1200))
        recording.close([], now_us(1200))
    assert len(names(tmp_path)) >= 2, "it began again"
    written, dropped = counted(recording)
    assert written + dropped == 1200
    assert dropped > 0
    for path in tmp_path.iterdir():
        repair(path)
    kept = poses(tmp_path)
    assert len(kept) >= written
    assert kept == sorted(set(kept))


@pytest.mark.slow
def test_a_folder_that_disappears_pauses_the_recording(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    recording = Recording(settings(folder), describe_system(Config()), TOPICS)
    record(recording, range(20))
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    record(recording, range(20, 200))
    assert recording.path is None
    assert str(folder) in recording.problem
    folder.mkdir()
    record(recording, range(200, 500))
    recording.close([], now_us(500))
    assert recording.problem == ""
    assert poses(folder)[-1] == 499


def test_file_names_are_unique(tmp_path: Path) -> None:
    first = free_path(tmp_path, START_US, 1)
    first.touch()
    assert free_path(tmp_path, START_US, 1).name == "20231114T221320Z-2.mcap"
    for part in (2, 10, 9):
        (tmp_path / f"20231114T221320Z-{part}.mcap").touch()
    assert [file.path.name[17:-5] for file in recordings(tmp_path)] == ["1", "2", "9", "10"]
    remove_empty_files(tmp_path)
    assert recordings(tmp_path) == []


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"recorder\.folder .*file/below: Not a directory"):
        require_folder(tmp_path / "file" / "below")
    with pytest.raises(UserError, match="leave_out: no topic 'eye/pictures'"):
        load_config(sets=('recorder.leave_out=["eye/pictures"]',))


def test_settings_models_and_versions_are_attached() -> None:
    """A10: the recording names profile, settings, models and versions; the settings are those of this system."""
    config = load_config(profile="paper", sets=["advisor.rate_hz=4.0"])
    about = describe_system(config)
    assert decode_config(about.attachments["config.json"]) == config
    versions = msgspec.json.decode(about.attachments["versions.json"])
    assert versions["paani"] == about.version
    assert versions["numpy"]
    assert versions["python"].startswith("3.")
    assert b"sha256" in about.attachments["models.json"]
    assert about.facts == {"domain": "43", "vessel": "otter", "profile": "paper"}


def test_a_finished_file_opens_with_the_official_reader(tmp_path: Path) -> None:
    recording = Recording(settings(tmp_path), describe_system(Config()), TOPICS)
    record(recording, range(30))
    recording.close([heard(30)], now_us(30))
    [path] = tmp_path.iterdir()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [one.sequence for _, channel, one in reader.iter_messages(topics=[keys.ODOMETRY.name])]
    assert found == list(range(31))


def test_finished_and_open_files_are_synced_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    monkeypatch.setattr(os, "fdatasync", lambda fd: synced.append(Path(f"/proc/self/fd/{fd}").resolve().name))
    recording = Recording(settings(tmp_path, part_s=1.0), describe_system(Config()), TOPICS)
    record(recording, range(30))
    recording.sync_to_disk()
    assert sorted(synced) == names(tmp_path)
    recording.close([], now_us(30))
    synced.clear()
    recording.sync_to_disk()
    assert synced == [names(tmp_path)[-1]], "the last, now that it is finished; the others are on the disk"


@pytest.mark.slow
def test_a10_each_part_keeps_the_configuration(tmp_path: Path) -> None:
    config = load_config(profile="paper")
    recording = Recording(settings(tmp_path, part_s=1.0), describe_system(config), TOPICS)
    record(recording, range(30))
    recording.close([], now_us(30))
    files = sorted(tmp_path.iterdir())
    assert len(files) > 1
    for path in files:
        with path.open("rb") as file:
            attached = {each.name: each.data for each in make_reader(file).iter_attachments()}
        assert decode_config(attached["config.json"]) == config
