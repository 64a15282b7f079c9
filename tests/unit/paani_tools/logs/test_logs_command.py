"""`paani logs`: what it prints, what it writes, and what it says of bad input."""

from __future__ import annotations

import csv
import json
import os
import re
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.cli import main
from paani.logs.reader import open_log
from paani.logs.writer import LogWriter
from paani_tools.logs.info import DirectionChanges
from paani_tools.replay.verify import recording_facts
from tests.unit.paani.logs.small_logs import NAME, START_US, about, begin, fill, finished, put, unfinished

ONE = "20231114T221320Z-1.mcap"


def output_of(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """What the command prints when all is well."""
    assert main(["logs", *map(str, words)]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The one line on standard error of a user's mistake."""
    assert main(["logs", *map(str, words)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.slow
def test_info_tells_what_is_in_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = finished(tmp_path, 60)
    text = output_of(capsys, "info", path)
    for words in ("2023-11-14 22:13:20 UTC, 3.0 s", "vessel otter", "profile paani", "paani 0"):
        assert words in text
    [line] = [line for line in text.splitlines() if line.startswith("localization/odometry")]
    assert line.split()[1:] == ["60", "20.00", "0.05", "0", "0"]
    info = json.loads(output_of(capsys, "info", tmp_path, "--json"))
    assert info["start_us"] == START_US
    assert info["direction_changes_per_min"] is None
    assert {topic["topic"]: topic["messages"] for topic in info["topics"]}["camera/picture"] == 12


@pytest.mark.slow
def test_counts_of_a_recorder_are_added_up_and_none_is_absurd(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, counts in enumerate(("dropped=3 missing=1", f"missing=2 dropped={'9' * 5000} dropped=-4 x dropped=")):
        log = begin(tmp_path, f"{number}.mcap")
        fill(log, 10, 10)
        log.finish({"localization/odometry": counts})
    [line] = [line for line in output_of(capsys, "info", tmp_path).splitlines() if line.startswith("localization/")]
    assert line.split()[-2:] == ["3", "3"]
    assert recording_facts(open_log(tmp_path)).lost == {"localization/odometry": 6}


def test_changes_of_direction_are_counted() -> None:
    directions = DirectionChanges()
    for direction in ("STRAIGHT", "STRAIGHT", "LEFT", "STRAIGHT", "STOP"):
        advisory = m.Advisory(source_us=0, direction=m.Direction(direction), reason=m.Reason.CENTER_CLEAR)
        directions.take(msgspec.json.encode(advisory))
    directions.take(b"nonsense")
    assert (directions.advisories, directions.changes) == (5, 3)


@pytest.mark.slow
def test_an_unfinished_file_is_told_and_mended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = unfinished(tmp_path, 60)
    assert main(["logs", "info", str(path)]) == 1
    printed = capsys.readouterr()
    assert "localization/odometry" in printed.out, "what can be read is told all the same"
    assert re.fullmatch(rf"paani: {path.name}: unfinished .*repair.*\n", printed.err)
    assert "unfinished" in output_of(capsys, "list", tmp_path)
    assert "messages kept" in output_of(capsys, "repair", path)
    assert "nothing to repair" in output_of(capsys, "repair", path)
    (tmp_path / f"{NAME}.keep").touch()
    assert "finished, kept" in output_of(capsys, "list", tmp_path)
    assert open_log(path).problems == []
    output_of(capsys, "info", path)


@pytest.mark.slow
def test_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = finished(tmp_path, 60), tmp_path / "tables"
    assert "2 tables, 72 rows" in output_of(capsys, "export", path, "--csv", out)
    assert sorted(file.name for file in out.iterdir()) == ["camera_picture.csv", "localization_odometry.csv"]
    with (out / "localization_odometry.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert set(rows[0]) == {"log_us", *(field for field in m.Odometry.__struct_fields__)}
    assert [float(row["x_m"]) for row in rows] == pytest.approx([0.1 * number for number in range(60)])
    assert [int(row["log_us"]) for row in rows] == [START_US + 50_000 * number for number in range(60)]


@pytest.mark.slow
def test_tables_hold_nested_fields_and_lists(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.unit.paani.logs.small_logs import begin, put  # noqa: PLC0415

    log = begin(tmp_path)
    advisory = m.Advisory(
        source_us=START_US, sent_us=START_US, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK,
        left=m.LaneRisk(risk=0.25), contributing_track_ids=(3, 4), explanation='says "left", twice',
    )  # fmt: skip
    put(log, keys.ADVISORY, advisory)
    log.finish({})
    output_of(capsys, "export", log.path, "--csv", tmp_path / "t")
    with (tmp_path / "t" / "advisor_advisory.csv").open(encoding="utf-8", newline="") as file:
        [row] = csv.DictReader(file)
    assert (row["direction"], row["left.risk"], row["contributing_track_ids"]) == ("LEFT", "0.25", "[3,4]")
    assert row["explanation"] == 'says "left", twice'


@pytest.mark.slow
def test_tracks_for_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gpxpy = pytest.importorskip("gpxpy")
    path = finished(tmp_path, 60)
    output_of(capsys, "export", path, "--geojson", tmp_path / "t.geojson", "--gpx", tmp_path / "t.gpx")
    [feature] = json.loads((tmp_path / "t.geojson").read_text())["features"]
    assert feature["geometry"]["coordinates"][0] == [4.0, 52.0]
    assert len(feature["geometry"]["coordinates"]) == len(feature["properties"]["coordTimes"]) == 3
    assert feature["properties"]["coordTimes"][1] == "2023-11-14T22:13:21.000Z"
    [track] = gpxpy.parse((tmp_path / "t.gpx").read_text()).tracks
    assert track.name == "estimate"
    assert [point.latitude for point in track.segments[0].points] == pytest.approx([52.0, 52.00002, 52.00004])
    assert track.segments[0].points[0].time.isoformat() == "2023-11-14T22:13:20+00:00"


@pytest.mark.slow
def test_what_can_be_read_is_exported_and_the_rest_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = finished(tmp_path, 60)
    data = bytearray(path.read_bytes())
    from tests.unit.paani.logs.test_repair import chunks  # noqa: PLC0415

    data[chunks(bytes(data))[2].start + 60] ^= 0xFF
    path.write_bytes(data)
    assert main(["logs", "export", str(path), "--csv", str(tmp_path / "t")]) == 0
    out, errors = capsys.readouterr()
    assert "60 rows" in out
    assert NAME in errors
    assert "damaged" in errors


@pytest.mark.parametrize("what", ["info", "repair", "export"])
@pytest.mark.parametrize(
    ("data", "words"),
    [(b"", "empty file"), (b"# some text that is no log", "not an MCAP file")],
    ids=["empty", "text"],
)
def test_bad_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str, data: bytes, words: str
) -> None:
    path = tmp_path / ONE
    path.write_bytes(data)
    more = ("--csv", tmp_path / "t") if what == "export" else ()
    assert refused(capsys, what, path, *more) == f"paani: {path}: {words}"
    assert not (tmp_path / "t").exists()


@pytest.mark.parametrize("what", ["info", "repair", "export"])
def test_a_pipe_is_no_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    """Opening it would wait for whoever writes into it."""
    path = tmp_path / ONE
    os.mkfifo(path)
    more = ("--csv", tmp_path / "t") if what == "export" else ()
    assert refused(capsys, what, path, *more) == f"paani: {path}: is no file"


def test_a_later_format_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = LogWriter(tmp_path / NAME, about(), (), START_US)
    log.finish({})
    path = log.path
    newer = path.read_bytes().replace(
        b"\x06\x00\x00\x00format\x01\x00\x00\x001", b"\x06\x00\x00\x00format\x01\x00\x00\x002"
    )
    assert newer != path.read_bytes()
    path.write_bytes(newer)
    assert refused(capsys, "info", path) == f"paani: {path}: recorded in format 2; this program reads up to 1"


@pytest.mark.slow
def test_mistakes_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = finished(tmp_path)
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "no such file" in refused(capsys, "info", tmp_path / "none.mcap")
    assert str(empty) in refused(capsys, "info", empty)
    assert str(empty) in refused(capsys, "list", empty)
    assert f"{path}: is not a folder" in refused(capsys, "list", path)
    assert "--csv DIR" in refused(capsys, "export", path)
    assert f"{empty}: already exists" in refused(capsys, "export", path, "--csv", empty)
    assert "no such folder" in refused(capsys, "export", path, "--gpx", tmp_path / "no" / "t.gpx")
    none = unfinished(tmp_path, 0, name="20231114T221321Z-1.mcap")
    assert "no track in it" in refused(capsys, "export", none, "--geojson", tmp_path / "t.geojson")
    assert not (tmp_path / "t.geojson").exists()
    assert sorted(file.name for file in tmp_path.iterdir()) == [NAME, none.name, "empty"]


def advised(folder: Path, name: str, from_us: int) -> None:
    """A drive of 60 s whose direction changes every ten, with the part number of a first file."""
    log = LogWriter(folder / name, about(), keys.every_topic(), from_us)
    for number in range(301):
        direction = m.Direction.LEFT if number // 50 % 2 else m.Direction.RIGHT
        at_us = from_us + number * 200_000
        advisory = m.Advisory(
            source_us=at_us, sent_us=at_us, seq=number, direction=direction, reason=m.Reason.CENTER_RISK
        )
        put(log, keys.ADVISORY, advisory)
    log.finish({})


@pytest.mark.slow
def test_two_drives_in_one_folder_last_as_long_as_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The day between them is no part of either."""
    advised(tmp_path, ONE, START_US)
    alone = json.loads(output_of(capsys, "info", tmp_path, "--json"))
    advised(tmp_path, "20231115T221320Z-1.mcap", START_US + 86_400_000_000)
    both = json.loads(output_of(capsys, "info", tmp_path, "--json"))
    assert (alone["duration_s"], both["duration_s"]) == (60.0, 120.0)
    rates = [[(t["rate_hz"], t["gap_s"]) for t in info["topics"]] for info in (alone, both)]
    assert rates == [[(5.0, 0.2), (0.1, 10.0)]] * 2
    assert alone["direction_changes_per_min"] == 6.0
    assert both["direction_changes_per_min"] in {6.0, 6.5}  # with the change from one drive to the other
