"""The fleet's file: every vessel once, and a credential of the shore for each."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from paani.authority import ensure_credentials
from paani.config import BusConfig
from paani.errors import UserError
from paani_tools.fleet.command import main
from paani_tools.fleet.fleet_file import read_fleet

OTTER = """
[[vessels]]
name = "otter"
router = "tcp/10.0.0.2:7450"
credentials = "otter"
"""


@pytest.fixture(scope="module")
def otter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vessel's folder with its passwords, to be copied."""
    folder = tmp_path_factory.mktemp("otter")
    ensure_credentials(BusConfig(runtime_dir=str(folder)))
    return folder


@pytest.fixture
def fleet(tmp_path: Path, otter: Path) -> Path:
    shutil.copytree(otter, tmp_path / "otter")
    file = tmp_path / "fleet.toml"
    file.write_text(OTTER)
    return file


def test_a_vessel_is_joined_by_its_own_credential(fleet: Path) -> None:
    (bus,) = read_fleet(fleet)
    assert (bus.vessel, bus.router, bus.runtime_dir) == ("otter", "tcp/10.0.0.2:7450", str(fleet.parent / "otter"))


def test_the_file_may_begin_with_a_byte_order_mark(fleet: Path) -> None:
    fleet.write_text(OTTER, encoding="utf-8-sig")
    assert len(read_fleet(fleet)) == 1


@pytest.mark.parametrize("act", [["--list"], ["--stop-all"]])
def test_a_port_is_of_the_page_alone(act: list[str], fleet: Path) -> None:
    with pytest.raises(UserError, match=r"^--port: is of the page"):
        main([str(fleet), "--port", "1", *act])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (OTTER * 2, "vessel otter: there twice"),
        (OTTER + OTTER.replace('"otter"', '"beaver"', 1), r"vessel beaver: router tcp/10.0.0.2:7450 is otter's"),
        (OTTER.replace("tcp/10.0.0.2:7450", "10.0.0.2"), r"vessel otter: router 10.0.0.2: expected tcp/HOST:PORT"),
        (OTTER.replace('credentials = "otter"', ""), "vessel otter: expected credentials or certificates"),
        (OTTER + 'certificates = "x"', "vessel otter: expected credentials or certificates"),
        (OTTER.replace('credentials = "otter"', 'credentials = "none"'), "vessel otter: .*none: no such folder"),
        (OTTER + 'graph = "hull"', r"vessel otter: .*credentials_hull/shore: No such"),
        (OTTER.replace("credentials", "certificates"), r"vessel otter: .*identities.json: No such"),
        (OTTER.replace('"otter"', '"Otter 1"', 1), r"name|matching"),
        (OTTER + "colour = 3", "colour"),
        ("", "vessels"),
        ("vessels = []", "vessels"),
        ("[", r"fleet\.toml"),
    ],
)
def test_a_mistake_is_told_by_file_and_vessel(fleet: Path, text: str, message: str) -> None:
    fleet.write_text(text)
    with pytest.raises(UserError, match=message) as caught:
        read_fleet(fleet)
    assert str(caught.value).startswith(str(fleet))
    assert "\n" not in str(caught.value)


def test_a_file_or_a_vessel_that_is_not_there(fleet: Path) -> None:
    with pytest.raises(UserError, match=r"nowhere\.toml: no such file"):
        main([str(fleet.with_name("nowhere.toml"))])
    with pytest.raises(UserError, match=r"--stop beaver: no such vessel in .*\(have: otter\)"):
        main([str(fleet), "--stop", "otter", "beaver"])
