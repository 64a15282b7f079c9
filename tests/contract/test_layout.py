"""The house rules that a machine can check."""

from __future__ import annotations

import ast
import hashlib
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import pytest

from examples.draw_pictures import VIEWS
from tests.places import PRODUCT, ROOT

NAMELESS = {"utils", "helpers", "common", "misc", "base", "manager", "types"}
MAX_LINES, MAX_SERVICE_LINES = 400, 150


def ignored_patterns() -> list[str]:
    """The patterns of .gitignore that are one name, applied at every depth."""
    lines = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    return [".git", *(line.strip("/") for line in lines if "/" not in line.strip("/"))]


def walk_files(folder: Path, ignored: list[str]) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if not any(fnmatch(path.name, pattern) for pattern in ignored):
            yield from walk_files(path, ignored) if path.is_dir() else [path]


def tracked(*suffixes: str) -> list[Path]:
    """The files that git knows or would add; in a copy without git, all that .gitignore does not name."""
    listing = None
    if shutil.which("git"):
        command = ["git", "ls-files", "-co", "--exclude-standard"]
        listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listing is None or listing.returncode != 0:
        paths = list(walk_files(ROOT, ignored_patterns()))
    else:
        paths = [ROOT / name for name in listing.stdout.splitlines()]
    return [path for path in paths if path.name.endswith(suffixes) and path.exists()]


SOURCES = tracked(".py", ".js")


def test_a_copy_without_git_is_checked_as_well() -> None:
    assert set(SOURCES) <= set(walk_files(ROOT, ignored_patterns()))


def test_one_file_one_job() -> None:
    assert [str(path) for path in SOURCES if path.stem in NAMELESS] == []
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    limits = {path: MAX_SERVICE_LINES if path.name == "service.py" else MAX_LINES for path in SOURCES}
    assert {str(path): count for path, count in lines.items() if count > limits[path]} == {}


@pytest.mark.parametrize(
    ("word", "allowed"),
    [
        ("import zenoh", "shared/paani/bus/"),
        (
            "import onnxruntime",
            "services/paani_services/perception/engine.py models/paani_models/engines/onnx_runner.py",
        ),
        ("ncnn.Net(", "models/paani_models/engines/ncnn_runner.py"),
        ("import mujoco", "sim_host/paani_sim/"),
        ("import filterpy", "services/paani_services/localization/"),
        ("from filterpy", "services/paani_services/localization/"),
        ("from aiohttp", "services/paani_services/dashboard/ services/paani_tools/fleet/page.py"),
        ("import serial", "shared/paani/serial_port.py"),
        ("from pynmeagps", "services/paani_services/sensors/"),
        ("from pyubx2", "services/paani_services/sensors/"),
        ("from mcap", "shared/paani/logs/"),
        ("from rosbags", "services/paani_services/ros2/"),
        ("from cryptography", "services/paani_tools/certs/"),
        ("from distributed", "shared/paani/cluster.py"),
        ("from prometheus_client", "services/paani_services/dashboard/metrics.py"),
        (
            "from pymavlink",
            "services/paani_services/mavlink/codec.py services/paani_services/thrusters/autopilot_frames.py",
        ),
        ("import rerun", "services/paani_tools/logs/rerun_view.py"),
        ("import foxglove", "services/paani_services/foxglove/server.py"),
        ("import gpxpy", "services/paani_services/navigator/files/gpx.py"),
        ("MsgspecError", "shared/paani/undecodable.py"),  # what decoders raise has one list
        ("msgspec.ValidationError", "shared/paani/bus/admission.py"),
    ],
)
def test_each_library_has_one_importer(word: str, allowed: str) -> None:
    for path in SOURCES:
        name = str(path.relative_to(ROOT))
        if path.suffix == ".py" and not name.startswith("tests/") and word in path.read_text(encoding="utf-8"):
            assert any(name.startswith(place) for place in allowed.split()), name


def test_no_picture_of_the_data_ships() -> None:
    """Those of the manual and the page's icon apart, every picture is one that the simulator draws."""
    found = {str(p.relative_to(ROOT)) for p in tracked(".jpg", ".jpeg", ".png", ".gif", ".mp4")}
    drawn = {f"examples/pictures/{name}.jpg" for name in VIEWS}
    icons = {f"services/paani_services/dashboard/static/icon-{size}.png" for size in (192, 512)}
    assert {name for name in found if not name.startswith("docs/")} == drawn | icons


def test_every_top_level_folder_explains_itself() -> None:
    for folder in (*PRODUCT, "mcu", "deploy", "examples", "tests"):
        assert (ROOT / folder / "README.md").is_file(), folder


NAMESPACES = r"http://www\.(w3\.org/(2000/svg|1999/xhtml|1998/Math/MathML)|topografix\.com/GPX/1/1)(?=[\"'])"


def test_served_files_name_no_other_host() -> None:
    folders = (ROOT / "services/paani_services/dashboard/static", ROOT / "services/paani_tools/fleet/static")
    for path in (path for folder in folders for path in folder.rglob("*")):
        if path.suffix in {".js", ".mjs", ".html", ".css"}:
            text = path.read_text(encoding="utf-8")
            text = re.sub(NAMESPACES, "", text)
            text = re.sub(r"\A/\*!.*?\*/", "", text)  # where a vendored library comes from
            assert "http://" not in text, path
            assert "https://" not in text, path
            assert not re.search(r"""(?:src|href|action)\s*=\s*["']//|url\(["']?//|["']//[\w.-]+\.\w{2,}/""", text), (
                path
            )


@pytest.mark.parametrize("folder", ["uplot", "preact"])
def test_a_vendored_library_is_the_one_that_its_readme_names(folder: str) -> None:
    place = ROOT / "services/paani_services/dashboard/static" / folder
    readme = (place / "README.md").read_text(encoding="utf-8")
    for path in place.iterdir():
        if path.suffix in {".js", ".mjs", ".css"}:
            assert f"| {hashlib.sha256(path.read_bytes()).hexdigest()} |" in readme, path.name
    licences = "".join(path.read_text(encoding="utf-8") for path in sorted(place.glob("LICENSE*")))
    assert readme.count("| `") == len([path for path in place.iterdir() if path.suffix in {".js", ".mjs", ".css"}])
    assert all(name in licences for name in re.findall(r"MIT|Apache", readme))


# Pronouns, participles and metaphors that have a name in the field: trajectories, set-point, observation, inputs, ...
NO_NAMES = frozenset(
    [
        "Ways",
        "Wish",
        "Tried",
        "Room",
        "Pilot",
        "Crab",
        "Heard",
        "Told",
        "Said",
        "Felt",
        "Shown",
        "Tap",
        "Along",
        "Standing",
        "Mover",
        "Movers",
        "Sight",
        "ways",
        "wish",
        "tried",
        "pilot",
        "crab",
        "told",
        "said",
        "shown",
        "steered",
        "looked",
        "strayed",
        "led",
        "kinship",
        "heed",
        "mover",
        "movers",
        "sight",
        "sights",
        "spare_m",
        "footprint_m",
        "comes_near",
    ]
)


def test_names_are_nouns_and_verbs_of_the_field() -> None:
    found = []
    word = re.compile(rf"\b_*(?:{'|'.join(NO_NAMES)})\b")  # most files have none of them anywhere: not to be parsed
    texts = ((path, path.read_text(encoding="utf-8")) for path in SOURCES if path.suffix == ".py")
    for path, text in ((path, text) for path, text in texts if word.search(text)):
        for node in ast.walk(ast.parse(text)):
            match node:
                case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                    pass
                case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()):
                    pass
                case _:
                    continue
            if name.lstrip("_") in NO_NAMES:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}: {name}")
    assert found == []


def test_the_contract_takes_no_numpy() -> None:
    """Every process imports the bus; 12 MiB in each of them are for those alone that compute with arrays."""
    code = "import sys, paani.bus, paani.decider; raise SystemExit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


def test_a_path_on_the_command_line_is_judged_before_any_work() -> None:
    """`paani.option_paths` has a kind of path for each use; a bare one fails late, and in words of Python."""
    products = [path for path in SOURCES if path.suffix == ".py" and path.relative_to(ROOT).parts[0] in PRODUCT]
    assert [str(p) for p in products if re.search(r"\btype=(pathlib\.)?Path\b", p.read_text(encoding="utf-8"))] == []
