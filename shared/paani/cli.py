"""`paani`: services by name, commands by name."""

from __future__ import annotations

import argparse
import errno
import io
import os
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from paani.config import PROFILES, Config, decode_config, load_config
from paani.errors import UserError
from paani.extras import missing_module
from paani.option_paths import input_file
from paani.process import run_service, services
from paani.version import version_text

UNREAD = 128 + 13  # as of what SIGPIPE ends: the reader of the output went away, and with it how the command ended


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 done, 1 crash, 2 user's mistake (one line on standard error), 141 nobody reads the output."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed by whoever began this process
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115  # as long as it lives
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as standard error: a name may be bytes that are no text
    arguments = sys.argv[1:] if argv is None else argv
    commands = {point.name: point for point in entry_points(group="paani.commands")}
    names = services()
    if not arguments or arguments[0] in {"-h", "--help"}:
        sys.stdout.write(usage(sorted(commands), sorted(names)))
        return 0
    if arguments[0] == "--version":
        sys.stdout.write(f"{version_text()}\n")
        return 0
    name, rest = arguments[0], arguments[1:]
    try:
        if name == "run":
            if not rest or rest[0] not in names:
                raise UserError(f"run {' '.join(rest[:1])}: expected a service (one of {', '.join(sorted(names))})")
            return _run(rest[0], rest[1:], {})
        if name in commands or name in names:
            return _run(name, rest, commands)
        raise UserError(
            f"unknown command '{name}' (commands: {', '.join(sorted(commands))}; services: {', '.join(sorted(names))})"
        )
    except UserError as error:
        sys.stderr.write(f"paani: {error}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    except OSError as error:
        if error.errno not in {errno.EPIPE, errno.ENOSPC}:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:
            return UNREAD
        sys.stderr.write(f"paani: {error.strerror}\n")
        return 1


def _run(name: str, rest: list[str], commands: dict[str, EntryPoint]) -> int:
    try:
        if name in commands:
            code = int(commands[name].load()(rest))
            sys.stdout.flush()  # what cannot be written is said now, not by the interpreter at its end
            return code
        return run_service(name, _service_config(name, rest))
    except ModuleNotFoundError as error:
        if (remedy := missing_module(name, error)) is None:
            raise
        raise remedy from error


def usage(commands: list[str], names: list[str]) -> str:
    """The help text."""
    return (
        "usage: paani COMMAND [options]     paani run SERVICE [options]     paani --version\n\n"
        f"commands: {', '.join(commands)}\n"
        f"services: {', '.join(names)}\n\n"
        "`paani up` starts everything; `paani COMMAND --help` says more. A service whose name is no command's is also\n"
        "started by `paani SERVICE`.\n"
    )


def add_config_arguments(parser: argparse.ArgumentParser) -> None:
    """The options that `config_from` reads."""
    parser.add_argument("--profile", choices=tuple(PROFILES), help="which set of constants (default: paani)")
    parser.add_argument(
        "--config", type=input_file("--config"), metavar="FILE", help="settings in TOML, or in JSON (FILE.json)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.FIELD=VALUE",
        dest="sets",
        help="one setting; may be repeated",
    )


def config_from(options: argparse.Namespace, extra_sets: tuple[str, ...] = ()) -> Config:
    """Defaults < profile < file < environment < `extra_sets` < `--set`. Raises UserError."""
    return load_config(
        profile=options.profile,
        file=options.config,
        environ=os.environ,
        sets=(*extra_sets, *options.sets),
    )


def _service_config(name: str, rest: list[str]) -> Config:
    parser = argparse.ArgumentParser(prog=f"paani {name}", description=f"Run the {name} process.")
    add_config_arguments(parser)
    options = parser.parse_args(rest)
    handed = os.environ.get("PAANI_CONFIG_JSON")
    if handed and not (options.profile or options.config or options.sets):
        return decode_config(os.fsencode(handed))
    return config_from(options)
