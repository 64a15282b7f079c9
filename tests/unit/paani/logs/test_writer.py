"""One recording, read by the official library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from paani import keys
from paani import messages as m
from paani.config import Config, decode_config
from paani.logs.reader import open_log
from paani.logs.viewer import Viewer
from paani.logs.writer import LogWriter, read_head
from tests.unit.paani.logs.small_logs import JPEG, NAME, START_US, about, begin, finished, odometry, put


def messages(path: Path) -> list[tuple[Any, Any, Any]]:
    with path.open("rb") as file:
        return list(make_reader(file, validate_crcs=True).iter_messages())


@pytest.mark.slow
def test_the_official_reader_reads_it_back_to_the_byte(tmp_path: Path) -> None:
    path = finished(tmp_path, 60)
    poses = [(schema, channel, one) for schema, channel, one in messages(path) if channel.topic == keys.ODOMETRY.name]
    assert [one.data for _, _, one in poses] == [msgspec.json.encode(odometry(number)) for number in range(60)]
    schema, channel, one = poses[7]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("paani.Odometry", "jsonschema", "json")
    assert (one.sequence, one.log_time, one.publish_time) == (7, odometry(7).sent_us * 1000, odometry(7).sent_us * 1000)
    with path.open("rb") as file:  # from the front, every checksum
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 60


@pytest.mark.slow
def test_it_says_what_made_it(tmp_path: Path) -> None:
    path = finished(tmp_path)
    with path.open("rb") as file:
        reader = make_reader(file)
        header = reader.get_header()
        assert (header.profile, header.library) == ("paani", "paani 0.1.0")
        attached = {one.name: one.data for one in reader.iter_attachments()}
        noted = {one.name: one.metadata for one in reader.iter_metadata()}
    assert decode_config(attached["config.json"]) == Config()
    assert attached.keys() == {"config.json", "models.json", "versions.json"}
    assert noted["paani"] == {
        "format": "1", "started_us": str(START_US), "domain": "43", "vessel": "otter", "profile": "paani", "part": "1",
    }  # fmt: skip
    assert noted["recorder"]["localization/odometry"].startswith("written=60")


@pytest.mark.slow
def test_every_row_of_the_table_has_a_channel(tmp_path: Path) -> None:
    with finished(tmp_path).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    channels = {channel.topic: channel for channel in summary.channels.values()}
    for topic in keys.every_topic():
        assert channels[topic.name].metadata["producer"] == topic.producer
        picture = topic.stance is keys.Stance.PICTURE
        kind = summary.schemas[channels[topic.name].schema_id].name
        assert kind == ("foxglove.CompressedImage" if picture else f"paani.{topic.type.__name__}")
        assert (topic.name + "/header" in channels) == picture
    assert {name for name in channels if name.startswith("viewer/")} == {
        "viewer/gps", "viewer/pose", "viewer/annotations", "viewer/log",
    }  # fmt: skip


@pytest.mark.slow
def test_a_picture_and_its_header_are_exact(tmp_path: Path) -> None:
    by_topic: dict[str, list[Any]] = {}
    for _, channel, one in messages(finished(tmp_path, 10)):
        by_topic.setdefault(channel.topic, []).append(one)
    pictures, headers = by_topic["camera/picture"], by_topic["camera/picture/header"]
    assert [one.sequence for one in pictures] == [one.sequence for one in headers] == [0, 1]
    assert [one.log_time for one in pictures] == [one.log_time for one in headers]
    assert all(JPEG + bytes((n,)) in one.data for n, one in zip((0, 5), pictures, strict=True))
    assert msgspec.json.decode(headers[1].data, type=m.PictureHeader).frame_seq == 1


@pytest.mark.slow
def test_what_has_no_header_stands_apart(tmp_path: Path) -> None:
    log = begin(tmp_path)
    log.write(keys.ODOMETRY, START_US, None, b"\xff not json", b"")
    log.write(keys.PICTURE, START_US, None, b"bytes", b"no header")
    put(log, keys.PICTURE, odometry(1), b"a header of another type")
    put(log, keys.ODOMETRY, odometry(1))
    log.finish({})
    found = [(channel.topic, one.data) for _, channel, one in messages(log.path)]
    assert ("localization/odometry/unreadable", b"\xff not json") in found
    assert ("camera/picture/unreadable", b"no headerbytes") in found
    assert sum(topic == "camera/picture/unreadable" for topic, _ in found) == 2
    assert sum(topic == "localization/odometry" for topic, _ in found) == 1


@pytest.mark.slow
def test_sequence_numbers_wrap_where_the_format_s_do(tmp_path: Path) -> None:
    log = begin(tmp_path)
    put(log, keys.ODOMETRY, odometry(1, seq=2**32 + 3))
    log.finish({})
    assert next(one.sequence for _, channel, one in messages(log.path) if channel.topic == keys.ODOMETRY.name) == 3


@pytest.mark.slow
def test_an_existing_file_is_never_written_over(tmp_path: Path) -> None:
    path = finished(tmp_path)
    with pytest.raises(FileExistsError):
        LogWriter(tmp_path / NAME, about(), keys.every_topic(), START_US)
    assert not open_log(path).problems


def test_nesting_without_end_is_unreadable() -> None:
    nested = b'{"unknown": ' + 2000 * b"[" + 2000 * b"]" + b"}"
    assert read_head(nested) is None
    assert Viewer().derive(keys.ODOMETRY.name, nested) == []
