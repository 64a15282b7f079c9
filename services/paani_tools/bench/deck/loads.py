"""What one load of the page takes. Needs no browser."""

from __future__ import annotations

import msgspec


class PageLoad(msgspec.Struct, frozen=True):
    """From the first request to the first message of the boat [ms]; files, and bytes over the network with headers."""

    load_ms: float
    files: int
    bytes: int
