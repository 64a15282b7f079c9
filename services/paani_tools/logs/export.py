"""A recording as tables (CSV), and its track for maps (GeoJSON, GPX)."""

from __future__ import annotations

import contextlib
import csv
import datetime
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from paani import keys
from paani import messages as m
from paani.errors import UserError
from paani.logs.reader import Log, Record
from paani.logs.schema import json_schema
from paani.logs.writer import HEADER
from paani.undecodable import UNDECODABLE
from paani.whole_file import new_folder, write_whole

EVERY_US = 1_000_000  # a map needs no more points
ESTIMATE, GPS = "estimate", "gps"

OnRecord = Callable[[Record], None]


class Point(NamedTuple):
    """A place of a track and when."""

    at_us: int
    latitude_deg: float
    longitude_deg: float


class Table:
    """One CSV file: a row for each message, a column for each field; lists are JSON."""

    def __init__(self, path: Path, topic: keys.Topic[Any]) -> None:
        self._columns = list(_columns(msgspec.json.decode(json_schema(topic.type))))
        self._file = path.open("w", encoding="utf-8", newline="")
        self._rows = csv.writer(self._file)
        self._rows.writerow(["log_us", *self._columns])

    def add(self, record: Record) -> bool:
        """False for what is no JSON object."""
        try:
            fields = dict(_flat(msgspec.json.decode(record.data, type=dict[str, Any])))
        except UNDECODABLE:
            return False
        self._rows.writerow([record.log_us, *(fields.get(column, "") for column in self._columns)])
        return True

    def close(self) -> None:
        self._file.close()


def export_csv(log: Log, folder: Path, seen: OnRecord) -> str:
    """One file for each topic that has messages; of pictures the headers. Returns a line that says what was written.

    Raises UserError when the folder is there already or cannot be written; nothing half-written is left.
    """
    names = {topic.name + HEADER if topic.stance is keys.Stance.PICTURE else topic.name: topic for topic in _topics()}
    tables: dict[str, Table] = {}
    rows = left_out = 0
    with new_folder(folder, "--csv") as beside, contextlib.ExitStack() as closing:
        for record in log.records(names):
            seen(record)
            if record.topic not in tables:
                name = record.topic.removesuffix(HEADER).replace("/", "_").removeprefix("@")
                table = Table(beside / f"{name}.csv", names[record.topic])
                tables[record.topic] = closing.enter_context(contextlib.closing(table))
            written = tables[record.topic].add(record)
            rows, left_out = rows + written, left_out + (not written)
    return f"{folder}: {len(tables)} tables, {rows} rows" + (f"; {left_out} messages are no JSON" if left_out else "")


def export_geojson(log: Log, path: Path, seen: OnRecord) -> str:
    """The estimated track and the fixes, as lines with times. Raises UserError where the file cannot be written."""
    tracks = _tracks(log, seen)
    features = [
        {
            "type": "Feature",
            "properties": {"name": name, "coordTimes": [_iso(point.at_us) for point in points]},
            "geometry": {
                "type": "LineString",
                "coordinates": [[point.longitude_deg, point.latitude_deg] for point in points],
            },
        }
        for name, points in tracks.items()
    ]
    data = msgspec.json.format(msgspec.json.encode({"type": "FeatureCollection", "features": features}), indent=1)
    return _write("--geojson", path, data, tracks)


def export_gpx(log: Log, path: Path, seen: OnRecord) -> str:
    """The same as GPX tracks. Raises UserError as `export_geojson`, and without gpxpy."""
    try:
        from gpxpy import gpx  # noqa: PLC0415  # only this export needs it
    except ImportError as error:
        raise UserError("--gpx needs gpxpy (pip install 'paani[host]')") from error
    tracks = _tracks(log, seen)
    document = gpx.GPX()
    document.creator = "paani"
    for name, points in tracks.items():
        segment = gpx.GPXTrackSegment(
            [gpx.GPXTrackPoint(p.latitude_deg, p.longitude_deg, time=_time(p.at_us)) for p in points]
        )
        track = gpx.GPXTrack(name=name)
        track.segments.append(segment)
        document.tracks.append(track)
    return _write("--gpx", path, document.to_xml().encode(), tracks)


def _tracks(log: Log, seen: OnRecord) -> dict[str, list[Point]]:
    """Points at least a second apart. Raises UserError where there is no position at all."""
    tracks: dict[str, list[Point]] = {}
    for record in log.records([keys.ODOMETRY.name, keys.GPS.name]):
        seen(record)
        found = _place(record)
        if found is not None:
            track = tracks.setdefault(ESTIMATE if record.topic == keys.ODOMETRY.name else GPS, [])
            if not track or found.at_us - track[-1].at_us >= EVERY_US:
                track.append(found)
    tracks = {name: points for name, points in tracks.items() if len(points) > 1}
    if not tracks:
        raise UserError(f"{log.path}: no track in it ({keys.ODOMETRY.name}, {keys.GPS.name})")
    return tracks


def _place(record: Record) -> Point | None:
    try:
        if record.topic == keys.GPS.name:
            fix = msgspec.json.decode(record.data, type=m.GpsFix)
            return Point(fix.source_us, fix.latitude_deg, fix.longitude_deg) if fix.fix else None
        pose = msgspec.json.decode(record.data, type=m.Odometry)
    except UNDECODABLE:
        return None
    known = (pose.latitude_deg, pose.longitude_deg) != (0.0, 0.0)  # zero where the origin is not known
    return Point(pose.source_us, pose.latitude_deg, pose.longitude_deg) if known else None


def _write(option: str, path: Path, data: bytes, tracks: dict[str, list[Point]]) -> str:
    write_whole(path, data, option)
    return f"{path}: " + ", ".join(f"{name} {len(points)} points" for name, points in tracks.items())


def _topics() -> tuple[keys.Topic[Any], ...]:
    return keys.every_topic()


def _columns(schema: dict[str, Any], path: str = "") -> Iterator[str]:
    for name, field in schema["properties"].items():
        if field["type"] == "object":
            yield from _columns(field, f"{path}{name}.")
        else:
            yield path + name


def _flat(fields: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{path}{name}.")
        else:
            yield path + name, msgspec.json.encode(value).decode() if isinstance(value, list) else value


def _time(at_us: int) -> datetime.datetime:
    return datetime.datetime.fromtimestamp(at_us * 1e-6, tz=datetime.UTC)


def _iso(at_us: int) -> str:
    return _time(at_us).isoformat(timespec="milliseconds").replace("+00:00", "Z")
