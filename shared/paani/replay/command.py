"""`paani replay FILE`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.logs.reader import open_log
from paani.replay.provenance import provenance_of
from paani.replay.tell import change_text, check_text
from paani.replay.verify import ChangeReport, CheckReport, change_log, check_log


def main(argv: list[str]) -> int:
    """Exit codes: 0 done (and with `--check` every decision is the same), 1 not the same, 2 user's mistake."""
    options = _parser().parse_args(argv)
    log = open_log(options.file)
    provenance = provenance_of(log, force=options.force)
    report: CheckReport | ChangeReport
    if options.check and not options.sets:
        report = check_log(log, provenance.config, provenance.notes)
        sys.stdout.write(check_text(report))
        _write(options.json, report)
        return 0 if report.is_exact else 1
    report = change_log(log, provenance.config, tuple(options.sets), provenance.notes, chained=options.chain)
    sys.stdout.write(change_text(report))
    _write(options.json, report)
    return 0


def _write(path: Path | None, report: CheckReport | ChangeReport) -> None:
    if path is None:
        return
    beside = path.with_name(f".{path.name}.beside")
    try:
        beside.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
        beside.replace(path)
    except OSError as error:
        raise UserError(f"--json {path}: {error.strerror}") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="paani replay", description="A recorded drive, again.")
    parser.add_argument("file", type=Path, metavar="FILE", help="a recording, or a folder of its parts")
    parser.add_argument("--check", action="store_true", help="compute every decision again and compare it")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="sets",
        metavar="SECTION.FIELD=VALUE",
        help="one setting; may be repeated",
    )
    parser.add_argument(
        "--chain", action="store_true", help="with --set: give each service what the one before now says"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the report as JSON too")
    parser.add_argument("--force", action="store_true", help="go on with a log of other settings or weights")
    return parser
