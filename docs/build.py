"""Build the documentation, `python -m docs.build FOLDER`: the pages beside this file and those of the reference."""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from docs.links import problems_of
from docs.reference.commands import commands_page
from docs.reference.markdown import with_statement_links
from docs.reference.messages import messages_page
from docs.reference.settings import settings_page
from docs.reference.statements import statements_page
from docs.reference.topics import topics_page
from paani_tools.claims.statements import read_statements
from paani_tools.paper_report.command import report_text

HERE = Path(__file__).parent
COLOUR = re.compile(r"\x1b\[[0-9;]*m")  # the generator colours what it says, and ends with its own stack
SHIPPED = (".md", ".png", ".jpg", ".svg", ".css")
GENERATED: dict[str, Callable[[], str]] = {
    "topics": topics_page,
    "settings": settings_page,
    "commands": commands_page,
    "messages": messages_page,
    "statements": statements_page,
    "paper-results": lambda: with_statement_links(
        report_text(None), {each.id: each.says for each in read_statements()}
    ),
}


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 built, 1 a page, link, anchor or picture is missing."""
    parser = argparse.ArgumentParser(prog="python -m docs.build", description="Build the documentation, strictly.")
    parser.add_argument("folder", type=Path, help="where to build; the site lies in its sub-folder `site`")
    folder = parser.parse_args(argv).folder
    gather(HERE, folder)
    problems = build(folder)
    sys.stderr.writelines(f"{line}\n" for line in problems)
    if not problems:
        sys.stdout.write(f"{folder / 'site' / 'index.html'}\n")
    return 1 if problems else 0


def gather(source: Path, folder: Path) -> None:
    """Lay out what the generator reads: its settings, the written pages, and the pages made from the code."""
    shutil.rmtree(folder, ignore_errors=True)
    pages = folder / "pages"
    for file in sorted(source.rglob("*")):
        if file.suffix in SHIPPED:
            target = pages / file.relative_to(source)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
    (pages / "reference").mkdir(exist_ok=True)
    for name, page in GENERATED.items():
        (pages / "reference" / f"{name}.md").write_text(page(), encoding="utf-8")
    shutil.copyfile(source / "zensical.toml", folder / "zensical.toml")


def build(folder: Path) -> list[str]:
    """Build what was gathered; returns what is wrong, a line each."""
    problems = missing_from_navigation(folder)
    generator = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict", "--config-file", str(folder / "zensical.toml")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if generator.returncode:
        return [*problems, COLOUR.sub("", generator.stderr).partition("Traceback")[0].strip()]
    return problems + problems_of(folder / "site")


def missing_from_navigation(folder: Path) -> list[str]:
    """Pages that no menu leads to, and entries of the menu without a page."""
    menu = set(_entries(tomllib.loads((folder / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"]))
    pages = {str(file.relative_to(folder / "pages")) for file in (folder / "pages").rglob("*.md")}
    absent = [f"zensical.toml: {name} is in the menu and there is no such page" for name in sorted(menu - pages)]
    return absent + [f"{name}: is not in the menu of zensical.toml" for name in sorted(pages - menu)]


def _entries(nav: list[Any]) -> Iterator[str]:
    for entry in nav:
        for below in entry.values() if isinstance(entry, dict) else (entry,):
            if isinstance(below, str):
                yield below
            else:
                yield from _entries(below)


if __name__ == "__main__":
    raise SystemExit(main())
