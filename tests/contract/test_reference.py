"""The reference says everything that the code has: each topic, setting, command and message."""

from __future__ import annotations

from importlib.metadata import entry_points

import msgspec

from docs.reference.commands import commands, commands_page
from docs.reference.markdown import STATEMENT
from docs.reference.messages import enum_types, message_types, messages_page
from docs.reference.settings import Setting, sections, settings_page
from docs.reference.statements import read_statements, statements_page, what_statements_say
from docs.reference.topics import topics_page
from paani import keys
from paani import messages as m
from paani.config import Config

SETTINGS = [setting for section in sections() for setting in section.settings]
STATEMENTS = set(read_statements())


def leaves(kind: type[msgspec.Struct], path: str = "") -> list[str]:
    """Paths of all settings, found without the generator."""
    found = []
    for field in msgspec.structs.fields(kind):
        name = f"{path}{field.encode_name}"
        inner = field.type
        is_section = isinstance(inner, type) and issubclass(inner, msgspec.Struct)
        found += leaves(inner, f"{name}.") if is_section else [name]
    return found


def test_every_topic_has_its_row() -> None:
    rows = topics_page().splitlines()
    for topic in keys.every_topic():
        (row,) = [row for row in rows if row.startswith(f"| `{topic.name}` |")]
        assert topic.producer in row
        assert topic.summary in row


def test_every_setting_has_its_row() -> None:
    rows = settings_page().splitlines()
    for path in leaves(Config):
        assert any(row.startswith(f"| `{path}` |") for row in rows), path


def test_a_setting_says_why() -> None:
    """In words, or by the statement of the paper that it is taken from."""

    def says_why(setting: Setting) -> bool:
        return bool(set(STATEMENT.findall(setting.why)) & STATEMENTS) or len(setting.why.split()) >= 2

    assert [setting.path for setting in SETTINGS if not says_why(setting)] == []


def test_a_row_gives_unit_range_default_and_reason() -> None:
    (row,) = [row for row in settings_page().splitlines() if row.startswith("| `advisor.tracker.hold_s` |")]
    cells = [cell.strip() for cell in row.strip("|").split(" | ")]
    assert cells[1:5] == ["s", "number", "> 0", "`3.0`"]
    assert f'[G3](statements.md#g3 "{what_statements_say()["G3"]}")' in cells[5]


def test_every_command_is_shown_with_its_options() -> None:
    page = commands_page()
    for group, prefix in (("paani.commands", ""), ("paani.bench_commands", "bench ")):
        for point in entry_points(group=group):
            assert f" paani {prefix}{point.name}\n" in page, point.name
    for command in commands():
        assert command.help.startswith(f"usage: {command.name}"), command.name
    for sub_command in ("logs info", "route convert", "tune promote", "models train", "world render", "bench chain"):
        assert f"\n### paani {sub_command}\n" in page
    for option in ("--sheet FILE", "--mission FILE", "--suite {", "--speed X"):
        assert option in page


def test_every_message_has_its_section_and_every_field_its_row() -> None:
    page = messages_page()
    used = {topic.type for topic in keys.every_topic()}
    assert used <= set(message_types())
    for kind in message_types():
        section = page.split(f"\n## {kind.__name__}\n")[1].split("\n## ")[0]
        header = {field.name for field in msgspec.structs.fields(m.Message)} if issubclass(kind, m.Message) else set()
        for field in msgspec.structs.fields(kind):
            assert field.name in header or f"| `{field.name}` |" in section, f"{kind.__name__}.{field.name}"
    for words in enum_types():
        section = page.split(f"\n## {words.__name__}\n")[1].split("\n## ")[0]
        for member in words:
            assert f"`{member.value}`" in section


def test_every_statement_has_its_anchor() -> None:
    page = statements_page()
    for name in read_statements():
        assert f"### {name} {{ #{name.lower()} }}\n" in page
