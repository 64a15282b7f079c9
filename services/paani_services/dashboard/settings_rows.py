"""The settings as the page shows them: value, default, where the value comes from, unit and range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec
from aiohttp import web

from paani.config import Config, load_config
from paani.config.loading import ENV_PREFIX
from paani.config.tuning import TUNABLE
from paani.config.value_types import range_of, text_of, unit_of
from paani_services.dashboard.requests import NoQuery, decode_query
from paani_services.dashboard.responses import json_response

DEFAULT, PROFILE, ENVIRONMENT, GIVEN = "default", "profile", "environment", "file or --set"


class SettingRow(msgspec.Struct, frozen=True, kw_only=True):
    """One setting: value and default as one would write them, and where the value comes from.

    default: that of the profile in force. origin: `default`, `profile` (where that differs from the default),
    `environment`, or `file or --set`. limits: in words, a dash for none. tunable: it may be tried on a running boat.
    """

    path: str
    value: str
    default: str
    origin: str
    unit: str
    limits: str
    tunable: bool


class SettingRoutes:
    """Answers with the settings that this process was started with."""

    def __init__(self, config: Config, environ: Mapping[str, str]) -> None:
        self._rows = tuple(setting_rows(config, environ))

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/settings", self._settings)]

    async def _settings(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        return json_response(self._rows)


def setting_rows(config: Config, environ: Mapping[str, str]) -> Iterator[SettingRow]:
    """Every setting, in the order of the tree."""
    yield from _rows(config, load_config(profile=config.profile), Config(), environ, "")


def _rows(
    section: msgspec.Struct,
    of_profile: msgspec.Struct,
    defaults: msgspec.Struct,
    environ: Mapping[str, str],
    prefix: str,
) -> Iterator[SettingRow]:
    info = msgspec.inspect.type_info(type(section))
    assert isinstance(info, msgspec.inspect.StructType)
    for field in info.fields:
        value, expected, default = (getattr(each, field.name) for each in (section, of_profile, defaults))
        path = f"{prefix}{field.name}"
        if isinstance(value, msgspec.Struct):
            yield from _rows(value, expected, default, environ, f"{path}.")
            continue
        is_named = f"{ENV_PREFIX}{path.upper().replace('.', '__')}" in environ
        yield SettingRow(
            path=path,
            value=text_of(value),
            default=text_of(expected),
            origin=(ENVIRONMENT if is_named else GIVEN)
            if value != expected
            else PROFILE
            if value != default
            else DEFAULT,
            unit=unit_of(field.name),
            limits=range_of(field.type).replace("`", ""),  # which mark a pattern in Markdown
            tunable=path in TUNABLE,
        )
