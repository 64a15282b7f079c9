"""The runtime folder holds what opens the bus: nobody else's, and for nobody else to read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from paani.authority import ensure_credentials, password_of
from paani.config import BusConfig
from paani.errors import UserError
from paani.operator_key import KEY_FILE, ensure_operator_key
from paani.runtime import own_runtime_dir, require_unowned_runtime_dir, runtime_dir, write_private


def test_a_folder_is_made_for_its_owner_alone(tmp_path: Path) -> None:
    folder = runtime_dir(BusConfig(runtime_dir=str(tmp_path / "a" / "b")))
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_open_to_others_is_closed(tmp_path: Path) -> None:
    folder = tmp_path / "open"
    folder.mkdir()
    folder.chmod(0o755)
    assert runtime_dir(BusConfig(runtime_dir=str(folder))).stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_somebody_elses_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "theirs"
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, 12345)
    with pytest.raises(UserError, match=r"bus\.runtime_dir .*theirs: belongs to another user"):
        runtime_dir(BusConfig(runtime_dir=str(folder)))


def test_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "there")
    with pytest.raises(UserError, match=r"bus\.runtime_dir .*link: is a link"):
        runtime_dir(BusConfig(runtime_dir=str(tmp_path / "link")))


@pytest.mark.slow
def test_a_latch_has_one_boat_and_a_killed_one_leaves_it(tmp_path: Path) -> None:
    config = BusConfig(runtime_dir=str(tmp_path / "runtime"))
    holds = (
        "import sys; from paani.config import BusConfig; from paani.runtime import own_runtime_dir\n"
        "with own_runtime_dir(BusConfig(runtime_dir=sys.argv[1])): print(flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", holds, config.runtime_dir]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with pytest.raises(UserError, match=r"bus\.runtime_dir .*runtime: in use by another boat"):
            require_unowned_runtime_dir(config)
        other.kill()
        other.wait()
    with own_runtime_dir(config) as folder:
        assert folder == runtime_dir(config)
    require_unowned_runtime_dir(config)


def test_a_private_file_that_cannot_be_written_leaves_nothing_beside(tmp_path: Path) -> None:
    (tmp_path / "key").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_private(tmp_path / "key", "secret")
    assert [path.name for path in tmp_path.iterdir()] == ["key"]


@pytest.mark.slow
def test_credentials_that_cannot_be_made_are_named_and_leave_nothing(tmp_path: Path) -> None:
    config = BusConfig(runtime_dir=str(tmp_path))
    (tmp_path / "credentials").touch()
    with pytest.raises(UserError, match=r"credentials: Not a directory"):
        ensure_credentials(config)
    assert [path.name for path in tmp_path.iterdir()] == ["credentials"]
    (tmp_path / "credentials").unlink()
    (ensure_credentials(config) / "advisor").write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match=r"advisor: no password"):
        password_of(config, "advisor")


@pytest.mark.parametrize("text", ["", "\n", "short\n"])
def test_a_key_that_was_cut_off_lets_nobody_in(tmp_path: Path, text: str) -> None:
    config = BusConfig(runtime_dir=str(tmp_path))
    key = ensure_operator_key(config)
    path = tmp_path / KEY_FILE
    path.write_text(f"{key}\n")
    assert ensure_operator_key(config) == key
    path.write_text(text)
    with pytest.raises(UserError, match=r"operator-key: a key has at least 8 characters"):
        ensure_operator_key(config)
