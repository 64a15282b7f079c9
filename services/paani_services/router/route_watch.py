"""Whether what the board says comes through the two routers, and not only over the link between them.

After a link was lost, Zenoh may join two routers anew in such a way that nothing passes, for ever (eclipse-zenoh/zenoh,
issue 1886). The connection that pulls pictures is another one, so what is heard there says whether the link is there.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

WATCHED = "advisor"  # of every board, and without it no boat moves
SILENT_S = 5.0  # ten times what two routers take to meet again (deploy/README.md, "link cut")
HEARD_S = 1.0  # of a pulse ten times a second, on a busy machine as well
PERIOD_S = 0.2


class PulseInput(Protocol):
    """A topic as one connection hears it."""

    def receipt_age_s(self) -> float:
        """Seconds since the last message came; infinite before the first."""
        ...


async def watch_route(direct: PulseInput, routed: PulseInput, silent_s: float = SILENT_S) -> None:
    """Return never while what is heard directly also comes by the routers.

    Raises ConnectionError when for so long [s] it was there at every look, and nothing came here.
    """
    looks = 0
    while looks * PERIOD_S < silent_s:
        await asyncio.sleep(PERIOD_S)
        is_silent = routed.receipt_age_s() > max(HEARD_S, looks * PERIOD_S)
        looks = looks + 1 if is_silent and direct.receipt_age_s() <= HEARD_S else 0
    raise ConnectionError(f"the board is heard, but for {silent_s:g} s not through its router and this one")
