"""Certificates in place of passwords: which one is in force for each identity, and what Zenoh is told of them.

The common name of a certificate is its identity and a number (`controller.2`). The routers' access control knows the
number in force alone: Zenoh has no revocation lists, but a name that is no subject has no rights. `identities.json`
says which numbers those are, and is replaced whole. A client tells a router by the authority that signed it.
"""

from __future__ import annotations

import datetime
import hashlib
import ssl
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec

from paani.clock import WallClock
from paani.config import BusConfig
from paani.errors import UserError
from paani.keys import Graph
from paani.sides import Side
from paani.undecodable import UNDECODABLE

INDEX_FILE = "identities.json"
AUTHORITY = "authority"
COMPLETE = "`paani certs complete` makes what is missing, and changes no other"
ALL = "all"  # in place of an identity: each of them, and the authority
# What listens: clients are told nothing by it but that the authority signed it for this address. Routers, and the page.
BOARD_ROUTER, HOST_ROUTER = "board_router", "host_router"
PAGE = "page"
LISTENERS = (BOARD_ROUTER, HOST_ROUTER, PAGE)


UnixTime = Annotated[int, msgspec.Meta(ge=0, le=253_402_300_799)]  # [s]; up to the year 9999, as X.509 has it


class Certificate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One certificate in force: the number in its name, when it is valid (Unix time), the SHA-256 of its DER bytes."""

    number: Annotated[int, msgspec.Meta(ge=1)]
    not_before_s: UnixTime
    not_after_s: UnixTime
    sha256: str


class Identities(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is in force in a folder. `revoked` has the last number of each identity that has no certificate now."""

    graph: Graph
    addresses: tuple[str, ...]
    authority: Certificate
    holders: dict[str, Certificate]
    revoked: dict[str, int] = {}

    def common_name(self, name: str) -> str | None:
        """Of the certificate in force; None where the identity has none."""
        holder = self.authority if name == AUTHORITY else self.holders.get(name)
        return None if holder is None else f"{name}.{holder.number}"


def read_identities(folder: Path) -> Identities:
    """Raises UserError naming the file."""
    path = folder / INDEX_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=Identities)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror} (`paani certs make` makes it)") from error
    except UNDECODABLE as error:
        raise UserError(f"{path}: {error}") from error


def identities_of(config: BusConfig) -> Identities:
    """Those of `bus.certificates`. Raises UserError where they are of another graph: a simulation's open no hull."""
    identities = read_identities(Path(config.certificates))
    if identities.graph is not config.graph:
        raise UserError(
            f"bus.certificates {config.certificates}: made for the graph {identities.graph}, not for {config.graph}"
        )
    return identities


def date_text(unix_s: int) -> str:
    """A moment as people read it, in UTC."""
    return datetime.datetime.fromtimestamp(unix_s, tz=datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def listener_of(config: BusConfig) -> str:
    """Which certificate the router of this side shows."""
    return BOARD_ROUTER if config.side is Side.BOARD else HOST_ROUTER


def require_certificates(config: BusConfig, names: Iterable[str]) -> Identities:
    """Raises UserError naming the first file that is missing, readable by others, not the one in force or out of date.

    An identity that was revoked is passed over: it cannot start, the others can.
    """
    identities = identities_of(config)
    _require_certificate(config, identities, AUTHORITY, identities.authority)
    for name in names:
        if name in identities.holders:
            _require_certificate(config, identities, name, identities.holders[name])
            _require_private(_path(config, identities, name, "key"))
    return identities


def client_settings(config: BusConfig, user: str) -> dict[str, object]:
    """Zenoh's settings of a client. Raises UserError as `require_certificates`, and where `user` has none."""
    return {"transport/link/tls": _tls(config, require_certificates(config, (user,)), connecting=user)}


def router_settings(config: BusConfig, connecting: str | None) -> dict[str, object]:
    """Zenoh's settings of a router; `connecting` is who it is to the router that it connects to. Raises UserError."""
    listener = listener_of(config)
    identities = require_certificates(config, (listener, *([connecting] if connecting else [])))
    return {"transport/link/tls": _tls(config, identities, connecting=connecting, listening=listener)}


def page_server_tls(config: BusConfig) -> ssl.SSLContext:
    """What the page's server shows. Raises UserError as `require_certificates`, and where there is no certificate."""
    if not config.certificates:
        raise UserError(
            "dashboard.host: beyond this machine the page is encrypted, but bus.certificates is not set (make some: "
            "paani certs make --folder certs --address ADDRESS; then --set bus.certificates=certs)"
        )
    identities = require_certificates(config, (PAGE,))
    if PAGE not in identities.holders:
        raise UserError(f"bus.certificates {config.certificates}: none for the page ({COMPLETE})")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(_path(config, identities, PAGE, "pem"), _path(config, identities, PAGE, "key"))
    return context


def page_client_tls(config: BusConfig) -> ssl.SSLContext:
    """Knows the page's server by the authority of `bus.certificates`. Raises UserError."""
    identities = require_certificates(config, ())
    return ssl.create_default_context(cafile=_path(config, identities, AUTHORITY, "pem"))


def endpoint(config: BusConfig, address: str) -> str:
    """The address as Zenoh is to use it: by TLS where there are certificates."""
    return f"tls/{address.partition('/')[2]}" if config.certificates else address


def _tls(
    config: BusConfig, identities: Identities, *, connecting: str | None, listening: str | None = None
) -> dict[str, object]:
    tls: dict[str, object] = {
        "root_ca_certificate": str(_path(config, identities, AUTHORITY, "pem")),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    for use, name in (("connect", connecting), ("listen", listening)):
        if name is not None:
            tls[f"{use}_private_key"] = str(_path(config, identities, name, "key"))
            tls[f"{use}_certificate"] = str(_path(config, identities, name, "pem"))
    return tls


def _path(config: BusConfig, identities: Identities, name: str, suffix: str) -> Path:
    common_name = identities.common_name(name)
    if common_name is None:
        state = "revoked" if name in identities.revoked else COMPLETE
        raise UserError(f"bus.certificates {config.certificates}: {name} has no certificate ({state})")
    return Path(config.certificates) / f"{common_name}.{suffix}"


def _require_certificate(config: BusConfig, identities: Identities, name: str, stated: Certificate) -> None:
    path = _path(config, identities, name, "pem")
    try:
        found = hashlib.sha256(ssl.PEM_cert_to_DER_cert(path.read_text(encoding="ascii"))).hexdigest()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"{path}: no certificate in PEM") from error
    if found != stated.sha256:
        raise UserError(f"{path}: not the certificate that {INDEX_FILE} names; copy the folder again")
    now_us = WallClock().now_us()
    if now_us < stated.not_before_s * 1_000_000:
        raise UserError(f"{path}: not valid before {date_text(stated.not_before_s)} (is this machine's clock right?)")
    if now_us >= stated.not_after_s * 1_000_000:
        raise UserError(f"{path}: expired {date_text(stated.not_after_s)} (`paani certs rotate` makes another)")


def _require_private(path: Path) -> None:
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    if mode & 0o077:
        raise UserError(f"{path}: others may read it (chmod 600, and rotate it)")
