"""What the microcontroller says of itself, and the state of the process that shows it the advice."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.advisor import Direction, Reason
from paani.messages.header import Count, Message, NonNegative, Text


class McuState(StrEnum):
    """How far the microcontroller trusts what it was sent; in every state but FRESH it shows STOP.

    BOOT: nothing accepted since it started. FRESH: the lease of the newest frame runs. STALE: it ran out. SAFE: it ran
    out long ago; a newer frame ends it. UNKNOWN: the microcontroller has not answered.
    """

    BOOT = "boot"
    FRESH = "fresh"
    STALE = "stale"
    SAFE = "safe"
    UNKNOWN = "unknown"


class McuVerdict(StrEnum):
    """What the microcontroller makes of a frame; every verdict but ACCEPTED and NONE is a refusal with its cause."""

    ACCEPTED = "accepted"
    CRC = "crc"
    VERSION = "version"
    RANGE = "range"
    REPLAYED = "replayed"
    FOREIGN_SESSION = "foreign_session"
    EXPIRED = "expired"
    LEASE = "lease"
    NOT_CONFIGURED = "not_configured"
    LOCKED = "locked"
    FRAMING = "framing"
    NONE = "none"


class ResetCause(StrEnum):
    """Why the microcontroller started."""

    POWER_ON = "power_on"
    PIN = "pin"
    WATCHDOG = "watchdog"
    SOFTWARE = "software"
    UNKNOWN = "unknown"


class BridgeState(Message, frozen=True, kw_only=True):
    """The line to the microcontroller that shows the advice; `source_us` is when this was written.

    problem: one line that names the device; empty while answers come and frames are accepted.
    direction, reason: what was last sent. display: what the microcontroller last said that it shows.
    answer_age_ms: since the newest answer, 1e9 before the first. refused_*: the microcontroller's counts by cause since
    it started. unanswered: calls without an answer in time. junk_bytes: received and part of no message.
    """

    line: Text
    connected: bool
    problem: Text = ""
    direction: Direction = Direction.NO_DATA
    reason: Reason = Reason.NO_EVIDENCE
    display: Direction = Direction.NO_DATA
    mcu: McuState = McuState.UNKNOWN
    verdict: McuVerdict = McuVerdict.NONE
    session: Count = 0
    sent: Count = 0
    answered: Count = 0
    unanswered: Count = 0
    late: Count = 0
    junk_bytes: Count = 0
    connections: Count = 0
    answer_age_ms: NonNegative = 1e9
    round_trip_p50_ms: NonNegative = 0.0
    round_trip_p95_ms: NonNegative = 0.0
    boot_count: Count = 0
    reset_cause: ResetCause = ResetCause.UNKNOWN
    mcu_ms: Count = 0
    lease_left_ms: Count = 0
    accepted: Count = 0
    refused_crc: Count = 0
    refused_version: Count = 0
    refused_range: Count = 0
    refused_replayed: Count = 0
    refused_foreign_session: Count = 0
    refused_expired: Count = 0
    refused_lease: Count = 0
    refused_framing: Count = 0
