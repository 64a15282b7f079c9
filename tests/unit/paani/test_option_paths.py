"""Options that name files are checked before a command begins."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from paani.errors import UserError
from paani.option_paths import (
    PathOf,
    input_file,
    input_folder,
    input_path,
    output_file,
    output_folder,
    output_picture,
    require_apart,
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("file").write_text("text", encoding="utf-8")


@pytest.mark.parametrize(
    ("path_of", "text"),
    [
        (input_path("--in"), "file"),
        (input_path("--in"), "folder"),
        (input_file("--in"), "file"),
        (input_folder("--in"), "folder"),
        (output_file("--out"), "file"),
        (output_file("--out"), "folder/new"),
        (output_picture("--out"), "folder/new.PNG"),
        (output_folder("--out"), "folder"),
        (output_folder("--out"), "folder/new/below"),
    ],
)
def test_what_can_be_used_is_a_path(path_of: PathOf, text: str) -> None:
    assert path_of(text) == Path(text)
    assert sorted(path.name for path in Path().rglob("*")) == ["file", "folder"], "checking makes nothing"


@pytest.mark.parametrize(
    ("path_of", "text", "problem"),
    [
        (input_path("--in"), "missing", "--in missing: no such file or folder"),
        (input_file(), "missing", "missing: no such file or folder"),
        (input_file("--in"), "folder", "--in folder: is a folder, not a file"),
        (input_folder("--in"), "file", "--in file: is not a folder"),
        (input_folder("--in"), "missing", "--in missing: no such folder"),
        (output_file("--out"), "folder", "--out folder: is a folder, not a file"),
        (output_file("--out"), "missing/new", "--out missing/new: no such folder: "),
        (output_file("--out"), "file/new", "--out file/new: no such folder: "),
        (output_picture("--out"), "folder/new.gif", "--out folder/new.gif: is not one of .jpg, .jpeg, .png"),
        (output_picture("--out"), "missing/new.png", "--out missing/new.png: no such folder: "),
        (output_folder("--out"), "file", "--out file: .*file is a file, not a folder"),
        (output_folder("--out"), "file/new", "--out file/new: .*file is a file, not a folder"),
        (output_file("--out"), "n" * 300, "--out n+: File name too long"),
        (input_path(), "", "'': names no file or folder"),
        (output_folder("--out"), "", "--out '': names no file or folder"),
    ],
)
def test_what_cannot_be_used_is_named_with_its_option(path_of: PathOf, text: str, problem: str) -> None:
    with pytest.raises(UserError, match=f"^{problem}"):
        path_of(text)


@pytest.mark.parametrize(
    ("path_of", "text", "problem"),
    [
        (input_path("--in"), "file", "--in file: may not be read"),
        (input_file("--in"), "file", "--in file: may not be read"),
        (output_file("--out"), "folder/new", "--out folder/new: may not write into .*folder"),
        (output_folder("--out"), "folder", "--out folder: may not write into .*folder"),
        (output_folder("--out"), "folder/new/below", "--out folder/new/below: may not write into .*folder"),
    ],
)
def test_what_the_user_has_no_right_to_is_named_with_its_option(
    path_of: PathOf, text: str, problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root, who may run this, has every right
    with pytest.raises(UserError, match=f"^{problem}$"):
        path_of(text)


def test_what_is_read_or_written_by_another_option_is_not_written() -> None:
    Path("link").symlink_to("file")
    Path("folder/below").symlink_to("../new")
    for written, read, problem in (
        ({"--json": Path("file")}, [None, Path("folder/../file")], "--json file: is read, and would be lost"),
        ({"--json": Path("link")}, [Path("file")], "--json link: is read, and would be lost"),
        ({"--json": Path("new"), "--svg": Path("folder/below")}, [], "--svg folder/below: is what --json writes"),
    ):
        with pytest.raises(UserError, match=f"^{problem}$"):
            require_apart(written, read)
    require_apart({"--json": Path("new"), "--svg": Path("other"), "--out": None}, [Path("file"), None])
    require_apart({"--json": Path(os.devnull), "--svg": Path(os.devnull)})
