"""The command line, run as a user runs it, beside a running bus."""

from __future__ import annotations

import asyncio
import sys

LIMIT_S = 60.0


async def paani(sets: tuple[str, ...], *words: str) -> tuple[int | None, str, str]:
    """Run `paani` with these words and settings: exit code, output, errors."""
    settings = [word for setting in sets for word in ("--set", setting)]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani", *words, *settings, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    async with asyncio.timeout(LIMIT_S):
        out, errors = await process.communicate()
    return process.returncode, out.decode(), errors.decode()
