"""What is unpacked stays inside its folder, on every Python."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import pytest

from tests.unit.paani_models.datasets.unpacking import unpack


def archive_of(out: Path, name: str, kind: bytes = tarfile.REGTYPE, target: str = "") -> Path:
    with tarfile.open(out, "w") as bundle:
        for member, member_kind in (("sets/first.txt", tarfile.REGTYPE), (name, kind)):
            entry = tarfile.TarInfo(member)
            entry.type, entry.linkname = member_kind, target
            entry.size = 4 if member_kind == tarfile.REGTYPE else 0
            bundle.addfile(entry, io.BytesIO(b"text"[: entry.size]))
    return out


def test_plain_files_are_written(tmp_path: Path) -> None:
    there = unpack(archive_of(tmp_path / "b.tar", "sets/deep/second.txt"), tmp_path / "there")
    assert {str(path.relative_to(there)): path.read_bytes() for path in there.rglob("*.txt")} == {
        "sets/first.txt": b"text",
        "sets/deep/second.txt": b"text",
    }


@pytest.mark.parametrize(
    ("name", "kind", "target"),
    [
        ("../outside.txt", tarfile.REGTYPE, ""),
        ("sets/../../outside.txt", tarfile.REGTYPE, ""),
        ("/outside.txt", tarfile.REGTYPE, ""),
        ("link", tarfile.SYMTYPE, "/"),
        ("link", tarfile.LNKTYPE, "sets/first.txt"),
        ("device", tarfile.CHRTYPE, ""),
        ("pipe", tarfile.FIFOTYPE, ""),
    ],
)
def test_what_leads_out_is_refused_and_nothing_is_written(name: str, kind: bytes, target: str, tmp_path: Path) -> None:
    archive = archive_of(tmp_path / "b.tar", name, kind, target)
    with pytest.raises(ValueError, match="not a plain file inside the folder"):
        unpack(archive, tmp_path / "there")
    assert [path.name for path in tmp_path.iterdir()] == ["b.tar"]
