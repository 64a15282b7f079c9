"""Recordings that were damaged or forged, and what the commands that read them make of it."""

from __future__ import annotations

import contextlib
import io
import json
import random
from pathlib import Path

from mcap.writer import Writer

from paani import keys
from paani.config import Config, encode_config
from paani.errors import UserError
from paani.logs.reader import open_log
from paani.logs.repair import is_finished, repair
from paani_tools.bench.faults.hostile import hostile_topics
from paani_tools.calibrate.gather import collect_recorded
from paani_tools.calibrate.hull.drive import read_drive
from paani_tools.explain.moment import last_change_us, moment_at
from paani_tools.logs.export import export_csv, export_geojson, export_gpx
from paani_tools.logs.info import info_of, info_text
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.verify import check_log
from tests.fuzz.damage import damaged_bytes, damaged_text
from tests.fuzz.target import ContractError, Target, refusal_of
from tests.unit.paani.logs.small_logs import finished, unfinished

START_US = 1_700_000_000_000_000
STEP_US = 100_000


class DamagedRecording(Target):
    """The file itself: read whole, described, and repaired."""

    name, share = "recording (MCAP)", 8

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        seeds = []
        for make, name in ((finished, "20231114T221320Z-1.mcap"), (unfinished, "20231114T221320Z-2.mcap")):
            path = make(folder, 20, 5, name)
            seeds.append(path.read_bytes())
            path.unlink()
        self._seeds = tuple(seeds)

    def payload(self) -> bytes:
        seed = self.rng.choice(self._seeds)
        return (
            seed[: self.rng.randrange(len(seed))]
            if self.rng.random() < 0.1
            else damaged_bytes(seed, self.rng, self._seeds)
        )

    def take(self, data: bytes) -> str:
        path = self.folder / "hostile.mcap"
        path.write_bytes(data)
        try:
            _read(path)
            damaged = ""
        except UserError as error:
            damaged = refusal_of(error, path)
        try:
            if repair(path).changed and not is_finished(path):
                raise ContractError("repaired, and not finished")
            if problems := open_log(path).problems:
                raise ContractError(f"repaired, and {problems}")
        except UserError as error:
            refusal_of(error, path)
        finally:
            path.with_name(path.name + ".damaged").unlink(missing_ok=True)
        return damaged


class ForgedRecording(Target):
    """A whole file, with hostile messages, settings and versions in it: through every command that reads one."""

    name, share = "recording of hostile messages", 3

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._hostile = hostile_topics(keys.Graph.SIMULATION, 43, rng)
        self._settings = encode_config(Config())

    def payload(self) -> bytes:
        rng, stream = self.rng, io.BytesIO()
        writer = Writer(stream, chunk_size=1 << 16)
        writer.start(profile="paani", library="fuzz")
        attached = {
            "config.json": self._settings,
            "versions.json": b'{"paani": "0.1.0"}',
            "models.json": b'{"models": []}',
        }
        for name, data in attached.items():
            inside = damaged_text(data, rng) if rng.random() < 0.2 else data
            writer.add_attachment(START_US * 1000, START_US * 1000, name, "application/json", inside)
        writer.add_metadata("recorder", {"x": rng.choice(("written=9 dropped=1", "dropped=99999999999999999999", ""))})
        channels: dict[str, int] = {}
        names = rng.sample(list(self._hostile), 4) + [topic.name for topic in (keys.ADVISORY, keys.ODOMETRY, keys.GPS)]
        names += [keys.STEPS[service].name for service in keys.DECIDING_SERVICES] + [keys.EVIDENCE.name]
        for number in range(30):
            name, now_us = rng.choice(names), START_US + number * STEP_US
            if name not in channels:
                schema = writer.register_schema("x", "jsonschema", b"{}")
                channels[name] = writer.register_channel(name, "json", schema)
            made = self._hostile[name]
            data = json.dumps(made.valid(now_us)).encode() if rng.random() < 0.5 else made.next(now_us).data
            writer.add_message(channels[name], now_us * 1000, data[:200_000], now_us * 1000, number)
        writer.finish()
        return stream.getvalue()

    def take(self, data: bytes) -> str:
        path = self.folder / "hostile.mcap"
        path.write_bytes(data)
        try:
            _read(path)
        except UserError as error:
            return refusal_of(error, path)
        log = open_log(path)
        for name in ("track.geojson", "track.gpx"):
            (self.folder / name).unlink(missing_ok=True)
        causes = []
        for read in (
            lambda: export_csv(log, _new(self.folder / "tables"), _ignore),
            lambda: export_geojson(log, self.folder / "track.geojson", _ignore),
            lambda: export_gpx(log, self.folder / "track.gpx", _ignore),
            lambda: moment_at(log, last_change_us(log)),
            lambda: collect_recorded(path),
            lambda: read_drive(path),
            lambda: provenance_of(log, force=True),
            lambda: check_log(log, log.config()),
        ):
            try:
                with contextlib.redirect_stderr(io.StringIO()):
                    read()
            except UserError as error:
                causes.append(refusal_of(error))
        return causes[0] if len(causes) == 8 else ""


def _read(path: Path) -> None:
    log = open_log(path)
    info_text(info_of(log))
    for _ in log.records(start_us=log.start_us + 1, end_us=log.end_us):
        pass
    log.config()


def _new(folder: Path) -> Path:
    for path in folder.glob("*"):
        path.unlink()
    if folder.exists():
        folder.rmdir()
    return folder


def _ignore(record: object) -> None:
    pass


RECORDINGS: tuple[type[Target], ...] = (DamagedRecording, ForgedRecording)
