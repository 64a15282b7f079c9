"""`paani doctor`."""

from __future__ import annotations

import argparse
import sys

from paani.cli import add_config_arguments, config_from
from paani.whole_file import indented_json
from paani_tools.doctor.devices import check_camera, check_serial
from paani_tools.doctor.finding import Check, State, finding_text, run_check
from paani_tools.doctor.machine import check_certificates, check_clock, check_disk, check_permissions
from paani_tools.doctor.network import check_page, check_router
from paani_tools.doctor.software import check_gl, check_models, check_versions

CHECKS: dict[str, Check] = {
    "versions": check_versions,
    "models": check_models,
    "gl": check_gl,
    "camera": check_camera,
    "serial": check_serial,
    "router": check_router,
    "page": check_page,
    "clock": check_clock,
    "disk": check_disk,
    "permissions": check_permissions,
    "certificates": check_certificates,
}


def main(argv: list[str]) -> int:
    """Print a line for each finding. Exit codes: 0 nothing fails, 1 something does, 2 a setting that cannot be read."""
    options = _parser().parse_args(argv)
    config = config_from(options)
    findings = []
    for name in options.checks or CHECKS:
        for finding in run_check(name, CHECKS[name], config):
            findings.append(finding)
            if not options.json:
                sys.stdout.write(finding_text(finding))
                sys.stdout.flush()
    if options.json:
        sys.stdout.write(indented_json(findings).decode())
    return int(any(finding.state is State.FAIL for finding in findings))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani doctor",
        description="Check what this machine has for a boat with these settings, and say what to do. Changes nothing.",
    )
    parser.add_argument(
        "checks", nargs="*", metavar="CHECK", type=_check, help=f"of {', '.join(CHECKS)} (default: all)"
    )
    parser.add_argument("--json", action="store_true", help="a JSON list instead of lines")
    add_config_arguments(parser)
    return parser


def _check(text: str) -> str:
    if text not in CHECKS:
        raise argparse.ArgumentTypeError(f"no check '{text}' (of {', '.join(CHECKS)})")
    return text
