"""The page's static files, read once, and the headers that restrict a browser to this server."""

from __future__ import annotations

from pathlib import Path

import msgspec

STATIC = Path(__file__).parent / "static"
MEDIA_TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".webmanifest": "application/manifest+json",
}
WORKER, LIST = "service_worker.js", "files.json"
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


class StaticFile(msgspec.Struct, frozen=True):
    media_type: str
    body: bytes


def load_static_files() -> dict[str, StaticFile]:
    """Every file of the page by name, whichever folder it lies in.

    `LIST` has their names, for the worker that keeps them in the browser.
    """
    pages = {}
    for path in sorted(STATIC.rglob("*")):
        media_type = MEDIA_TYPES.get(path.suffix)
        if media_type is not None:
            pages[path.name] = StaticFile(media_type, path.read_bytes())
    pages[LIST] = StaticFile("application/json", msgspec.json.encode([*pages]))
    return pages
