"""Checksums of what installed packages hold: equal where two machines have the same code and the same models."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path


def checksum_packages(packages: Iterable[str], endings: tuple[str, ...]) -> str:
    """First 64 bits of the SHA-256, in hexadecimal, over the packages' files with these endings; nothing imported."""
    return checksum_files(file for package in packages for file in _list_files(package, endings))


def checksum_files(files: Iterable[Path]) -> str:
    """As `checksum_packages`, over names and contents; what is no file is passed over."""
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def _list_files(package: str, endings: tuple[str, ...]) -> list[Path]:
    spec = find_spec(package)
    folders = list(spec.submodule_search_locations or ()) if spec is not None else []
    return sorted(file for folder in folders for file in Path(folder).rglob("*") if file.suffix in endings)
