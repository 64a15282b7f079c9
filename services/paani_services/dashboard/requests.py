"""Requests that the dashboard's server accepts, and from which pages. Pure."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from typing import Annotated, TypeVar
from urllib.parse import urlsplit

import msgspec

from paani.errors import one_line
from paani.undecodable import UNDECODABLE

MAX_PRESS = 2**53 - 1  # what a script of the page can count to

T = TypeVar("T")


class BadRequestError(Exception):
    """A malformed request: one line that says why, and the field at fault."""

    def __init__(self, text: str, field: str) -> None:
        super().__init__(one_line(text))
        self.field = one_line(field)


class PressRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The button that arms is held, or let go. `press`: a number of the page's for this press."""

    press: Annotated[int, msgspec.Meta(ge=1, le=MAX_PRESS)]


class SnapshotQuery(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`max_age_s`: an older picture is refused."""

    max_age_s: Annotated[float, msgspec.Meta(gt=0.0, le=3600.0)] = 5.0


class NoQuery(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A request without parameters."""


def decode_body(body: bytes, kind: type[T]) -> T:
    """The body as this type. Raises BadRequestError naming the field."""
    try:
        return msgspec.json.decode(body, type=kind)
    except UNDECODABLE as error:
        raise _bad_request(error, "body") from error


def decode_query(query: dict[str, str], kind: type[T]) -> T:
    """The query as this type. Raises BadRequestError naming the parameter."""
    try:
        return msgspec.convert(query, kind, strict=False)
    except UNDECODABLE as error:
        raise _bad_request(error, "query") from error


def is_own_host(host_header: str, names: Iterable[str]) -> bool:
    """Whether a Host header names this server by address, as localhost, or by one of these names.

    Any other name may belong to a foreign page whose name was made to resolve to this machine (DNS rebinding).
    """
    try:
        name = urlsplit(f"//{host_header}").hostname or ""
        if name not in {"localhost", *(each.lower() for each in names)}:
            ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_same_origin(origin: str | None, host_header: str) -> bool:
    """Whether the page that sent the request was served by this server."""
    return origin in {f"http://{host_header}", f"https://{host_header}"}


def _bad_request(error: Exception, whole: str) -> BadRequestError:
    text, _, path = str(error).partition(" - at ")
    field = path.strip("`").removeprefix("$").lstrip(".") or whole
    for marker in ("missing required field `", "unknown field `"):
        _, found, name = text.partition(marker)
        if found:
            field = name.rstrip("`").strip() or field
    return BadRequestError(f"{field}: {text}", field)
