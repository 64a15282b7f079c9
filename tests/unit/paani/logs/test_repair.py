"""Cut and damaged recordings: what can be read is kept, whatever the damage."""

from __future__ import annotations

import collections
import functools
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer

from paani.errors import UserError
from paani.logs.reader import open_log
from paani.logs.repair import Interrupted, is_finished, repair, repair_all
from paani.logs.scan import HEAD, Damage, ScannedRecord, scan
from tests.unit.paani.logs.small_logs import NAME, begin, finished, unfinished

pytestmark = pytest.mark.slow

N, EVERY = 60, 10
MANY = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@functools.cache
def whole() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return finished(Path(folder), N, EVERY).read_bytes()


@functools.cache
def cut() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return unfinished(Path(folder), N, EVERY).read_bytes()


def chunks(data: bytes) -> list[ScannedRecord]:
    return [piece for piece in scan(data) if isinstance(piece, ScannedRecord) and piece.opcode == Opcode.CHUNK]


def poses(path: Path) -> list[int]:
    return [record.seq for record in open_log(path).records(["localization/odometry"])]


def read(path: Path) -> None:
    collections.deque(open_log(path).records(), maxlen=0)


def refusal(act: Callable[[], object]) -> str:
    """What the user is told; empty where nothing is wrong."""
    try:
        act()
    except UserError as error:
        return str(error)
    return ""


def write(folder: Path, data: bytes) -> Path:
    path = folder / NAME
    path.write_bytes(data)
    return path


def test_a_killed_recorder_loses_nothing_that_was_flushed(tmp_path: Path) -> None:
    path = unfinished(tmp_path, N, EVERY)
    assert not is_finished(path)
    repaired = repair(path)
    assert (repaired.changed, repaired.lost, repaired.original) == (True, (), None)
    assert is_finished(path)
    log = open_log(path)
    assert log.problems == []
    assert poses(path) == list(range(N))
    assert log.attachment("config.json") is not None
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) == repaired.messages
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == repaired.messages
    assert log.topics["localization/odometry"] == N
    assert [file.name for file in tmp_path.iterdir()] == [NAME]


def test_a_whole_file_is_left_alone(tmp_path: Path) -> None:
    path = finished(tmp_path)
    before = path.read_bytes()
    assert not repair(path).changed
    assert path.read_bytes() == before
    repaired = write(tmp_path, cut())
    assert repair(repaired).changed
    assert not repair(repaired).changed


def test_a_damaged_middle_keeps_the_original(tmp_path: Path) -> None:
    """Only the damaged chunk goes; the file as it was stays beside."""
    third = chunks(whole())[2]
    data = bytearray(whole())
    data[third.start + 60] ^= 0xFF
    path = write(tmp_path, bytes(data))
    repaired = repair(path)
    assert len(repaired.lost) == 1
    assert f"bytes {third.start} to {third.end}" in repaired.lost[0]
    assert repaired.original == tmp_path / (NAME + ".damaged")
    assert repaired.original.read_bytes() == bytes(data)
    assert poses(path) == [*range(20), *range(30, N)]
    assert open_log(path).metadata("repair") == {"1": repaired.lost[0]}


def test_the_first_chunk_may_go_with_all_it_defines(tmp_path: Path) -> None:
    data = bytearray(whole())
    data[chunks(whole())[0].start + 60] ^= 0xFF
    path = write(tmp_path, bytes(data))
    assert repair(path).changed
    assert poses(path) == list(range(10, N))


@MANY
@given(size=st.integers(min_value=1, max_value=len(cut())))
def test_cut_anywhere_what_lies_before_is_kept(tmp_path: Path, size: int) -> None:
    """Property: every chunk that is whole in the cut file is in the repaired one."""
    path = write(tmp_path, cut()[:size])
    kept = sum(chunk.end <= size for chunk in chunks(cut()))
    message = refusal(lambda: repair(path))
    if message:
        assert NAME in message
        assert size < 8
        return
    assert poses(path) == list(range(kept * EVERY))
    assert open_log(path).problems == []


@MANY
@given(flips=st.lists(st.integers(min_value=0, max_value=8 * len(whole()) - 1), min_size=1, max_size=4))
def test_flipped_bits_cost_only_the_chunks_they_hit(tmp_path: Path, flips: list[int]) -> None:
    """Property: no bit flips raise anything but UserError, in repair or in reading; untouched chunks survive."""
    data = bytearray(whole())
    for bit in flips:
        data[bit // 8] ^= 1 << bit % 8
    path = write(tmp_path, bytes(data))
    for original in tmp_path.glob("*.damaged"):
        original.unlink()
    assert NAME in (refusal(lambda: read(path)) or NAME)
    message = refusal(lambda: repair(path)) or refusal(lambda: read(path))
    if message:
        assert NAME in message
        assert any(bit // 8 < 1000 for bit in flips), "only what says whose file it is can refuse it"
        return
    hit = {
        number
        for number, chunk in enumerate(chunks(whole()))
        if any(data[at] != whole()[at] for at in range(chunk.start, chunk.end))
    }
    survivors = [
        seq for number in range(N // EVERY) if number not in hit for seq in range(number * 10, number * 10 + 10)
    ]
    assert set(survivors) <= set(poses(path))


@MANY
@given(data=st.binary(max_size=400))
def test_scan_takes_any_bytes(data: bytes) -> None:
    """Property: the pieces follow one another without gap or overlap."""
    at = 8 if data[:8] == b"\x89MCAP0\r\n" else 0
    for piece in scan(data):
        assert piece.start == at < piece.end <= len(data)
        at = piece.end


def test_scan_finds_its_way_after_a_wrong_length() -> None:
    """A length that points beyond the file hides the rest of it from whoever only follows lengths."""
    second, third = chunks(whole())[1:3]
    data = bytearray(whole())
    data[second.start + 8] = 0x7F
    pieces = list(scan(bytes(data)))
    assert Damage(second.start, third.start, "cut") in pieces
    assert third in pieces


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty file"),
        (b"not a log at all, but long enough to hold a magic number", "not an MCAP file"),
        (b"\x00" * 5000, "not an MCAP file"),
    ],
    ids=["empty", "text", "zeros"],
)
def test_what_is_no_log_is_named(tmp_path: Path, data: bytes, message: str) -> None:
    path = write(tmp_path, data)
    with pytest.raises(UserError, match=rf"{NAME}: {message}"):
        repair(path)
    assert path.read_bytes() == data


def test_a_stranger_s_file_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / NAME
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="another")
        channel = writer.register_channel("chatter", "cdr", 0)
        writer.add_message(channel, 1, b"hello", 1)
        writer.flush()
    before = path.read_bytes()
    with pytest.raises(UserError, match=rf"{NAME}: profile 'ros2': not recorded by PAANI"):
        repair(path)
    assert path.read_bytes() == before


def test_an_interrupted_repair_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = unfinished(tmp_path)
    asked = iter([False] * 60 + [True] * 1000)
    with pytest.raises(Interrupted):
        repair(path, lambda: next(asked))
    assert path.read_bytes() == cut()
    assert list(tmp_path.iterdir()) == [path]


def test_all_of_a_folder_but_what_is_being_written(tmp_path: Path) -> None:
    used = begin(tmp_path, name="20250101T000000Z-1.mcap")
    torn = unfinished(tmp_path, name="20250101T000001Z-1.mcap")
    whole_one = finished(tmp_path, name="20250101T000002Z-1.mcap")
    foreign = write(tmp_path, b"something else")
    message = repair_all(tmp_path, lambda: False)
    assert len(message) == 2
    assert foreign.name in message[0]
    assert message[1].startswith(f"{torn.name}: repaired")
    assert not is_finished(used.path)
    used.finish({})
    assert is_finished(used.path)
    assert is_finished(torn)
    assert is_finished(whole_one)


def test_a_damaged_summary_is_written_anew(tmp_path: Path) -> None:
    data = bytearray(whole())
    data[-40] ^= 0xFF
    path = write(tmp_path, bytes(data))
    assert open_log(path).problems
    repaired = repair(path)
    assert (repaired.changed, repaired.lost) == (True, ())
    assert open_log(path).problems == []
    assert poses(path) == list(range(N))


def test_a_second_repair_finds_the_file_in_use_and_no_original_is_lost(tmp_path: Path) -> None:
    data = bytearray(whole())
    data[chunks(whole())[2].start + 60] ^= 0xFF
    path = write(tmp_path, bytes(data))
    second: list[str] = []

    def interrupt() -> bool:
        second.append(refusal(lambda: repair(path)))
        return False

    first = repair(path, interrupt).original
    assert first is not None
    assert set(second) == {f"{path}: is being written"}
    again = bytearray(path.read_bytes())
    again[chunks(bytes(again))[1].start + 60] ^= 0xFF
    path.write_bytes(bytes(again))
    other = repair(path).original
    assert other == tmp_path / (NAME + ".damaged1")
    assert (first.read_bytes(), other.read_bytes()) == (bytes(data), bytes(again))


BAD_RECORDS = {
    "a cut channel": (Opcode.CHANNEL, b"\x01"),
    "a topic that is no text": (Opcode.CHANNEL, b"\x01\x00\x00\x00\x01\x00\x00\x00\xff" + bytes(8)),
    "a cut schema": (Opcode.SCHEMA, b"\x01\x00\xff"),
    "a short message": (Opcode.MESSAGE, bytes(10)),
}


@pytest.mark.parametrize("bad", BAD_RECORDS)
def test_what_a_chunk_without_a_checksum_holds_is_damage(tmp_path: Path, bad: str) -> None:
    opcode, inside = BAD_RECORDS[bad]
    records = HEAD.pack(opcode, len(inside)) + inside
    content = struct.pack("<QQQIIQ", 0, 0, len(records), 0, 0, len(records)) + records
    first = chunks(whole())[0]
    path = write(
        tmp_path, whole()[: first.start] + HEAD.pack(Opcode.CHUNK, len(content)) + content + whole()[first.start :]
    )
    assert refusal(lambda: read(path)) == ""
    assert repair(path).lost
    assert poses(path) == list(range(N))


def test_a_format_of_more_digits_than_a_number_has_is_a_later_one(tmp_path: Path) -> None:
    path = tmp_path / NAME
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("paani")
        writer.add_metadata("paani", {"format": "9" * 5000})
        writer.finish()
    assert "this program reads up to" in refusal(lambda: open_log(path))


def test_messages_outside_chunks_are_left_out_said_and_kept_beside(tmp_path: Path) -> None:
    path = tmp_path / NAME
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("paani", "paani 0.1.0")
        channel = writer.register_channel(
            "localization/odometry", "json", writer.register_schema("a", "jsonschema", b"{}")
        )
        for number in range(N):
            writer.add_message(channel, number, b"{}", number, number)
        writer.finish()
    loose = path.read_bytes()[:-20]
    path.write_bytes(loose)
    repaired = repair(path)
    assert (repaired.messages, repaired.lost[-1]) == (0, f"{N} messages outside chunks, which no recorder writes")
    assert repaired.original is not None
    assert repaired.original.read_bytes() == loose
