"""Every word of the page is in one file, so that a translation is one file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html.parser import HTMLParser

import pytest

from paani import messages as m
from tests.places import ROOT

STATIC = ROOT / "services" / "paani_services" / "dashboard" / "static"
ENGLISH = (STATIC / "english.js").read_text(encoding="utf-8")
PAGES = ("index.html", "login.html")
KEYS = ("data-text", "data-before", "data-label", "data-title", "data-placeholder")
SPOKEN = ("aria-label", "title", "placeholder", "alt")
NAME, SCRIPTLESS = "PAANI", "noscript"  # what needs no translation, and what no script can fill
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`')
COMMENT = re.compile(r"/\*.*?\*/|^\s*//.*?$|(?<=\s)//\s.*?$", re.DOTALL | re.MULTILINE)
CLASSES = re.compile(r'\bclass="[^"]*"')
IN_TEMPLATE = re.compile(
    r"[>}]\s*([A-Za-z]{3,}[^<>{}$`();=]*)</|\b(?:aria-label|title|placeholder)=\"([^\"$]*[A-Za-z]{2}[^\"]*)\""
)
SENTENCE = re.compile(r"[A-Za-z]{2,},? [A-Za-z]{2,}")
NO_WORDS = re.compile(
    r"sans-serif|^warn |^wide |^good|^bad|[#.\[<>(]|^follow route$|^hold station$|^return home$|frame shorter than"
)  # fonts, classes, selectors, legs as the navigator names them, and what only a developer reads


class Words(HTMLParser):
    """The names of words that a page asks for, and the words that stand in it."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.found: list[str] = []
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in {"meta", "link", "input", "path", "circle"}:
            self._open.append(tag)
        for name, value in attrs:
            if name in KEYS and value:
                self.names.add(value)
            if name in SPOKEN and value:
                self.found.append(f"{name}={value}")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        return

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if re.search(r"[A-Za-z]{2}", data) and data.strip() != NAME and SCRIPTLESS not in self._open:
            self.found.append(data.strip())


def words_of(page: str) -> Words:
    words = Words()
    words.feed((STATIC / page).read_text(encoding="utf-8"))
    return words


@pytest.mark.parametrize("page", PAGES)
def test_a_page_names_its_words_and_has_none(page: str) -> None:
    assert words_of(page).found == []


def test_each_word_that_a_page_names_is_there_and_none_is_left_over() -> None:
    block = re.search(r"export const PAGE_TEXTS = \{\n(.*?)\n\};", ENGLISH, re.DOTALL)
    assert block is not None
    there = re.findall(r'(\w+): "(?:[^"\\]|\\.)*",', block[1])
    assert sorted(there) == sorted(set().union(*(words_of(page).names for page in PAGES)))


@pytest.mark.parametrize(
    ("table", "codes"),
    [("REASONS", m.Reason), ("STOP_REASONS", m.Inhibit), ("STOP_REASONS", set(m.ZeroCause) - {"none"})],
)
def test_every_code_that_people_read_has_words(table: str, codes: Iterable[str]) -> None:
    block = re.search(rf"export const {table} = {{\n(.*?)\n}};", ENGLISH, re.DOTALL)
    assert block is not None
    there = set(re.findall(r'(\w+): "', block[1]))
    assert set(codes) - there == set()


def test_no_other_script_has_a_sentence_and_no_template_a_word() -> None:
    found = []
    for path in sorted(STATIC.glob("*.js")):
        if path.name == "english.js":
            continue
        code = CLASSES.sub("", COMMENT.sub("", path.read_text(encoding="utf-8")))
        found += [f"{path.name}: {match[1] or match[2]}" for match in IN_TEMPLATE.finditer(code)]
        for match in LITERAL.finditer(code):
            text = re.sub(r"\$\{[^}]*\}", " ", match[1] or match[2] or "")
            if SENTENCE.search(text) and not NO_WORDS.search(text):
                found.append(f"{path.name}: {text}")
    assert found == []
