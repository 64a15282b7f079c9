"""`paani certs`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from paani.authority import uncertified_in
from paani.certificates import AUTHORITY, Identities, date_text, read_identities
from paani.cli import add_config_arguments, config_from
from paani.clock import WallClock
from paani.extras import require_modules
from paani.option_numbers import whole_number
from paani.option_paths import input_folder, output_folder

DAYS = 365
MAX_DAYS = 3650
RESTART = "in force with the next start of each router: end `paani up` on both machines, copy the folder, start again\n"


def main(argv: list[str]) -> int:
    """Exit codes: 0 done, 1 `show` found one that is not valid now or missing, 2 user's mistake."""
    options = _parser().parse_args(argv)
    folder: Path = options.folder
    if options.action == "show":
        return _show(folder, read_identities(folder))
    require_modules(f"certs {options.action}", "cryptography")
    from paani_tools.certs import folder as certificates  # noqa: PLC0415  # only whoever makes some needs its library

    now_us = WallClock().now_us()
    if options.action == "make":
        graph = config_from(options).bus.graph
        identities = certificates.make(folder, graph, tuple(options.address), now_us, options.days)
        sys.stdout.write(f"{folder}: {len(identities.holders)} certificates for the graph {graph}\n")
        return 0
    if options.action == "complete":
        names = certificates.complete(folder, now_us, options.days)
        sys.stdout.write(f"{', '.join(names)}: made; {RESTART}" if names else f"{folder}: none is missing\n")
        return 0
    if options.action == "rotate":
        certificates.rotate(folder, options.name, now_us, options.days)
    else:
        certificates.revoke(folder, options.name)
    sys.stdout.write(f"{options.name}: {options.action}d; {RESTART}")
    return 0


def _show(folder: Path, identities: Identities) -> int:
    now_s = WallClock().now_us() // 1_000_000
    is_valid = True
    for name, certificate in {AUTHORITY: identities.authority, **identities.holders}.items():
        if now_s >= certificate.not_after_s:
            state = "EXPIRED"
        else:
            state = "NOT YET VALID" if now_s < certificate.not_before_s else "valid"
        is_valid = is_valid and state == "valid"
        until = date_text(certificate.not_after_s)
        sys.stdout.write(f"{f'{name}.{certificate.number}':<18} {state} until {until}  {certificate.sha256}\n")
    for name, number in identities.revoked.items():
        sys.stdout.write(f"{f'{name}.{number}':<18} REVOKED\n")
    missing = uncertified_in(identities)
    for name in missing:
        sys.stdout.write(f"{name:<18} MISSING: `paani certs complete --folder {folder}` makes it\n")
    return 0 if is_valid and not missing else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani certs",
        description="Make, renew and revoke the certificates by which a boat's processes know each other.",
    )
    actions = parser.add_subparsers(dest="action", required=True)
    make = actions.add_parser(
        "make", help="a new authority, and a certificate for each identity of the profile's graph"
    )
    make.add_argument(
        "--address", action="append", default=[], metavar="ADDRESS", help="of a router on a network; may be repeated"
    )
    add_config_arguments(make)
    rotate = actions.add_parser("rotate", help="a new certificate in place of the one in force")
    rotate.add_argument("name", metavar="IDENTITY", help="or all: with a new authority, which retires every old one")
    complete = actions.add_parser(
        "complete", help="one for each identity that has none, as in a folder made before there was such a process"
    )
    revoke = actions.add_parser("revoke", help="take an identity's rights; `rotate` gives it new ones")
    revoke.add_argument("name", metavar="IDENTITY")
    show = actions.add_parser(
        "show", help="names, expiry and SHA-256; exit code 1 where one is missing or not valid now"
    )
    for action in (make, rotate, complete, revoke, show):
        kind = output_folder if action is make else input_folder
        action.add_argument("--folder", type=kind("--folder"), required=True, metavar="FOLDER", help="where they lie")
    for action in (make, rotate, complete):
        action.add_argument(
            "--days",
            type=whole_number(1, MAX_DAYS),
            default=DAYS,
            help=f"how long they are valid, 1 to {MAX_DAYS} (default: {DAYS})",
        )
    return parser
