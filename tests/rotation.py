"""Tests that take long and prove no statement of `claims.toml` take turns: a run has one part of them.

`@pytest.mark.rotating(cpu_s=30)` marks such a test, with the processor time [s] that all its cases take together.
`--parts 6` shares them out to six parts of about the same time and runs the one that the commit draws, so that each
has its turn as commits come; the others skip and say so.
"""

import shutil
import subprocess
from collections.abc import Mapping

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--parts", type=int, default=1, metavar="N", help="of the rotating tests, run one part of N")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--parts") < 1:
        raise pytest.UsageError("--parts: not 1 or more")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    marks = {item: mark for item in items if (mark := item.get_closest_marker("rotating"))}
    count = config.getoption("--parts")
    parts = share_out({_function(item): float(mark.kwargs["cpu_s"]) for item, mark in marks.items()}, count)
    drawn = draw(_commit(config), count)
    for item in marks:
        if parts[_function(item)] != drawn:
            reason = f"takes turns: not in part {drawn + 1} of {count}, which this commit draws (`make test PARTS=1`)"
            item.add_marker(pytest.mark.skip(reason=reason))


def share_out(cpu_s: Mapping[str, float], count: int) -> dict[str, int]:
    """The part, from 0, of each test: the longest first, each to the part that has the least so far."""
    loads_s = [0.0] * count
    parts = {}
    for name in sorted(cpu_s, key=lambda name: (-cpu_s[name], name)):
        parts[name] = loads_s.index(min(loads_s))
        loads_s[parts[name]] += cpu_s[name]
    return parts


def draw(commit: str, count: int) -> int:
    """The part, from 0, that a commit's hash draws; the first for a tree without a commit."""
    return int(commit or "0", 16) % count


def _function(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[0]


def _commit(config: pytest.Config) -> str:
    git = shutil.which("git")
    if git is None:
        return ""
    asked = subprocess.run([git, "rev-parse", "HEAD"], cwd=config.rootpath, capture_output=True, text=True, check=False)
    return asked.stdout.strip() if asked.returncode == 0 else ""
