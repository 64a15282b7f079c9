"""`paani tune propose|status|promote|rollback`."""

from __future__ import annotations

import argparse
import difflib
import sys

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.config import Config, with_settings
from paani.config.tuning import TUNABLE
from paani.errors import UserError
from paani.messages import Change, Shadow
from paani.undecodable import UNDECODABLE
from paani_tools.tune.client import Client
from paani_tools.tune.shadow_text import status_text


def main(argv: list[str]) -> int:
    """Raises UserError for a setting that cannot be tried, a dashboard that is not there, and each refusal."""
    options = _parser().parse_args(argv)
    config = config_from(options)
    client = Client(config)
    if options.deed == "status":
        shadow = client.status()
        sys.stdout.write(_json(shadow) if options.json else status_text(shadow, config.advisor))
        return 0
    if options.deed == "propose":
        shadow = client.ask("propose", {"changes": changes_from(options.settings, config)})
    else:
        shadow = client.ask(options.deed, {"proposal": options.proposal})
    sys.stdout.write(_json(shadow) if options.json else status_text(shadow, config.advisor))
    return 0


def changes_from(settings: list[str], config: Config) -> tuple[Change, ...]:
    """`advisor.section.field=value` texts as changes. Raises UserError naming the field at fault."""
    paths: set[str] = set()
    changes = []
    for text in settings:
        path, separator, value = (part.strip() for part in text.partition("="))
        if not separator or not value:
            raise UserError(f"{text}: expected advisor.section.field=value")
        if path not in TUNABLE:
            near = difflib.get_close_matches(path, TUNABLE, n=3)
            raise UserError(f"{path}: not a setting that can be tried" + (f" (like {', '.join(near)})" if near else ""))
        if path in paths:
            raise UserError(f"{path}: named twice")
        paths.add(path)
        changes.append(Change(path=path, value=value))
    with_settings(config, settings)
    try:
        return msgspec.convert(msgspec.to_builtins(changes), tuple[Change, ...])
    except UNDECODABLE as error:
        raise UserError(f"{settings[0]}: {error}") from error


def _json(shadow: Shadow) -> str:
    return msgspec.json.encode(shadow).decode() + "\n"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani tune",
        description="Try other parameters of the policy on a running boat, beside those in force; then put them in "
        "force, or take them back. What is tried never reaches the boat; what is promoted lasts until the advisor "
        "restarts, and both promotion and rollback want the boat disarmed.",
    )
    deeds = parser.add_subparsers(dest="deed", required=True, metavar="propose|status|promote|rollback")
    propose = deeds.add_parser("propose", help="try settings beside those in force")
    propose.add_argument("settings", nargs="+", metavar="advisor.SECTION.FIELD=VALUE")
    deeds.add_parser("status", help="what is in force, what is tried, where they differ")
    for name, text in (
        ("promote", "put what is tried in force"),
        ("rollback", "drop what is tried, or undo a promotion"),
    ):
        deeds.add_parser(name, help=text).add_argument("proposal", help="as `paani tune status` names it")
    for deed in deeds.choices.values():
        deed.add_argument("--json", action="store_true", help="the advisor's report as one line")
        add_config_arguments(deed)
    return parser
