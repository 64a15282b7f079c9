"""Sessions of those who gave the operator's key, by a token that their browser keeps. Pure; in memory alone."""

from __future__ import annotations

import hashlib
import secrets

LIFETIME_S = 12 * 3600.0  # a day on the water; then the key is asked for again
MAX_SESSIONS = 32  # one more takes the place of the oldest


class Sessions:
    """Tokens in force. A restart of the process ends all of them, as nothing of them is kept."""

    def __init__(self) -> None:
        self._ends_us: dict[bytes, int] = {}  # by the SHA-256 of the token, in the order they began

    def begin(self, now_us: int) -> str:
        """A new token, of 256 random bits."""
        token = secrets.token_urlsafe(32)
        while len(self._ends_us) >= MAX_SESSIONS:
            del self._ends_us[next(iter(self._ends_us))]
        self._ends_us[_digest(token)] = now_us + round(LIFETIME_S * 1e6)
        return token

    def is_valid(self, token: str, now_us: int) -> bool:
        """False for a token that is none, whose session was ended, or that is too old."""
        return now_us < self._ends_us.get(_digest(token), 0)

    def end(self, token: str) -> None:
        """From now on the token opens nothing."""
        self._ends_us.pop(_digest(token), None)


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode(errors="surrogateescape")).digest()
