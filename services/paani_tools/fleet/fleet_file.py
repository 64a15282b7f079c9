"""The file that says which vessels a shore watches, and how it signs in at the router of each."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import msgspec

from paani.authority import password_of
from paani.certificates import require_certificates
from paani.config import BusConfig
from paani.errors import UserError
from paani.keys import SHORE, Graph
from paani.undecodable import UNDECODABLE

MAX_VESSELS = 1000


class FleetVessel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One vessel. router: `bus.shore` of the vessel, tcp/ADDRESS:PORT. domain, graph: as of its bus.

    credentials: a folder that holds `credentials/shore` of the vessel (of a hull `credentials_hull/shore`), or of
    certificates that `paani certs` made; relative to the fleet's file.
    """

    name: Annotated[str, msgspec.Meta(pattern="^[a-z0-9_]{1,32}$")]
    router: str
    credentials: str = ""
    certificates: str = ""
    domain: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 43
    graph: Graph = Graph.SIMULATION


class _FleetFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    vessels: Annotated[tuple[FleetVessel, ...], msgspec.Meta(min_length=1, max_length=MAX_VESSELS)]


def read_fleet(path: Path) -> tuple[BusConfig, ...]:
    """The bus of each vessel, as its shore joins it, in the file's order.

    Raises UserError naming file and vessel: for a name or a router that is there twice, and where the shore's own
    credential is missing, out of date or readable by others.
    """
    try:
        fleet = msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8-sig")), _FleetFile)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except UNDECODABLE as error:
        raise UserError(f"{path}: {error}") from error
    names: set[str] = set()
    routers: dict[str, str] = {}
    for vessel in fleet.vessels:
        if vessel.name in names:
            raise UserError(
                f"{path}: vessel {vessel.name}: there twice; each vessel has a name of its own (bus.vessel)"
            )
        if vessel.router in routers:
            raise UserError(f"{path}: vessel {vessel.name}: router {vessel.router} is {routers[vessel.router]}'s")
        names.add(vessel.name)
        routers[vessel.router] = vessel.name
    return tuple(_bus_of(path, vessel) for vessel in fleet.vessels)


def _bus_of(path: Path, vessel: FleetVessel) -> BusConfig:
    where = f"{path}: vessel {vessel.name}"
    if bool(vessel.credentials) == bool(vessel.certificates):
        raise UserError(f"{where}: expected credentials or certificates")
    folder = path.parent / (vessel.credentials or vessel.certificates)
    if not folder.is_dir():
        raise UserError(f"{where}: {folder}: no such folder")
    try:
        config = BusConfig(
            vessel=vessel.name,
            domain=vessel.domain,
            graph=vessel.graph,
            router=vessel.router,
            runtime_dir=str(folder) if vessel.credentials else "",
            certificates=str(folder) if vessel.certificates else "",
        )
        if vessel.certificates:
            if SHORE not in require_certificates(config, (SHORE,)).holders:
                raise UserError(f"{config.certificates}: {SHORE} has no certificate")
        else:
            password_of(config, SHORE)
    except (UserError, ValueError) as error:
        raise UserError(f"{where}: {error}") from error
    return config
