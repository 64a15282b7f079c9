"""Arms a simulated boat once, at the start, as a client of the operator's process; and says where the page is."""

from __future__ import annotations

import sys
from collections.abc import Callable

from paani.bus import open_bus
from paani.clock import Clock
from paani.config import Config
from paani.errors import UserError
from paani.messages import ArmRefusal
from paani.operator_client import OperatorClient
from paani.operator_key import ensure_operator_key, operator_key_path
from paani.page_address import is_page_exposed, page_origin

CLIENT = "arm"
ATTEMPTS = 5  # a process of a busy machine may miss a beat while everything starts


async def arm_once(config: Config, clock: Clock, say: Callable[[str], None]) -> None:
    """Hold the button once. What was stopped stays stopped, and is said to be.

    Raises UserError where there is no page on which a hand could release the STOP: the boat would lie still.
    """
    bus = await open_bus(config.bus, CLIENT, clock)
    try:
        client, refusal = OperatorClient(bus, clock), None
        for _ in range(ATTEMPTS):
            refusal = await client.hold_to_arm()
            if refusal is ArmRefusal.NONE:
                return
            if refusal in {ArmRefusal.LATCHED, ArmRefusal.STOPPED, ArmRefusal.NOT_WRITTEN}:
                break
        if refusal in {ArmRefusal.LATCHED, ArmRefusal.STOPPED} and not config.dashboard.serve:
            raise UserError(
                "not armed: a STOP holds, and without a page nobody can release it; start once without --headless and"
                ' hold "Hold to arm" there'
            )
        say("not armed: " + _why(refusal))
    finally:
        await bus.close()


def page_line(config: Config) -> str:
    """Where the page is; with the operator's key for a person at a terminal, and for a log without."""
    page = f"open {page_origin(config)}"
    key = ensure_operator_key(config.bus)
    return (
        f"{page}/{'login' if is_page_exposed(config) else ''}#key={key}"
        if sys.stdout.isatty()
        else f"{page} (key: {operator_key_path(config.bus)})"
    )


def _why(refusal: ArmRefusal | None) -> str:
    match refusal:
        case None:
            return "the operator's process does not answer"
        case ArmRefusal.LATCHED | ArmRefusal.STOPPED:
            return 'a STOP holds; a hand on the page releases it (hold "Hold to arm")'
        case ArmRefusal.NOT_WRITTEN:
            return "the STOP latch could not be written to disk"
        case _:
            return f'the operator\'s process refuses ({refusal.value.lower()}); hold "Hold to arm" on the page'
