"""Files that anybody may have written: settings, routes, missions, fences, scenarios, vessels, certificates."""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from paani.certificates import INDEX_FILE, Certificate, Identities, date_text, read_identities
from paani.config import Config, decode_config, encode_config, load_config
from paani.errors import UserError
from paani.keys import Graph
from paani_services.navigator.files.fence_file import load_fence
from paani_services.navigator.files.mission_file import load_mission
from paani_services.navigator.files.mission_journal import JournalEntry, read_entry
from paani_services.navigator.files.route_file import encode_route, load_route, read_route
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.operator.latch import read_latch
from paani_sim.vessels import load_vessel
from paani_sim.worlds.load import load_scenario
from tests.fuzz.damage import damaged_bytes, damaged_text, damaged_tree, json_bytes, toml_bytes
from tests.fuzz.target import Target, refusal_of
from tests.places import ROOT

EXAMPLES = ROOT / "examples"
ORIGIN_DEG = (52.0, 4.0)
ROUTE = b'name = "pond"\n[origin]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n' + b"".join(
    f"[[waypoints]]\nx_m = {x}\ny_m = {y}\n".encode() for x, y in ((0, 0), (20, 0), (20, 10))
)
ROUTE_DEG = b'name = "pond"\nrepeat = false\n' + b"".join(
    f"[[waypoints]]\nlatitude_deg = {52 + n * 1e-4}\nlongitude_deg = 4.0\n".encode() for n in range(3)
)
MISSION = b"""name = "survey"
[home]
x_m = -2.0
y_m = 1.0
[[legs]]
do = "follow_route"
route = "r.toml"
reverse = true
laps = 2
speed_mps = 0.4
[[legs]]
do = "hold_station"
x_m = 20.0
y_m = 10.0
radius_m = 3.0
duration_s = 60.0
[[legs]]
do = "return_home"
[[legs]]
do = "stop"
"""
FEATURES = json.dumps(
    {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": "loop", "repeat": True},
                "geometry": {"type": "LineString", "coordinates": [[4.0, 52.0], [4.001, 52.0], [4.001, 52.001, 3.0]]},
            },
            {
                "type": "Feature",
                "properties": {"keep": "in", "name": "bay"},
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [
                        [[3.99, 51.99], [4.01, 51.99], [4.01, 52.01], [3.99, 52.01], [3.99, 51.99]],
                        [[4.0, 52.0], [4.0001, 52.0], [4.0001, 52.0001], [4.0, 52.0]],
                    ],
                },
            },
        ],
    }
).encode()
LINE = b'{"type": "LineString", "coordinates": [[4.0, 52.0], [4.001, 52.0], [4.001, 52.001]]}'
TRACK = b"""<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1" xmlns:e="urn:e"><metadata><name>m</name>
<time>2026-01-01T00:00:00Z</time><bounds minlat="1" minlon="2" maxlat="3" maxlon="4"/></metadata>
<wpt lat="52.0" lon="4.0"><ele>1.0</ele><time>2026-01-01T00:00:00Z</time><name>w</name><sym>s</sym></wpt>
<trk><name>t</name><number>1</number><trkseg><trkpt lat="52.0" lon="4.0"><ele>1</ele><time>2026-01-01T00:00:01Z</time>
<hdop>1.0</hdop><extensions><e:x>1</e:x></extensions></trkpt><trkpt lat="52.001" lon="4.001"><fix>3d</fix><sat>7</sat>
</trkpt></trkseg></trk></gpx>
"""


class FileTarget(Target):
    """A file of one kind, made by damage to whole ones: as text, as a tree, or as bytes."""

    suffix: ClassVar[str] = ".toml"
    seeds: ClassVar[Sequence[bytes]] = ()

    def payload(self) -> bytes:
        rng, seed = self.rng, self.rng.choice(self.seeds)
        choice = rng.random()
        if choice < 0.03:
            return rng.randbytes(rng.randrange(400))
        if choice < 0.45 and self.suffix in {".toml", ".json", ".geojson"}:
            tree = tomllib.loads(seed.decode()) if self.suffix == ".toml" else json.loads(seed)
            return (toml_bytes if self.suffix == ".toml" else json_bytes)(damaged_tree(tree, rng), rng)
        return (damaged_text if choice < 0.9 else damaged_bytes)(seed, rng, self.seeds)

    def take(self, data: bytes) -> str:
        path = self.folder / f"hostile{self.suffix}"
        path.write_bytes(data)
        try:
            self.read(path)
        except UserError as error:
            return refusal_of(error, path)
        return ""

    def read(self, path: Path) -> None:
        """As the product does, and what it does next with what it has read. Raises UserError."""
        raise NotImplementedError


class Settings(FileTarget):
    """A settings file, and what is made of it."""

    name, share = "settings (TOML)", 40

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        tree = _without_none(msgspec.to_builtins(Config()))
        self.seeds = (  # type: ignore[misc]  # one of them is made here
            toml_bytes(tree, random.Random(1)),
            (EXAMPLES / "careful.toml").read_bytes(),
            b'profile = "hull"\n[thrusters]\nline = "serial:/dev/ttyACM0@115200"\n[sensors.gps]\nline = "/dev/x"\n',
            b'profile = "paper"\n[perception]\ngate = {}\n[bus]\ndomain = 7\nrouter = "tcp/127.0.0.1:7447"\n',
        )

    def read(self, path: Path) -> None:
        decode_config(encode_config(load_config(file=path)))


class RecordedSettings(FileTarget):
    """Settings as JSON: a file, and as a recording or a parent process hands them over."""

    name, share, suffix = "settings (JSON)", 20, ".json"
    seeds = (encode_config(Config()), b'{"profile": "hull", "advisor": {"policy": {"center_block_risk": 0.4}}}')

    def read(self, path: Path) -> None:
        try:
            decode_config(path.read_bytes())
        except UserError as error:
            refusal_of(error)
        load_config(file=path)


class SettingTexts(FileTarget):
    """`--set section.field=value`, and the environment."""

    name, share, suffix = "settings (--set, environment)", 20, ""
    seeds = (
        b"advisor.policy.center_block_risk=0.4",
        b"bus.router=tcp/127.0.0.1:7447",
        b"localization.origin_lat_lon_deg=[52.0, 4.0]",
        b"plant={adapter={timeout_s=0.5}}",
        b"profile=hull",
    )

    def take(self, data: bytes) -> str:
        text = data.decode("utf-8", "surrogateescape")
        try:
            name, _, value = text.partition("=")
            load_config(environ={f"PAANI_{name.upper().replace('.', '__')}": value})
        except UserError as error:
            refusal_of(error)
        try:
            load_config(sets=(text,))
        except UserError as error:
            return refusal_of(error)
        return ""


class RouteToml(FileTarget):
    """A route of our own."""

    name, share = "route (TOML)", 30
    seeds = (ROUTE, ROUTE_DEG)

    def read(self, path: Path) -> None:
        load_route(path, ORIGIN_DEG)
        encode_route(read_route(path, str(path)), ".geojson", str(path))


class RouteGpx(FileTarget):
    """A route, track or waypoints of GPX."""

    name, share, suffix = "route (GPX)", 40, ".gpx"
    seeds = ((EXAMPLES / "bay.gpx").read_bytes(), TRACK)

    def read(self, path: Path) -> None:
        load_route(path, ORIGIN_DEG)
        encode_route(read_route(path, str(path)), ".toml", str(path))


class RouteGeoJson(FileTarget):
    """A route of GeoJSON."""

    name, share, suffix = "route (GeoJSON)", 30, ".geojson"
    seeds = (FEATURES, LINE)

    def read(self, path: Path) -> None:
        load_route(path, ORIGIN_DEG)
        encode_route(read_route(path, str(path)), ".gpx", str(path))


class MissionFile(FileTarget):
    """A mission, with a route beside it."""

    name, share = "mission", 30
    seeds = (MISSION, (EXAMPLES / "mission.toml").read_bytes())

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        (folder / "r.toml").write_bytes(ROUTE)
        (folder / "bay.gpx").write_bytes((EXAMPLES / "bay.gpx").read_bytes())

    def read(self, path: Path) -> None:
        load_mission(path, ORIGIN_DEG, None)


class FenceToml(FileTarget):
    """A fence of our own."""

    name, share = "fence (TOML)", 30
    seeds = ((EXAMPLES / "fence.toml").read_bytes(),)

    def read(self, path: Path) -> None:
        load_fence(path, ORIGIN_DEG)


class FenceGeoJson(FileTarget):
    """A fence of GeoJSON."""

    name, share, suffix = "fence (GeoJSON)", 30, ".geojson"
    seeds = (FEATURES,)

    def read(self, path: Path) -> None:
        load_fence(path, ORIGIN_DEG)


class ScenarioFile(FileTarget):
    """A scenario, as far as the world that it makes."""

    name, share = "scenario and world", 20
    seeds = (
        (EXAMPLES / "narrow_river.toml").read_bytes(),
        *(
            (ROOT / "sim_host/paani_sim/scenarios" / name).read_bytes()
            for name in ("lake_patrol.toml", "link_loss.toml")
        ),
        (ROOT / "sim_host/paani_sim/scenarios/harbour_crossing.toml").read_bytes(),
    )

    def read(self, path: Path) -> None:
        load_scenario(path)


class VesselFile(FileTarget):
    """A vessel."""

    name, share = "vessel", 20
    seeds = tuple((ROOT / f"sim_host/paani_sim/vessels/{name}.toml").read_bytes() for name in ("paper", "otter"))

    def read(self, path: Path) -> None:
        load_vessel(str(path))


class CertificatesIndex(FileTarget):
    """What is in force in a folder of certificates."""

    name, share, suffix = "certificates' index", 20, ".json"
    _holder = Certificate(number=1, sha256="0" * 64, not_before_s=1, not_after_s=2)
    seeds = (
        msgspec.json.encode(
            Identities(graph=Graph.HULL, addresses=("a",), authority=_holder, holders={"advisor": _holder})
        ),
    )

    def take(self, data: bytes) -> str:
        path = self.folder / INDEX_FILE
        path.write_bytes(data)
        try:
            identities = read_identities(self.folder)
            for certificate in (identities.authority, *identities.holders.values()):
                date_text(certificate.not_after_s)
        except UserError as error:
            return refusal_of(error, path)
        return ""


class Journals(FileTarget):
    """What a process finds of its last run: the mission's progress and the STOP latch. Neither has a refusal."""

    name, share, suffix = "journal and latch", 20, ".json"
    seeds = (msgspec.json.encode(JournalEntry(5, "0" * 64, MissionProgress())), b"clear\n", b'{"operator_epoch": 1}')

    def payload(self) -> bytes:
        return damaged_text(self.rng.choice(self.seeds), self.rng, self.seeds)

    def read(self, path: Path) -> None:
        read_latch(path)
        if read_entry(path) is None:
            raise UserError(f"{path}: begins anew")


def _without_none(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {key: _without_none(value) for key, value in tree.items() if value is not None}
    return tree


FILES: tuple[type[Target], ...] = (
    Settings, RecordedSettings, SettingTexts, RouteToml, RouteGpx, RouteGeoJson, MissionFile, FenceToml, FenceGeoJson,
    ScenarioFile, VesselFile, CertificatesIndex, Journals,
)  # fmt: skip
