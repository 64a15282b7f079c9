"""The payloads of the microcontroller's calls, to and from bytes. `mcu/README.md` defines them.

Little-endian, of fixed size; the last two bytes are a CRC over all before them, which holds from end to end whatever
carries the payload.
"""

from __future__ import annotations

import binascii
import struct
from typing import ClassVar

import msgspec

from paani.messages import Direction, McuState, McuVerdict, ResetCause

VERSION = 1
CRC_BYTES = 2
MIN_LEASE_MS, MAX_LEASE_MS = 50, 4000  # of guidance
MAX_THRUST_LEASE_MS = 300
MAX_SESSION, MAX_SEQ = 0xFFFF, 0xFFFF_FFFF  # a session is never 0
UNKNOWN_RISK = 255  # instead of a percentage
FULL_THRUST = 10_000  # thrust of 1.0

# The code of each is its place.
DIRECTIONS = (
    Direction.NO_DATA,
    Direction.STRAIGHT,
    Direction.SLIGHT_LEFT,
    Direction.SLIGHT_RIGHT,
    Direction.LEFT,
    Direction.RIGHT,
    Direction.STOP,
)
STATES = (McuState.BOOT, McuState.FRESH, McuState.STALE, McuState.SAFE)
VERDICTS = tuple(verdict for verdict in McuVerdict if verdict is not McuVerdict.NONE)
NO_VERDICT = 255
RESET_CAUSES = tuple(ResetCause)
INDICATION, THRUST = 1, 2  # kinds of status: of the line for guidance, of the line for thrust


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, begins with 0xFFFF, neither reflected nor inverted."""
    return binascii.crc_hqx(data, 0xFFFF)


def append_crc(data: bytes) -> bytes:
    """The bytes with their CRC behind them."""
    return data + crc16(data).to_bytes(CRC_BYTES, "little")


def has_valid_crc(payload: bytes) -> bool:
    """Whether the last two bytes are the CRC of those before them."""
    return len(payload) > CRC_BYTES and append_crc(payload[:-CRC_BYTES]) == payload


class Guide(msgspec.Struct, frozen=True, kw_only=True):
    """`paani_guide`: what to show. Risks are in percent or `UNKNOWN_RISK`; `age_ms` is how old the advice is."""

    FORMAT: ClassVar[struct.Struct] = struct.Struct("<BBHIHH3BBH")

    direction: Direction
    session: int
    seq: int
    lease_ms: int
    reason: int = 0
    risks: tuple[int, int, int] = (UNKNOWN_RISK, UNKNOWN_RISK, UNKNOWN_RISK)
    age_ms: int = 0

    def encode(self) -> bytes:
        """20 bytes. Raises ValueError for what no field holds."""
        _require(1 <= self.session <= MAX_SESSION, "session")
        _require(MIN_LEASE_MS <= self.lease_ms <= MAX_LEASE_MS, "lease_ms")
        _require(all(0 <= risk <= 100 or risk == UNKNOWN_RISK for risk in self.risks), "risks")
        return _pack(
            self.FORMAT,
            *(VERSION, DIRECTIONS.index(self.direction), self.session, self.seq, self.lease_ms, self.reason),
            *(*self.risks, 0, self.age_ms),
        )

    @classmethod
    def decode(cls, payload: bytes) -> Guide | None:
        """The guidance in 20 bytes, or None for what is none."""
        fields = _unpack(cls.FORMAT, payload)
        if fields is None:
            return None
        _, direction, session, seq, lease_ms, reason, left, center, right, _, age_ms = fields
        if direction >= len(DIRECTIONS):
            return None
        return cls(
            direction=DIRECTIONS[direction],
            session=session,
            seq=seq,
            lease_ms=lease_ms,
            reason=reason,
            risks=(left, center, right),
            age_ms=age_ms,
        )


class ThrustCall(msgspec.Struct, frozen=True, kw_only=True):
    """`paani_thrust`: normalised thrust of both sides, -1 to 1, and whether the operator has armed the boat."""

    FORMAT: ClassVar[struct.Struct] = struct.Struct("<BBHIHhhH")

    armed: bool
    session: int
    seq: int
    lease_ms: int
    left: float
    right: float
    age_ms: int = 0

    def encode(self) -> bytes:
        """18 bytes. Raises ValueError for what no field holds."""
        _require(1 <= self.session <= MAX_SESSION, "session")
        _require(MIN_LEASE_MS <= self.lease_ms <= MAX_THRUST_LEASE_MS, "lease_ms")
        _require(all(-1.0 <= side <= 1.0 for side in (self.left, self.right)), "left, right")
        sides = (round(side * FULL_THRUST) for side in (self.left, self.right))
        return _pack(self.FORMAT, VERSION, int(self.armed), self.session, self.seq, self.lease_ms, *sides, self.age_ms)

    @classmethod
    def decode(cls, payload: bytes) -> ThrustCall | None:
        """The call in 18 bytes, or None for what is none."""
        fields = _unpack(cls.FORMAT, payload)
        if fields is None:
            return None
        _, flags, session, seq, lease_ms, left, right, age_ms = fields
        return cls(
            armed=bool(flags & 1),
            session=session,
            seq=seq,
            lease_ms=lease_ms,
            left=left / FULL_THRUST,
            right=right / FULL_THRUST,
            age_ms=age_ms,
        )


class EscSettings(msgspec.Struct, frozen=True, kw_only=True):
    """`paani_esc`: how both speed controllers are driven. A battery or current limit of 0 is no limit."""

    FORMAT: ClassVar[struct.Struct] = struct.Struct("<BBHhhHHHHHHHH")

    session: int
    left_reversed: bool = False
    right_reversed: bool = False
    trim_left_us: int = 0
    trim_right_us: int = 0
    neutral_us: int = 1500
    span_us: int = 400
    deadband_left_us: int = 0
    deadband_right_us: int = 0
    slew_per_s: float = 1.0
    min_battery_v: float = 0.0
    max_current_a: float = 0.0

    def encode(self) -> bytes:
        """26 bytes. Raises ValueError for what no field holds."""
        _require(1 <= self.session <= MAX_SESSION, "session")
        _require(all(-200 <= trim <= 200 for trim in (self.trim_left_us, self.trim_right_us)), "trim_us")
        _require(1400 <= self.neutral_us <= 1600, "neutral_us")
        _require(100 <= self.span_us <= 500, "span_us")
        _require(all(0 <= band <= 100 for band in (self.deadband_left_us, self.deadband_right_us)), "deadband_us")
        slew = round(self.slew_per_s * 1000)
        _require(100 <= slew <= 10_000, "slew_per_s")
        return _pack(
            self.FORMAT,
            *(VERSION, int(self.left_reversed) | int(self.right_reversed) << 1, self.session),
            *(self.trim_left_us, self.trim_right_us, self.neutral_us, self.span_us),
            *(self.deadband_left_us, self.deadband_right_us, slew),
            *(round(self.min_battery_v * 1000), round(self.max_current_a * 100), 0),
        )

    @classmethod
    def decode(cls, payload: bytes) -> EscSettings | None:
        """The settings in 26 bytes, or None for what are none."""
        fields = _unpack(cls.FORMAT, payload)
        if fields is None:
            return None
        _, flags, session, trim_left, trim_right, neutral, span, band_left, band_right, slew, battery, current, _ = (
            fields
        )
        return cls(
            session=session,
            left_reversed=bool(flags & 1),
            right_reversed=bool(flags & 2),
            trim_left_us=trim_left,
            trim_right_us=trim_right,
            neutral_us=neutral,
            span_us=span,
            deadband_left_us=band_left,
            deadband_right_us=band_right,
            slew_per_s=slew / 1000,
            min_battery_v=battery / 1000,
            max_current_a=current / 100,
        )


class Refusals(msgspec.Struct, frozen=True, kw_only=True):
    """Frames refused since the microcontroller started, by cause; each count stays at 65535."""

    crc: int = 0
    version: int = 0
    range: int = 0
    replayed: int = 0
    foreign_session: int = 0
    expired: int = 0
    lease: int = 0
    not_ready: int = 0  # not configured, or settings while thrust is live
    framing: int = 0


class McuStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What the microcontroller says of one of its lines.

    verdict: of the frame that this answers. display: the direction on the matrix (indication). holds: bits of what
    keeps the thrusters still (thrust): 1 emergency stop, 2 receiver, 4 battery low, 8 over-current, 16 not armed.
    pulse_*_us: as read back from the timer. rc: 0 no receiver, 1 stands by, 2 has taken over.
    """

    FORMAT: ClassVar[struct.Struct] = struct.Struct("<BBBBHHIIBBH10HHHHhBB")

    kind: int
    state: McuState
    verdict: McuVerdict = McuVerdict.NONE
    session: int = 0
    boot_count: int = 0
    seq: int = 0
    mcu_ms: int = 0
    reset_cause: ResetCause = ResetCause.UNKNOWN
    display: Direction = Direction.NO_DATA
    holds: int = 0
    lease_left_ms: int = 0
    accepted: int = 0
    refusals: Refusals = Refusals()
    pulse_left_us: int = 0
    pulse_right_us: int = 0
    battery_v: float = 0.0
    current_a: float = 0.0
    enabled: bool = False
    rc: int = 0

    def encode(self) -> bytes:
        """52 bytes. Raises ValueError for what no field holds."""
        verdict = NO_VERDICT if self.verdict is McuVerdict.NONE else VERDICTS.index(self.verdict)
        display = DIRECTIONS.index(self.display) if self.kind == INDICATION else self.holds
        return _pack(
            self.FORMAT,
            *(VERSION, self.kind, STATES.index(self.state), verdict, self.session, self.boot_count),
            *(self.seq, self.mcu_ms, RESET_CAUSES.index(self.reset_cause), display, self.lease_left_ms),
            *(self.accepted, *msgspec.structs.astuple(self.refusals), self.pulse_left_us, self.pulse_right_us),
            *(round(self.battery_v * 1000), round(self.current_a * 100), int(self.enabled), self.rc),
        )

    @classmethod
    def decode(cls, payload: bytes) -> McuStatus | None:
        """The status in 52 bytes, or None for what is none."""
        fields = _unpack(cls.FORMAT, payload)
        if fields is None:
            return None
        _, kind, state, verdict, session, boot_count, seq, mcu_ms, cause, display, lease_left_ms, accepted = fields[:12]
        *refused, pulse_left, pulse_right, battery, current, enabled, rc = fields[12:]
        if kind not in {INDICATION, THRUST} or state >= len(STATES) or cause >= len(RESET_CAUSES):
            return None
        if verdict != NO_VERDICT and verdict >= len(VERDICTS):
            return None
        if kind == INDICATION and display >= len(DIRECTIONS):
            return None
        return cls(
            kind=kind,
            state=STATES[state],
            verdict=McuVerdict.NONE if verdict == NO_VERDICT else VERDICTS[verdict],
            session=session,
            boot_count=boot_count,
            seq=seq,
            mcu_ms=mcu_ms,
            reset_cause=RESET_CAUSES[cause],
            display=DIRECTIONS[display] if kind == INDICATION else Direction.NO_DATA,
            holds=display if kind == THRUST else 0,
            lease_left_ms=lease_left_ms,
            accepted=accepted,
            refusals=Refusals(**dict(zip(Refusals.__struct_fields__, refused, strict=True))),
            pulse_left_us=pulse_left,
            pulse_right_us=pulse_right,
            battery_v=battery / 1000,
            current_a=current / 100,
            enabled=bool(enabled),
            rc=rc,
        )


def version_of(payload: bytes) -> int:
    """The protocol's version that an intact payload is written in."""
    return payload[0]


def _require(holds: bool, field: str) -> None:
    if not holds:
        raise ValueError(f"{field} out of range")


def _pack(form: struct.Struct, *fields: int) -> bytes:
    try:
        return append_crc(form.pack(*fields))
    except struct.error as error:
        raise ValueError(str(error)) from error


def _unpack(form: struct.Struct, payload: bytes) -> tuple[int, ...] | None:
    """The fields of an intact payload of this version, or None."""
    if len(payload) != form.size + CRC_BYTES or not has_valid_crc(payload) or version_of(payload) != VERSION:
        return None
    return form.unpack(payload[:-CRC_BYTES])
