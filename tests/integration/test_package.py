"""Wheel and source distribution: the same bytes for the same files, and complete without the checkout."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

from paani.version import commit
from tests.places import PRODUCT, ROOT

pytestmark = pytest.mark.integration


def build(source: Path, out: Path, target: str) -> Path:
    """The file that hatchling makes of a source tree."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)]
    environment = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}
    subprocess.run(command, cwd=source, env=environment, capture_output=True, check=True)
    (file,) = out.glob("*.whl" if target == "wheel" else "*.tar.gz")
    return file


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("sdist"), "sdist")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("wheel"), "wheel")


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.rotating(cpu_s=10)
def test_two_builds_give_the_same_bytes_as_does_one_of_the_source_distribution(
    wheel: Path, sdist: Path, tmp_path: Path
) -> None:
    """The second has no git to ask: the commit came along."""
    assert digest(build(ROOT, tmp_path / "again", "sdist")) == digest(sdist)
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    assert digest(build(source, tmp_path / "of_source", "wheel")) == digest(wheel)


def test_a_wheel_holds_no_file_of_the_tests_and_every_one_that_runs(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {"paani/commit.txt", "paani_tools/claims/claims.toml", "paani_tools/doctor/host.lock"} < names
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    for top in PRODUCT:
        for name in tracked.splitlines():
            if name.startswith(f"{top}/paani"):
                assert name.removeprefix(f"{top}/") in names
    assert not [name for name in names if name.startswith("tests")]


@pytest.mark.rotating(cpu_s=30)
def test_a_wheel_works_without_the_checkout(wheel: Path, tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    """Version, help, weights, scenarios, statements and page; then a boat that drives by what was installed."""
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True)
    (site,) = home.glob("lib/python*/site-packages")
    # A path of a .pth file is searched for packages, and its own .pth files, as the checkout's, are not read.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python"), "install", "-q", "--no-deps"]
    subprocess.run([*pip, "--no-index", "--force-reinstall", str(wheel)], check=True, capture_output=True)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}

    def run(*words: str) -> str:
        command = [str(home / "bin" / words[0]), *words[1:]]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=90, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert run("paani", "--version") == f"paani 0.1.0 (commit {commit()})\n"
    assert "--headless" in run("paani", "up", "--help")
    assert "segmenter" in run("paani", "models", "check")
    assert "harbour" in run("paani", "world", "list")
    assert "J7" in run("paani", "claims", "J7")
    where = "import paani; from paani_services.dashboard.pages import load_static_files; "
    place, pages = run("python", "-c", f"{where}print(paani.__file__, len(load_static_files()))").split()
    assert place.startswith(str(home))
    assert int(pages) > 5
    sets = [word for setting in private_sets for word in ("--set", setting)]
    assert "collisions" in run("paani", "up", "--for", "3", *sets)
