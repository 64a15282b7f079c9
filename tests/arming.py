"""The operator's hand: holds the button of the page, as a browser would, with the key that its owner has."""

from __future__ import annotations

import asyncio

import aiohttp

from paani.config import BusConfig
from paani.operator_key import ensure_operator_key
from paani_services.dashboard.gatekeeper import KEY_HEADER

REFRESH_S = 0.15
HOLDS = 3


def headers_of(page: str, bus: BusConfig) -> dict[str, str]:
    """What the page of this address sends with a request."""
    return {"Origin": page, KEY_HEADER: ensure_operator_key(bus)}


async def hold_on_page(page: str, bus: BusConfig, held_s: float = 1.3, press: int = 1) -> tuple[int, str]:
    """Hold the button for so long and let it go: status and text of the response."""
    headers, body = await asyncio.to_thread(headers_of, page, bus), {"press": press}
    async with aiohttp.ClientSession() as client:
        for _ in range(round(held_s / REFRESH_S)):
            async with client.post(f"{page}/api/arm/hold", json=body, headers=headers) as response:
                if response.status != 200:
                    return response.status, await response.text()
            await asyncio.sleep(REFRESH_S)
        async with client.post(f"{page}/api/arm/release", json=body, headers=headers) as response:
            return response.status, await response.text()


async def arm_on_page(page: str, bus: BusConfig, press: int = 1) -> None:
    """Arm, or fail. A hold that a busy machine interrupts is begun anew, as a person would."""
    status, text = await hold_on_page(page, bus, press=press)
    for again in range(1, HOLDS):
        if "the hold was interrupted" in text:
            status, text = await hold_on_page(page, bus, press=press + again)
    assert status == 200, text
