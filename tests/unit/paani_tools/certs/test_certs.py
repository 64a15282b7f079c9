"""`paani certs`: a folder that is whole, private and never older than it says."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from paani import authority
from paani.certificates import (
    AUTHORITY,
    BOARD_ROUTER,
    INDEX_FILE,
    LISTENERS,
    PAGE,
    client_settings,
    page_server_tls,
    read_identities,
    require_certificates,
)
from paani.clock import WallClock
from paani.config import BusConfig
from paani.errors import UserError
from paani.keys import Graph
from paani_tools.certs import folder as certificates
from paani_tools.certs.command import main

NOW_US = WallClock().now_us()
DAY_US = 86_400_000_000


def made(tmp_path: Path, graph: Graph = Graph.SIMULATION, now_us: int = NOW_US, days: int = 30) -> Path:
    folder = tmp_path / "certs"
    certificates.make(folder, graph, ("192.168.7.2", "boat.local"), now_us, days)
    return folder


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[Graph, Path]:
    """A folder of certificates for each graph, to be copied: making one waits for the disk a hundred times."""
    return {graph: made(tmp_path_factory.mktemp(graph), graph) for graph in (Graph.SIMULATION, Graph.HULL)}


@pytest.fixture
def folder(tmp_path: Path, originals: dict[Graph, Path], request: pytest.FixtureRequest) -> Path:
    """A copy of a graph's own, the simulation's unless a test asks for another; what it holds is as it was made."""
    return Path(shutil.copytree(originals[getattr(request, "param", Graph.SIMULATION)], tmp_path / "certs"))


HULL = pytest.mark.parametrize("folder", [Graph.HULL], indirect=True)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("graph", Graph)
@pytest.mark.slow
def test_every_identity_has_a_private_key_and_nobody_else_may_read_it(tmp_path: Path, graph: Graph) -> None:
    folder = made(tmp_path, graph)
    names = (AUTHORITY, *authority.users_in(graph), *LISTENERS)
    assert set(contents(folder)) == {INDEX_FILE, *(f"{name}.1.{end}" for name in names for end in ("key", "pem"))}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}
    bus = BusConfig(certificates=str(folder), graph=graph)
    assert require_certificates(bus, names[1:]).graph is graph


@pytest.mark.slow
def test_an_independent_program_verifies_what_was_signed(folder: Path) -> None:
    """A listener at the addresses that were given; a client cannot pass for one."""
    base = ["openssl", "verify", "-x509_strict", "-CAfile", str(folder / "authority.1.pem")]

    def verify(name: str, *words: str) -> int:
        command = [*base, *words, str(folder / f"{name}.1.pem")]
        return subprocess.run(command, capture_output=True, check=False).returncode

    assert verify(BOARD_ROUTER, "-purpose", "sslserver", "-verify_ip", "192.168.7.2") == 0
    assert verify(BOARD_ROUTER, "-purpose", "sslserver", "-verify_hostname", "boat.local") == 0
    assert verify(BOARD_ROUTER, "-purpose", "sslserver", "-verify_ip", "192.168.7.3") != 0
    assert verify("controller", "-purpose", "sslclient") == 0
    assert verify("controller", "-purpose", "sslserver") != 0


@pytest.mark.slow
def test_rotating_one_leaves_the_others(folder: Path) -> None:
    before = contents(folder)
    certificates.rotate(folder, "advisor", NOW_US, 30)
    after = contents(folder)
    assert before.keys() - after.keys() == {"advisor.1.key", "advisor.1.pem"}
    assert after.keys() - before.keys() == {"advisor.2.key", "advisor.2.pem"}
    assert {name for name in before.keys() & after.keys() if before[name] != after[name]} == {INDEX_FILE}


def forget(folder: Path, *names: str) -> None:
    """As a folder is that was made before there were such identities."""
    known = read_identities(folder)
    kept = {name: holder for name, holder in known.holders.items() if name not in names}
    (folder / INDEX_FILE).write_bytes(msgspec.json.encode(replace(known, holders=kept)))
    for path in (path for name in names for path in folder.glob(f"{name}.*")):
        path.unlink()


@HULL
@pytest.mark.slow
def test_what_an_older_folder_lacks_is_told_and_made_without_changing_the_others(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    certificates.revoke(folder, "advisor")
    forget(folder, "button", PAGE)
    bus, before = BusConfig(certificates=str(folder), graph=Graph.HULL), contents(folder)
    with pytest.raises(UserError, match=r"button has no certificate \(`paani certs complete`"):
        client_settings(bus, "button")
    assert main(["show", "--folder", str(folder)]) == 1
    assert "button             MISSING: `paani certs complete --folder " in capsys.readouterr().out
    assert main(["complete", "--folder", str(folder)]) == 0
    assert capsys.readouterr().out.startswith("button, page: made; ")
    after = contents(folder)
    assert after.keys() - before.keys() == {f"{name}.1.{end}" for name in ("button", PAGE) for end in ("key", "pem")}
    assert {name for name in before if before[name] != after[name]} == {INDEX_FILE}
    assert client_settings(bus, "button")
    page_server_tls(bus)
    assert main(["show", "--folder", str(folder)]) == 0
    assert "advisor.1          REVOKED" in capsys.readouterr().out
    assert main(["complete", "--folder", str(folder)]) == 0
    assert contents(folder) == after
    assert capsys.readouterr().out == f"{folder}: none is missing\n"


@HULL
@pytest.mark.slow
def test_nothing_is_made_where_the_authority_has_no_key(folder: Path) -> None:
    forget(folder, "button")
    (folder / "authority.1.key").unlink()
    before = contents(folder)
    with pytest.raises(UserError, match="certificates are made where the authority's key is"):
        main(["complete", "--folder", str(folder)])
    assert contents(folder) == before


@pytest.mark.slow
def test_a_revoked_identity_has_no_rights_until_it_gets_new_ones(folder: Path) -> None:
    bus = BusConfig(certificates=str(folder))

    def subjects() -> str:
        return str(authority.access_control(bus)["subjects"])

    assert "'advisor.1'" in subjects()
    certificates.revoke(folder, "advisor")
    assert "advisor" not in subjects()
    assert not list(folder.glob("advisor.*"))
    with pytest.raises(UserError, match="advisor: revoked already"):
        certificates.revoke(folder, "advisor")
    certificates.rotate(folder, "all", NOW_US, 30)
    assert "advisor" not in subjects()
    certificates.rotate(folder, "advisor", NOW_US, 30)
    assert "'advisor.2'" in subjects()
    assert "'controller.2'" in subjects()


@pytest.mark.slow
def test_what_cannot_be_written_changes_nothing(folder: Path) -> None:
    (folder / f".{INDEX_FILE}.{os.getpid()}").mkdir()
    before = {path.name for path in folder.iterdir()}
    for name in ("controller", "all"):
        with pytest.raises(UserError, match="--folder"):
            certificates.rotate(folder, name, NOW_US, 30)
        assert {path.name for path in folder.iterdir()} == before
    require_certificates(BusConfig(certificates=str(folder)), authority.users_in(Graph.SIMULATION))


@pytest.mark.slow
def test_a_folder_is_made_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"--address '-no way-'"):
        certificates.make(tmp_path / "certs", Graph.HULL, ("-no way-",), NOW_US, 30)
    assert list(tmp_path.iterdir()) == []
    folder = made(tmp_path)
    before = contents(folder)
    with pytest.raises(UserError, match="already exists"):
        made(tmp_path)
    assert contents(folder) == before


@pytest.mark.parametrize(("shift_days", "says"), [(-40, "expired 20"), (+40, "not valid before 20")])
@pytest.mark.slow
def test_out_of_date_is_told_with_file_and_date(tmp_path: Path, shift_days: int, says: str) -> None:
    folder = made(tmp_path, now_us=NOW_US + shift_days * DAY_US)
    certificates.rotate(folder, "all", NOW_US, 30)
    index = read_identities(folder)
    require_certificates(BusConfig(certificates=str(folder)), index.holders)
    certificates.rotate(folder, "controller", NOW_US + shift_days * DAY_US, 30)
    bus = BusConfig(certificates=str(folder))
    require_certificates(bus, ("advisor",))
    with pytest.raises(UserError, match=rf"certs/controller\.3\.pem: {says}\d\d-\d\d-\d\d"):
        require_certificates(bus, ("advisor", "controller"))
    assert main(["show", "--folder", str(folder)]) == 1


@pytest.mark.slow
def test_what_is_not_in_force_or_not_private_is_told(folder: Path) -> None:
    bus = BusConfig(certificates=str(folder))
    (folder / "advisor.1.key").chmod(0o640)
    with pytest.raises(UserError, match=r"advisor\.1\.key: others may read it"):
        require_certificates(bus, ("advisor",))
    (folder / "camera.1.pem").write_bytes((folder / "controller.1.pem").read_bytes())
    with pytest.raises(UserError, match=r"camera\.1\.pem: not the certificate that identities\.json names"):
        require_certificates(bus, ("camera",))
    (folder / "eye.1.pem").write_text("nonsense")
    with pytest.raises(UserError, match=r"eye\.1\.pem: no certificate in PEM"):
        require_certificates(bus, ("eye",))
    (folder / "plant.1.key").unlink()
    with pytest.raises(UserError, match=r"plant\.1\.key: No such file"):
        require_certificates(bus, ("plant",))
    with pytest.raises(UserError, match="made for the graph simulation, not for hull"):
        require_certificates(BusConfig(certificates=str(folder), graph=Graph.HULL), ())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["rotate", "board_router"], "board_router: clients know a router by its authority"),
        (["revoke", "host_router"], "host_router: clients know a router by its authority"),
        (["revoke", "pirate"], "pirate: no identity of the graph simulation"),
        (["rotate", "../advisor"], "../advisor: no identity of the graph simulation"),
        (["rotate", "thrusters"], "thrusters: no identity of the graph simulation"),
    ],
)
def test_mistakes_are_one_line(folder: Path, words: list[str], says: str) -> None:
    before = contents(folder)
    with pytest.raises(UserError, match=says):
        main([*words, "--folder", str(folder)])
    assert contents(folder) == before


@pytest.mark.parametrize("damage", [b"", b"{}", b'{"graph": 3}', b"\xff\xfe"])
def test_a_damaged_index_is_told(folder: Path, damage: bytes) -> None:
    (folder / INDEX_FILE).write_bytes(damage)
    with pytest.raises(UserError, match=r"certs/identities\.json: "):
        require_certificates(BusConfig(certificates=str(folder)), ())


@pytest.mark.slow
def test_without_the_extra_making_is_one_line_and_showing_goes_on(folder: Path) -> None:
    hide = "import sys; sys.modules['cryptography'] = None; from paani.cli import main; sys.exit(main(sys.argv[1:]))"

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", hide, "certs", *words, "--folder", str(folder)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    refused = run("rotate", "advisor")
    assert refused.returncode == 2
    assert refused.stderr == "paani: certs rotate needs cryptography, not installed here: pip install 'paani[certs]'\n"
    listed = run("show")
    assert listed.returncode == 0
    assert "controller.1" in listed.stdout
