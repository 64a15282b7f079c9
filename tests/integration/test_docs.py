"""The documentation builds as `make docs` builds it, and what is broken fails the build."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.build import HERE, build, gather
from docs.links import problems_of
from tests.places import ROOT

FOLDERS = ("shared/", "services/", "sim_host/", "models/", "deploy/", "tests/", "examples/", "docs/")


@pytest.fixture(scope="module")
def gathered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    gather(HERE, folder)
    return folder


def test_the_pages_build_without_a_broken_link(gathered: Path) -> None:
    assert build(gathered) == []
    assert len(list((gathered / "site").rglob("*.html"))) >= 20


def test_a_broken_link_fails_the_build(gathered: Path) -> None:
    problems = built_with(gathered, "[x](how-to/no-such-page.md)", "[x](tutorial.md#no-such-heading)")
    for fault in ("page does not exist", "anchor does not exist"):
        assert any(fault in problem for problem in problems), fault


def test_a_picture_that_is_not_here_and_a_page_that_no_menu_leads_to_fail_the_build(gathered: Path) -> None:
    lost = gathered / "pages" / "lost.md"
    lost.write_text("# Lost\n", encoding="utf-8")
    try:
        problems = built_with(gathered, "![x](no-such-picture.png)", "![x](https://example.org/picture.png)")
    finally:
        lost.unlink()
    for fault in ("no-such-picture.png leads nowhere", "from another host"):
        assert any(fault in problem for problem in problems), fault
    assert "lost.md: is not in the menu of zensical.toml" in problems


def built_with(gathered: Path, *lines: str) -> list[str]:
    """What is wrong with the pages with these lines in one of them."""
    page = gathered / "pages" / "index.md"
    whole = page.read_text(encoding="utf-8")
    try:
        page.write_text("\n\n".join((whole, *lines)), encoding="utf-8")
        return build(gathered)
    finally:
        page.write_text(whole, encoding="utf-8")


def test_every_file_that_a_page_names_exists() -> None:
    """Paths from the root of the checkout, and names of modules without their folder."""
    modules = {path.name for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")}
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "examples" / "README.md"):
        for name in re.findall(r"`([\w./-]+)`", page.read_text(encoding="utf-8")):
            if name.startswith(FOLDERS):
                assert (ROOT / name).exists(), f"{page.name}: {name}"
            elif name.endswith(".py") and "/" not in name:
                assert name in modules, f"{page.name}: {name}"


def test_every_file_that_a_package_says_it_has_is_there_and_its_links_lead_somewhere() -> None:
    pages = [page for folder in FOLDERS for page in (ROOT / folder).rglob("README.md")]
    assert len(pages) >= 20
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for link in re.findall(r"\]\(([^)#\s]+)", text):
            assert "://" in link or (page.parent / link).exists(), f"{page.relative_to(ROOT)}: {link}"
        for table in re.findall(r"^\| (?:file|module) \|.*\n((?:\|.*\n)+)", text, flags=re.MULTILINE):
            for name in re.findall(r"`([\w./-]+)`", "".join(row.split("|")[1] for row in table.splitlines())):
                is_there = any(page.parent.rglob(name)) or any(
                    (ROOT / folder / name).exists() for folder in ("", *FOLDERS)
                )
                assert is_there, f"{page.relative_to(ROOT)}: {name}"


def test_links_are_followed_by_file_and_anchor(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="top"></h1><a href="b.html#here"></a><a href="#top"></a><a href="b.html"></a>'
    )
    (tmp_path / "b.html").write_text(
        '<p id="here"></p><a href="a.html#gone"></a><script src="//cdn.example/x"></script>'
    )
    assert problems_of(tmp_path) == [
        "b.html: loads //cdn.example/x from another host",
        "b.html: a.html#gone leads nowhere",
    ]
