"""The dashboard's answer to `GET /api/status`: what the boat sees, advises and runs, at the moment of the request."""

from __future__ import annotations

import msgspec

from paani.messages import Advisory, Evidence, PictureHeader
from paani.messages.header import Count, NonNegative, Stamp, Text

STATUS_PATH = "/api/status"


class ProcessStatus(msgspec.Struct, frozen=True, kw_only=True):
    """One process. `starts`: how many starts of it the dashboard has seen; the rest is of its newest health report."""

    service: Text
    alive: bool
    starts: Count = 0
    cpu_cores: NonNegative = 0.0
    rss_mib: NonNegative = 0.0
    drops: Count = 0


class BoardStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The newest message of each kind, None before the first; ages are since the dashboard received it [s]."""

    now_us: Stamp
    profile: Text
    picture: PictureHeader | None = None
    evidence: Evidence | None = None
    evidence_age_s: NonNegative = 0.0
    advisory: Advisory | None = None
    advisory_age_s: NonNegative = 0.0
    processes: tuple[ProcessStatus, ...] = ()
