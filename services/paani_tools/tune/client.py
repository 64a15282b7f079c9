"""Asks the dashboard, as its own page would."""

from __future__ import annotations

import http.client
import re

import msgspec

from paani.config import DashboardConfig
from paani.errors import UserError
from paani.messages import Shadow

TIMEOUT_S = 5.0
TOKEN = re.compile(r'paani-arm-token" content="([^"]+)"')


class Refused(msgspec.Struct, frozen=True):
    """What the dashboard says when it does not pass a request on."""

    error: str


class Client:
    """One request each to the dashboard of the configuration."""

    def __init__(self, config: DashboardConfig) -> None:
        self._config = config

    def status(self) -> Shadow:
        """The advisor's newest report. Raises UserError when there is none."""
        return self._report(*self._send("GET", "/api/tune"))

    def ask(self, deed: str, body: object) -> Shadow:
        """Ask to "propose", "promote" or "rollback"; the advisor's answer, which may refuse. Raises UserError."""
        status, page = self._send("GET", "/")
        found = TOKEN.search(page.decode(errors="replace"))
        if found is None:
            raise UserError(f"{self._origin}: answers {status}, but is no dashboard")
        return self._report(*self._send("POST", f"/api/tune/{deed}", msgspec.json.encode(body), found[1]))

    @property
    def _origin(self) -> str:
        return f"http://{self._config.host}:{self._config.port}"

    def _send(self, method: str, path: str, body: bytes | None = None, token: str = "") -> tuple[int, bytes]:
        connection = http.client.HTTPConnection(self._config.host, self._config.port, timeout=TIMEOUT_S)
        try:
            connection.request(method, path, body, {"Origin": self._origin, "X-Paani-Token": token})
            answer = connection.getresponse()
            return answer.status, answer.read()
        except (OSError, http.client.HTTPException) as error:
            cause = getattr(error, "strerror", None) or str(error)
            raise UserError(
                f"{self._origin}: {cause} (is a dashboard up at dashboard.host, dashboard.port?)"
            ) from error
        finally:
            connection.close()

    def _report(self, status: int, body: bytes) -> Shadow:
        try:
            if status in {http.client.OK, http.client.CONFLICT}:
                return msgspec.json.decode(body, type=Shadow)
            raise UserError(f"{self._origin}: {msgspec.json.decode(body, type=Refused).error}")
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise UserError(f"{self._origin}: answers {status}, but is no dashboard") from error
