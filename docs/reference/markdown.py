"""What the pages of the reference share: tables, anchors, and links to the paper's statements."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping

STATEMENT = re.compile(r"\b([A-W]\d{1,2})\b")


def table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A Markdown table; a bar inside a cell is escaped, so it ends no cell."""
    lines = [header, tuple("---" for _ in header), *rows]
    return "".join("| " + " | ".join(_cell(cell) for cell in line) + " |\n" for line in lines)


def prose(text: str | None) -> str:
    """A docstring as paragraphs, its line breaks joined."""
    paragraphs = inspect.cleandoc(text or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def with_statement_links(text: str, known: Mapping[str, str]) -> str:
    """Every id of a statement of the paper (`J5`) becomes a link, which shows what the statement says."""

    def link(found: re.Match[str]) -> str:
        says = known.get(found[1], "").replace('"', "'")
        return f'[{found[1]}](statements.md#{found[1].lower()} "{says}")' if says else found[1]

    return STATEMENT.sub(link, text)


def _cell(text: str) -> str:
    return text.replace("\n", " ").replace("|", "\\|")
