"""Asks the dashboard, as its own page would."""

from __future__ import annotations

import http.client

import msgspec

from paani.config import Config
from paani.errors import UserError
from paani.messages import Shadow
from paani.operator_key import ensure_operator_key
from paani.page_address import page_origin
from paani.page_connection import connect_to_page
from paani.undecodable import UNDECODABLE

TIMEOUT_S = 5.0


class Refused(msgspec.Struct, frozen=True):
    """What the dashboard says when it does not pass a request on."""

    error: str


class Client:
    """One request each to the dashboard of the configuration."""

    def __init__(self, config: Config) -> None:
        self._config, self._origin = config, page_origin(config)

    def status(self) -> Shadow:
        """The advisor's newest report. Raises UserError when there is none."""
        return self._report(*self._send("GET", "/api/tune"))

    def ask(self, deed: str, body: object) -> Shadow:
        """Ask to "propose", "promote" or "rollback"; the advisor's report. Raises UserError, for a refusal too."""
        status, answer = self._send("POST", f"/api/tune/{deed}", msgspec.json.encode(body))
        return self._report(status, answer, f"{deed} refused: " if status == http.client.CONFLICT else "")

    def _send(self, method: str, path: str, body: bytes | None = None) -> tuple[int, bytes]:
        headers = {"Origin": self._origin, "X-Paani-Key": ensure_operator_key(self._config.bus)}
        connection = connect_to_page(self._config, TIMEOUT_S)
        try:
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            return answer.status, answer.read()
        except (OSError, http.client.HTTPException) as error:
            cause = getattr(error, "strerror", None) or str(error)
            raise UserError(
                f"{self._origin}: {cause} (is a dashboard up at dashboard.host, dashboard.port?)"
            ) from error
        finally:
            connection.close()

    def _report(self, status: int, body: bytes, what: str = "") -> Shadow:
        try:
            if status == http.client.OK:
                return msgspec.json.decode(body, type=Shadow)
            raise UserError(f"{self._origin}: {what}{msgspec.json.decode(body, type=Refused).error}")
        except UNDECODABLE as error:
            raise UserError(f"{self._origin}: answers {status}, but is no dashboard") from error
