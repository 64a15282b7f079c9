"""Versions of what is installed, models, and off-screen OpenGL."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import files
from pathlib import Path

from paani.config import Config
from paani.errors import UserError
from paani.extras import require_modules
from paani.version import version_text
from paani_services.perception.engine import OnnxEngine, check_onnxruntime, load_network
from paani_services.perception.fitness import uses_fitness
from paani_tools.doctor.finding import Verdict, failed, passed, warned
from paani_tools.up.plan import EYE, NEEDED

LOCK = "host.lock"
LOCK_IN_CHECKOUT = Path(__file__).parents[3] / "requirements" / LOCK
NAME = re.compile(r"[A-Za-z0-9._-]+")
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^ ;\\]+)", re.MULTILINE)
GL_PROBE = "from paani_sim.eye.gl import Context; context = Context(); print(context.renderer); context.close()"
GL_LIMIT_S = 30.0  # a driver that hangs; software rendering takes a second on a slow board


def check_versions(config: Config) -> Iterator[Verdict]:
    """Python, the packages that every part needs, those that these settings need, and what differs from the tests'."""
    yield passed(f"{version_text()}, Python {sys.version.split()[0]}")
    needed = [NAME.match(line) for line in requires("paani") or () if "extra ==" not in line]
    names = [match[0] for match in needed if match]
    missing = [name for name in names if _installed(name) is None]
    if missing:
        yield failed(f"not installed: {', '.join(missing)}", "pip install --require-hashes -r requirements/base.lock")
    require_modules("up", *(module for name in config.services for module in NEEDED.get(name, ())))
    if release := _installed("onnxruntime"):
        check_onnxruntime(release)
    yield from _compare_pins(read_pins())


def read_pins() -> Mapping[str, str]:
    """Version of each package with which the host was tested. Raises UserError where the lock file cannot be read."""
    shipped = files("paani_tools.doctor") / LOCK
    source = shipped if shipped.is_file() else LOCK_IN_CHECKOUT
    try:
        return dict(PIN.findall(source.read_text(encoding="utf-8")))
    except OSError as error:
        raise UserError(f"{source}: {error.strerror}") from error


def _compare_pins(pins: Mapping[str, str]) -> Iterator[Verdict]:
    found = {name: release for name in pins if (release := _installed(name)) is not None}
    others = [f"{name} {found[name]} (tested: {pins[name]})" for name in found if found[name] != pins[name]]
    if others:
        yield warned(", ".join(others), "pip install --require-hashes -r requirements/host.lock (base.lock: a board)")
    else:
        yield passed(f"{len(found)} packages in the versions of {LOCK}")


def _installed(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def check_models(config: Config) -> Iterator[Verdict]:
    """Loads each model that these settings use, which compares its checksum or its shapes."""
    settings = config.perception
    wanted = [("detector", settings.detector)]
    if settings.segmenter != "none":
        wanted.append(("segmenter", settings.segmenter))
    if uses_fitness(settings):
        wanted.append(("gate", settings.image_quality.model))
    for role, path in wanted:
        try:
            engine = OnnxEngine.load(role, path, 1) if role == "gate" else load_network(role, settings, 1)
            yield passed(engine.info())
        except UserError as error:
            remedy = f"see `paani models check {path}`" if path else "install paani again: its files are damaged"
            yield failed(str(error), remedy)


def check_gl(config: Config) -> Iterator[Verdict]:
    """Off-screen OpenGL, tried in a process of its own: a broken driver may end it."""
    if EYE not in config.services:
        yield passed("not needed: no simulated camera here")
        return
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    remedy = "install the Debian packages libegl1 libopengl0 libgl1 libgl1-mesa-dri"
    try:
        done = subprocess.run(
            [sys.executable, "-c", GL_PROBE],
            env=environment,
            capture_output=True,
            text=True,
            timeout=GL_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        yield failed(f"the OpenGL driver does not answer within {GL_LIMIT_S:.0f} s", remedy)
        return
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"the process ended with {done.returncode}"])[-1]
        yield failed(last.removeprefix("paani.errors.UserError: "), remedy)
    else:
        yield passed(f"off-screen OpenGL by {done.stdout.strip()}")
