"""Logs are read as far as they can be read, and the rest is named."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from paani.config import with_settings
from paani.errors import UserError
from paani.logs.reader import Log, Record, open_log
from paani_tools.replay.report_text import change_text, check_text
from paani_tools.replay.verify import change_log, check_log
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, T0_US, drive, write_log

RECORDS = drive(6.0)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_log(tmp_path_factory.mktemp("whole") / "a.mcap", RECORDS).read_bytes()


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Messages outside chunks, without any checksum."""
    return write_log(tmp_path_factory.mktemp("bare") / "a.mcap", RECORDS, chunked=False).read_bytes()


def opened(folder: Path, data: bytes) -> Log:
    path = folder / "a.mcap"
    path.write_bytes(data)
    return open_log(path)


def test_everything_comes_back_as_it_was_written(tmp_path: Path) -> None:
    log = open_log(write_log(tmp_path / "a.mcap", RECORDS))
    assert list(log.records()) == sorted(RECORDS, key=lambda r: r.log_us)
    assert log.problems == []
    assert log.config() == CONFIG
    assert sum(log.topics.values()) == len(RECORDS)
    assert (log.start_us, log.end_us) == (min(r.log_us for r in RECORDS), max(r.log_us for r in RECORDS))
    with (tmp_path / "a.mcap").open("rb") as file:  # what the official reader finds
        messages = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(file).iter_messages()]
    assert [(r.topic, r.log_us * 1000, r.data) for r in log.records()] == messages


def test_only_the_wanted_topics_and_times(tmp_path: Path) -> None:
    log = open_log(write_log(tmp_path / "a.mcap", RECORDS))
    wanted = [r for r in RECORDS if r.topic == "controller/thrust" and 2e6 <= r.log_us - T0_US <= 4e6]
    assert list(log.records(["controller/thrust", "no/such"], T0_US + 2_000_000, T0_US + 4_000_000)) == wanted
    assert len(wanted) > 10


@pytest.mark.slow
def test_a_folder_of_parts_is_one_log(tmp_path: Path) -> None:
    thirds = [RECORDS[i : i + len(RECORDS) // 3 + 1] for i in range(0, len(RECORDS), len(RECORDS) // 3 + 1)]
    for number, part in enumerate(thirds):
        write_log(tmp_path / f"20270101T000000Z-{number}.mcap", part)
    log = open_log(tmp_path)
    assert list(log.records()) == sorted(RECORDS, key=lambda r: r.log_us)
    assert check_log(log, log.config()).is_exact
    (tmp_path / "20270101T000000Z-9.mcap").write_bytes(b"not a log")
    log = open_log(tmp_path)
    assert log.problems == [f"{tmp_path}/20270101T000000Z-9.mcap: not an MCAP file"]
    assert not check_log(log, log.config()).is_exact


def test_drives_with_different_settings_are_not_one_log(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", RECORDS[:100])
    write_log(tmp_path / "b.mcap", RECORDS[100:], with_settings(CONFIG, ("navigator.cruise_mps=0.4",)))
    with pytest.raises(UserError, match="different settings"):
        open_log(tmp_path)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("indexed", [IndexType.ALL, IndexType.NONE])
def test_files_of_other_writers(
    tmp_path: Path, compression: CompressionType, chunked: bool, indexed: IndexType
) -> None:
    file = io.BytesIO()
    writer = Writer(file, 4096, compression, indexed, use_chunking=chunked, repeat_channels=chunked)
    writer.start("other", "x")
    channel = writer.register_channel("a/b", "json", writer.register_schema("A", "jsonschema", b"{}"))
    for number in range(500):
        writer.add_message(channel, (T0_US + number) * 1000, b'{"a":%d}' % number, 0, number)
    writer.finish()
    log = opened(tmp_path, file.getvalue())
    assert [r.data for r in log.records()] == [b'{"a":%d}' % number for number in range(500)]
    assert log.topics == {"a/b": 500}
    assert any("not recorded by PAANI" in problem for problem in log.problems)
    with pytest.raises(UserError, match="no config"):
        log.config()


def test_chunks_whose_times_overlap_come_in_order(tmp_path: Path) -> None:
    times = [(i * 37) % 400 for i in range(400)]
    records = [Record("a/b", T0_US + t * 1000, i, b"x" * 400) for i, t in enumerate(times)]
    log = open_log(write_log(tmp_path / "a.mcap", records))
    assert [r.log_us for r in log.records()] == sorted(r.log_us for r in records)


@pytest.mark.parametrize(
    ("data", "named"),
    [(b"", "empty file"), (b"not a log at all", "not an MCAP file"), (b"\x89MCAP0\r\n", "")],
    ids=["empty", "foreign", "magic"],
)
def test_what_is_no_log(tmp_path: Path, data: bytes, named: str) -> None:
    if named:
        with pytest.raises(UserError, match=named):
            opened(tmp_path, data)
    else:
        log = opened(tmp_path, data)
        assert (list(log.records()), log.topics, log.start_us) == ([], {}, 0)
        assert log.problems
    with pytest.raises(UserError, match="No such file"):
        open_log(tmp_path / "missing.mcap")
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=r"no \.mcap file"):
        open_log(tmp_path / "folder")


@pytest.mark.parametrize("cut", [0.05, 0.3, 0.7, 0.95, 0.999])
def test_a_cut_file_is_read_up_to_the_cut(tmp_path: Path, whole: bytes, cut: float) -> None:
    log = opened(tmp_path, whole[: round(len(whole) * cut)])
    read = list(log.records())
    assert log.problems
    assert read == sorted(RECORDS, key=lambda r: r.log_us)[: len(read)]
    assert sum(log.topics.values()) == len(read)
    assert cut < 0.3 or len(read) > 100


@pytest.mark.slow
def test_a_damaged_chunk_costs_itself_alone(tmp_path: Path, whole: bytes) -> None:
    spans = opened(tmp_path, whole)._parts[0].spans
    at = spans[len(spans) // 2].offset + 500
    log = opened(tmp_path, whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
    read = list(log.records())
    assert any("is damaged, left out" in problem for problem in log.problems)
    assert 0.6 * len(RECORDS) < len(read) < len(RECORDS)
    assert set(read) < set(RECORDS)
    report = check_log(log, log.config())
    assert report.differ == 0
    assert not report.is_exact


def damage(data: st.DataObject, whole: bytes) -> bytes:
    """Flipped, overwritten, cut, taken out or doubled, in up to four places."""
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, max(0, len(damaged) - 1)))
        match data.draw(st.sampled_from(["flip", "write", "cut", "remove", "double"])):
            case "flip" if damaged:
                damaged[at] ^= 1 << data.draw(st.integers(0, 7))
            case "write":
                damaged[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
            case "cut":
                del damaged[at:]
            case "remove":
                del damaged[at : at + data.draw(st.integers(1, 5000))]
            case "double":
                damaged[at:at] = damaged[at : at + data.draw(st.integers(1, 5000))]
    return bytes(damaged)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
@pytest.mark.slow
def test_no_damage_raises_anything_but_a_user_error(tmp_path: Path, whole: bytes, data: st.DataObject) -> None:
    """What is read is what was written, and a replay ends with a verdict."""
    with contextlib.suppress(UserError):
        log = opened(tmp_path, damage(data, whole))
        read = list(log.records())
        assert set(read) <= set(RECORDS)
        config = log.config()
        report = check_log(log, config)
        assert report.differ == 0
        assert report.is_exact <= (set(read) == set(RECORDS))
        change_log(log, config, ("advisor.policy.center_block_risk=0.3",), (), chained=True)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
@pytest.mark.slow
def test_nor_does_damage_that_no_checksum_finds(tmp_path: Path, bare: bytes, data: st.DataObject) -> None:
    """Payloads, ledger and states as damaged as they come: decisions differ or cannot be computed, nothing crashes."""
    with contextlib.suppress(UserError):
        log = opened(tmp_path, damage(data, bare))
        config = log.config()
        check_text(check_log(log, config))
        change_text(change_log(log, config, ("advisor.policy.center_block_risk=0.3",), (), chained=True))
