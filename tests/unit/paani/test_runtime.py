"""The runtime folder holds what opens the bus: nobody else's, and for nobody else to read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from paani.config import BusConfig
from paani.errors import UserError
from paani.runtime import runtime_dir


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
