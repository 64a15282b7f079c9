"""Whether everything that the built pages point to is there, and nothing is fetched from another host."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

FETCHED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src"}
NOT_FETCHED = {"canonical", "next", "prev", "alternate", "edit"}  # relations of <link> that load nothing
NOT_OURS = {"404.html"}  # its addresses are those of a server's root


class Page(HTMLParser):
    """What a page names (`ids`), links to (`links`) and loads (`fetched`)."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.ids.update(values[name] for name in ("id", "name") if name in values)
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        address = values.get(FETCHED.get(tag, ""), "")
        if address and not address.startswith("data:") and values.get("rel") not in NOT_FETCHED:
            self.fetched.append(address)


def problems_of(site: Path) -> list[str]:
    """One line for each link, anchor, picture or file that is missing or that another host would have to give."""
    pages = {file.resolve(): Page(file.read_text(encoding="utf-8")) for file in sorted(site.rglob("*.html"))}
    found: list[str] = []
    for file, page in pages.items():
        name = str(file.relative_to(site.resolve()))
        if name in NOT_OURS:
            continue
        found += [f"{name}: loads {address} from another host" for address in page.fetched if _is_elsewhere(address)]
        local = [address for address in (*page.links, *page.fetched) if not _is_elsewhere(address)]
        found += [
            f"{name}: {address} leads nowhere" for address in dict.fromkeys(local) if not _leads(file, address, pages)
        ]
    return found


def _is_elsewhere(address: str) -> bool:
    return bool(urlsplit(address).scheme or urlsplit(address).netloc)


def _leads(file: Path, address: str, pages: dict[Path, Page]) -> bool:
    parts = urlsplit(address)
    target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
    target = target / "index.html" if target.is_dir() else target
    if not target.is_file():
        return False
    return not parts.fragment or target not in pages or unquote(parts.fragment) in pages[target].ids
