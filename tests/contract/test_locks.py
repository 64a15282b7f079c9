"""What an installation takes: every file by its hash, from no named place, and nothing that nobody asked for."""

from __future__ import annotations

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from paani.keys import PORTS
from tests.places import ROOT

LOCKS = sorted((ROOT / "requirements").glob("*.lock"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]


def pins(name: str) -> dict[str, str]:
    """Version of each package of a lock file. Fails for a package without hashes."""
    found: dict[str, str] = {}
    text = (ROOT / "requirements" / f"{name}.lock").read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        match = re.fullmatch(r"([\w.-]+)==(\S+)(?: ; [^#]+?)?((?:\s+--hash=sha256:[0-9a-f]{64})+)\s*", line)
        assert match, line[:100]
        assert match[1] not in found
        found[str(canonicalize_name(match[1]))] = match[2]
    return found


def asked_for(extra: str) -> list[Requirement]:
    """Requirements of an extra, those of the extras that it names among them."""
    found = []
    for line in EXTRAS[extra]:
        requirement = Requirement(line)
        inner = [one for name in requirement.extras for one in asked_for(name)]
        found += inner if requirement.name == "paani" else [requirement]
    return found


BASE = [Requirement(line) for line in PROJECT["project"]["dependencies"]]
ASKED = {
    "base": BASE,
    "host": [*BASE, *asked_for("host")],
    "ports": [*BASE, *(one for port in PORTS if port in EXTRAS for one in asked_for(port))],
    "dev": [*BASE, *asked_for("dev")],
    **{name: [Requirement(line) for line in lines] for name, lines in PROJECT["dependency-groups"].items()},
}


def test_there_is_a_lock_for_each_way_to_install() -> None:
    assert [path.stem for path in LOCKS] == sorted(ASKED)


@pytest.mark.parametrize("name", ASKED)
def test_a_lock_holds_what_is_asked_for(name: str) -> None:
    """`make lock` after a change of pyproject.toml."""
    taken = pins(name)
    for requirement in ASKED[name]:
        assert requirement.specifier.contains(taken[canonicalize_name(requirement.name)]), requirement


@pytest.mark.parametrize("name", ASKED)
def test_a_lock_names_no_place(name: str) -> None:
    """Whoever installs chooses the index; a hash says whether it gave the right file."""
    text = (ROOT / "requirements" / f"{name}.lock").read_text(encoding="utf-8")
    assert "://" not in text
    assert "--index" not in text
    assert "--find-links" not in text


def test_board_host_and_tests_take_the_same_versions() -> None:
    everything = pins("dev")
    assert pins("base").items() <= pins("host").items() <= everything.items()
    assert pins("base").items() <= pins("ports").items() <= everything.items()
    shared = pins("build").keys() & everything.keys()
    assert all(pins("build")[name] == everything[name] for name in shared)


def test_the_board_installs_nothing_of_the_extras() -> None:
    extras = {canonicalize_name(one.name) for extra in EXTRAS for one in asked_for(extra)}
    assert not extras & pins("base").keys()


def test_pytorch_stays_out() -> None:
    """Its build fits one machine: `make` takes the one that lies there."""
    assert "torch" not in pins("dev")
