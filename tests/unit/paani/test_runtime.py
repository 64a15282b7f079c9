"""The runtime folder holds what opens the bus: nobody else's, and for nobody else to read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from paani.config import BusConfig
from paani.errors import UserError
from paani.runtime import own_runtime_dir, require_unowned_runtime_dir, runtime_dir


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
