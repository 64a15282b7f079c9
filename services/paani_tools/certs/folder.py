"""The folder of certificates, changed whole or not at all.

New files lie beside the old ones, under names of their own, until `identities.json` is replaced; what it no longer
names is removed afterwards. An interruption at any moment leaves the old certificates in force, or the new.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import msgspec
from msgspec.structs import replace

from paani.authority import certified_in, uncertified_in
from paani.certificates import ALL, AUTHORITY, INDEX_FILE, LISTENERS, Certificate, Identities, read_identities
from paani.errors import UserError
from paani.keys import Graph
from paani.runtime import write_private
from paani.whole_file import new_folder
from paani_tools.certs.issue import Issued, Signer, make_authority, make_client, make_listener, read_signer

AUTHORITY_LIVES = 10  # times as long as what it signs, so that one identity can be rotated alone for years


def make(folder: Path, graph: Graph, addresses: tuple[str, ...], now_us: int, days: int) -> Identities:
    """A new folder with an authority and a certificate for each identity. Raises UserError where it exists."""
    with new_folder(folder, "--folder") as beside:
        beside.chmod(0o700)
        identities = _issue_all(beside, graph, addresses, dict.fromkeys(certified_in(graph), 1), 1, now_us, days)
        _write_index(beside, identities)
    return identities


def rotate(folder: Path, name: str, now_us: int, days: int) -> Identities:
    """A new certificate for one identity, revoked ones too, or `ALL` of them that are in force with a new authority.

    Raises UserError, and for a router alone: clients know it by its authority, so that its old one would still pass.
    """
    with _changing(folder) as old:
        if name == ALL:
            lives = [each for each in certified_in(old.graph) if each not in old.revoked]
            numbers = {each: old.holders[each].number + 1 if each in old.holders else 1 for each in lives}
            authority = old.authority.number + 1
            new = _issue_all(folder, old.graph, old.addresses, numbers, authority, now_us, days)
            new = replace(new, revoked=old.revoked)
        else:
            _require_known(old, name)
            _require_client(name)
            last = old.holders[name].number if name in old.holders else old.revoked.get(name, 0)
            issued = _issue(folder, _signer(folder, old), name, last + 1, old.addresses, now_us, days)
            revoked = {other: number for other, number in old.revoked.items() if other != name}
            new = replace(old, holders={**old.holders, name: issued}, revoked=revoked)
        _write_index(folder, new)
        _remove_unnamed(folder, new)
    return new


def complete(folder: Path, now_us: int, days: int) -> tuple[str, ...]:
    """A certificate for each identity that has none and was not revoked; returns their names. Raises UserError."""
    with _changing(folder) as old:
        names = uncertified_in(old)
        if names:
            signer = _signer(folder, old)
            issued = {name: _issue(folder, signer, name, 1, old.addresses, now_us, days) for name in names}
            _write_index(folder, replace(old, holders={**old.holders, **issued}))
    return names


def revoke(folder: Path, name: str) -> Identities:
    """Take an identity's rights: no access control that is made from this folder names it. Raises UserError."""
    with _changing(folder) as old:
        _require_known(old, name)
        _require_client(name)
        if name not in old.holders:
            raise UserError(f"{name}: revoked already")
        holders = {other: certificate for other, certificate in old.holders.items() if other != name}
        new = replace(old, holders=holders, revoked={**old.revoked, name: old.holders[name].number})
        _write_index(folder, new)
        _remove_unnamed(folder, new)
    return new


def _issue_all(
    folder: Path,
    graph: Graph,
    addresses: tuple[str, ...],
    numbers: dict[str, int],
    authority_number: int,
    now_us: int,
    days: int,
) -> Identities:
    common_name = f"{AUTHORITY}.{authority_number}"
    authority = make_authority(f"PAANI {graph} {common_name}", authority_number, now_us, days * AUTHORITY_LIVES)
    _write_pair(folder, common_name, authority)
    signer = read_signer(authority.pem, authority.key_pem)
    holders: dict[str, Certificate] = {}
    for name, number in numbers.items():
        holders[name] = _issue(folder, signer, name, number, addresses, now_us, days)
    return Identities(graph=graph, addresses=addresses, authority=authority.certificate, holders=holders)


def _issue(
    folder: Path, signer: Signer, name: str, number: int, addresses: tuple[str, ...], now_us: int, days: int
) -> Certificate:
    """Sign and write one; `addresses`: of what listens."""
    if name in LISTENERS:
        issued = make_listener(signer, name, number, now_us, days, addresses)
    else:
        issued = make_client(signer, name, number, now_us, days)
    _write_pair(folder, f"{name}.{number}", issued)
    return issued.certificate


def _signer(folder: Path, identities: Identities) -> Signer:
    path = folder / f"{identities.common_name(AUTHORITY)}.key"
    try:
        return read_signer(path.with_suffix(".pem").read_bytes(), path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: {error.strerror} (certificates are made where the authority's key is)") from error
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error


def _require_known(identities: Identities, name: str) -> None:
    known = certified_in(identities.graph)
    if name not in known:
        raise UserError(f"{name}: no identity of the graph {identities.graph} (of {', '.join(known)})")


def _require_client(name: str) -> None:
    if name in LISTENERS:
        raise UserError(f"{name}: clients know a router by its authority: `rotate {ALL}` retires its certificate")


@contextlib.contextmanager
def _changing(folder: Path) -> Iterator[Identities]:
    """What is in force, while nobody else changes it. Raises UserError for a folder that cannot be written."""
    identities = read_identities(folder)
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            identities = read_identities(folder)
            try:
                yield identities
            except BaseException:
                with contextlib.suppress(UserError):
                    _remove_unnamed(folder, read_identities(folder))
                raise
        finally:
            os.close(descriptor)
    except OSError as error:
        raise UserError(f"--folder {folder}: {error.strerror or error}") from error


def _write_pair(folder: Path, common_name: str, issued: Issued) -> None:
    write_private(folder / f"{common_name}.key", issued.key_pem.decode())
    write_private(folder / f"{common_name}.pem", issued.pem.decode())


def _write_index(folder: Path, identities: Identities) -> None:
    write_private(folder / INDEX_FILE, msgspec.json.format(msgspec.json.encode(identities), indent=1).decode() + "\n")


def _remove_unnamed(folder: Path, identities: Identities) -> None:
    named = {identities.common_name(name) for name in (AUTHORITY, *identities.holders)}
    for path in (*folder.glob("*.pem"), *folder.glob("*.key")):
        name, _, number = path.stem.rpartition(".")
        if path.stem not in named and number.isdecimal() and name in {AUTHORITY, *certified_in(identities.graph)}:
            path.unlink()
