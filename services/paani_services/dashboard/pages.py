"""The page's files, read once, and the headers that keep a browser to this server alone."""

from __future__ import annotations

from pathlib import Path

import msgspec

STATIC = Path(__file__).parent / "static"
MEDIA_TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}
TOKEN_MARK = "{{arm-token}}"
SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'none';"
        " frame-ancestors 'none'; object-src 'none'"
    ),
    "Cache-Control": "no-cache",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class Page(msgspec.Struct, frozen=True):
    media_type: str
    body: bytes


def load_pages(token: str) -> dict[str, Page]:
    """Every file of the page by name; the arm token is written into `index.html`."""
    pages = {}
    for path in sorted(STATIC.iterdir()):
        media_type = MEDIA_TYPES.get(path.suffix)
        if media_type is not None:
            text = path.read_text(encoding="utf-8").replace(TOKEN_MARK, token)
            pages[path.name] = Page(media_type, text.encode())
    return pages
