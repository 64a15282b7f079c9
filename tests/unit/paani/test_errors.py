"""A user's mistake is one line that a terminal can show, whatever foreign text it quotes."""

from __future__ import annotations

import pytest

from paani.errors import MAX_CHARACTERS, UserError


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("file a.toml: line 3", "file a.toml: line 3"),
        ("two\nlines\r\n and\tmore ", "two lines and more"),
        ("\x1b[2Jx\x00", "\\x1b[2Jx\\x00"),
        ("not UTF-8: \udcff, right to left: \u202e", "not UTF-8: \\udcff, right to left: \\u202e"),
        ("späť 船", "späť 船"),
    ],
)
def test_it_is_one_printable_line(text: str, line: str) -> None:
    assert str(UserError(text)) == line
    assert line.encode()


def test_what_is_quoted_may_be_long_but_its_message_is_not() -> None:
    line = str(UserError(f"file a.toml: unknown {'x' * 10**6} (have: b)"))
    assert len(line) <= MAX_CHARACTERS
    assert line.startswith("file a.toml: unknown x")
    assert line.endswith("x (have: b)")
