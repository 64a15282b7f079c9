"""A copy of the checkout in a temporary folder, where a mutant may live: the checkout itself is never touched."""

from __future__ import annotations

import compileall
import contextlib
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.claims_check.table import TABLE, Mutant
from tests.places import DATA, PRODUCT

PACKAGES = (".", *PRODUCT)  # folders that Python looks into, before all others
LEFT_OUT = (".git", ".venv", "runs", "dist", "build", "__pycache__", ".*_cache", ".hypothesis", "*.egg-info")
FAILED = 1  # exit code of pytest when tests ran and some failed
MESSAGE_CHARS = 1000  # of why a test failed
STATES = {"skipped": "skipped", "failure": "failed", "error": "failed"}  # by the element of a report
MTIME_STEP_NS = 10_000_000_000  # a mutant is so much newer that no compiled file passes for it


class Tested(NamedTuple):
    """What a test function did: the worst of its cases (`passed`, `skipped` or `failed`), their time together [s].

    message: one line of why that case failed or skipped.
    """

    state: str = "passed"
    time_s: float = 0.0
    message: str = ""


class Outcome(NamedTuple):
    """Of one run of pytest: exit code (None: beyond the time limit), last lines, its tests by `file::function`."""

    exit_code: int | None
    tail: str
    tests: dict[str, Tested]


class Tree:
    """The copy at `root`. What runs in it imports the copy, in every process that it starts."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._env = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(str((root / folder).resolve()) for folder in PACKAGES),
            "PYTHONDONTWRITEBYTECODE": "1",  # a mutant leaves nothing behind
            "PAANI_DATA": str(DATA.resolve()),
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        }

    @contextlib.contextmanager
    def changed_by(self, mutant: Mutant) -> Iterator[None]:
        """The mutant lives inside the context; afterwards the file is as it was.

        What a compiler reads has the time of each change instead, so that `make` builds it anew.
        """
        path = self.root / mutant.file
        source, stat = path.read_bytes(), path.stat()
        is_python = path.suffix == ".py"
        path.write_bytes(source.replace(mutant.before.encode(), mutant.after.encode()))
        if is_python:
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns + MTIME_STEP_NS))
        try:
            yield
        finally:
            path.write_bytes(source)
            if is_python:
                os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    def run_tests(self, tests: list[str], limit_s: float, *options: str) -> Outcome:
        """Run these tests in a process of its own, and end it with all that it started beyond `limit_s`."""
        report = self.root / "claims-report.xml"
        report.unlink(missing_ok=True)
        words = [sys.executable, "-m", "pytest", "-q", "--tb=line", "-p", "no:cacheprovider", f"--junitxml={report}"]
        process = subprocess.Popen(
            [*words, *options, *tests],
            cwd=self.root,
            env=self._env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            text, _ = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            return Outcome(None, f"no end within {limit_s:.0f} s", {})
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            with process:  # closes its pipe and waits
                pass
        return Outcome(process.returncode, text.strip()[-2000:], _read_report(report))


@contextlib.contextmanager
def copied_tree(source: Path) -> Iterator[Tree]:
    """A copy of the checkout at `source`, gone after the context."""
    with tempfile.TemporaryDirectory(prefix="paani-claims-") as folder:
        root = Path(folder) / "paani"
        shutil.copytree(source, root, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=True)
        (root / "runs").mkdir(exist_ok=True)
        for package in PACKAGES[1:]:
            compileall.compile_dir(root / package, quiet=2)
        yield Tree(root)


def digest_of(root: Path) -> str:
    """SHA-256 of all that may decide a verdict: every file of the copy but the table, by path and content."""
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.is_file() and name != TABLE and "__pycache__" not in path.parts:
            digest.update(name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _read_report(report: Path) -> dict[str, Tested]:
    """What each test function did, by `file::function`; empty where no report was written."""
    if not report.is_file():
        return {}
    worst: dict[str, Tested] = {}
    for case in ET.parse(report).getroot().iter("testcase"):
        name = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name', '').partition('[')[0]}"
        before, now = worst.get(name, Tested()), _read_case(case)
        worst[name] = max(before, now, key=_severity)._replace(time_s=before.time_s + now.time_s)
    return worst


def _read_case(case: ET.Element) -> Tested:
    found = [
        Tested(STATES[child.tag], message=" ".join(child.get("message", "").split())[:MESSAGE_CHARS])
        for child in case
        if child.tag in STATES
    ]
    return max(found, key=_severity, default=Tested())._replace(time_s=float(case.get("time", "0")))


def _severity(tested: Tested) -> int:
    return ("passed", "skipped", "failed").index(tested.state)
