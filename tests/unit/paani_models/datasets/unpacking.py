"""Unpacks a training bundle: plain files, all inside the folder."""

from __future__ import annotations

import tarfile
from pathlib import Path


def unpack(archive: Path, folder: Path) -> Path:
    """Write the bundle's files below `folder`; ValueError on a link, a device or a path that leads out of it.

    The check is ours because `extractall(filter=...)` came with Python 3.11.4, and Debian 12 has 3.11.2.
    """
    inside = folder.resolve()
    with tarfile.open(archive) as bundle:
        members = bundle.getmembers()
        for member in members:
            if not member.isfile() or not (inside / member.name).resolve().is_relative_to(inside):
                raise ValueError(f"{archive}: {member.name} is not a plain file inside the folder")
        for member in members:
            content = bundle.extractfile(member)
            assert content is not None
            path = inside / member.name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.read())
    return folder
