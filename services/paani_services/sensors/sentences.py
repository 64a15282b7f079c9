"""NMEA 0183 (IEC 61162-1) sentences, read by pynmeagps and then held to what their fields may contain. Pure.

pynmeagps verifies the checksum and converts the fields, but takes what Python takes for a number (`nan`, `1e99`,
`1_0`), 77 minutes of arc and any hemisphere, and leaves out what a short sentence lacks. Here all that is damage.
"""

import datetime as dt
import math
import re
from collections.abc import Mapping
from typing import Any

from pynmeagps import NMEAReader
from pynmeagps.exceptions import NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError
from pynmeagps.nmeahelpers import calc_checksum, get_parts
from pynmeagps.nmeatypes_get import NMEA_PAYLOADS_GET
from pynmeagps.nmeatypes_get_prop import NMEA_PAYLOADS_GET_PROP

_NUMBER = re.compile(r"[+-]?[0-9]{1,10}(\.[0-9]{0,9})?", re.ASCII)
_TIME = re.compile(r"[0-9]{6}(\.[0-9]{1,6})?", re.ASCII)
_LIBRARY_ERRORS = (
    NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError,
    IndexError, KeyError, AttributeError, TypeError, ValueError, ArithmeticError,
)  # fmt: skip

# The sentences that are read, and the fields they must have at least.
READ_SENTENCES = {
    "RMC": 8, "GGA": 8, "GLL": 6, "VTG": 5, "GST": 8,
    "DPT": 1, "DBT": 4,
    "HDT": 1, "HDG": 5, "HDM": 1, "THS": 2,
    "PQTMIMU": 7, "VNYMR": 12,
}  # fmt: skip
VNYMR_FIELDS = (
    "yaw", "pitch", "roll", "magX", "magY", "magZ", "accX", "accY", "accZ", "gyroX", "gyroY", "gyroZ",
)  # fmt: skip


class ChecksumError(ValueError):
    """The checksum is missing or does not fit the sentence."""


class Sentence:
    """One intact sentence. Fields go by pynmeagps's names; every reader raises ValueError for an impossible value."""

    def __init__(self, kind: str, texts: Mapping[str, str], values: Any) -> None:
        self.kind = kind
        self._texts, self._values = texts, values

    @property
    def source(self) -> str:
        """Talker and kind: one stream of an instrument, where several speak on a line."""
        return f"{self._values.talker}{self.kind}"

    def text(self, name: str) -> str:
        """The field as it was written, "" where it is missing."""
        return self._texts.get(name, "")

    def number(self, name: str, low: float = -1e9, high: float = 1e9) -> float | None:
        """A plain decimal number between two limits; None where the field is empty."""
        text = self.text(name)
        if not text:
            return None
        if not _NUMBER.fullmatch(text) or not low <= float(text) <= high:
            raise ValueError(f"{self.kind} {name}: {text}")
        return float(text)

    def day_s(self, name: str = "time") -> float | None:
        """Seconds of the day, UTC; None where the field is empty."""
        text = self.text(name)
        if not text:
            return None
        value = getattr(self._values, name, "")
        if not _TIME.fullmatch(text) or not isinstance(value, dt.time):
            raise ValueError(f"{self.kind} {name}: {text}")
        return value.hour * 3600.0 + value.minute * 60.0 + value.second + value.microsecond * 1e-6

    def angle_deg(self, name: str, side_name: str, limit_deg: float) -> float | None:
        """Latitude or longitude [deg]; None where the field is empty."""
        text, side = self.text(name), self.text(side_name)
        if not text:
            return None
        value = getattr(self._values, name, "")
        self.number(name, 0.0)
        has_minutes = float(text) % 100.0 < 60.0
        if not isinstance(value, float) or abs(value) > limit_deg or not has_minutes or side not in _SIDES[side_name]:
            raise ValueError(f"{self.kind} {name}: {text} {side}")
        return value


_SIDES = {"NS": ("N", "S"), "EW": ("E", "W")}


def read_sentence(data: bytes) -> tuple[str, Sentence | None]:
    """Its kind, and the sentence if it is one of `READ_SENTENCES`. Those of AIS begin with `!`.

    Raises ChecksumError, and ValueError for one that is damaged in another way.
    """
    try:
        content, talker, formatter, _, checksum = get_parts(data.strip().lstrip(b"!"))
    except _LIBRARY_ERRORS as error:
        raise ChecksumError("no checksum") from error
    if checksum.upper() != calc_checksum(content):
        raise ChecksumError(content)
    kind = formatter if talker + formatter not in READ_SENTENCES else talker + formatter
    if kind not in READ_SENTENCES:
        return talker + formatter if talker == "P" else formatter, None
    try:
        message = NMEAReader.parse(data)
    except _LIBRARY_ERRORS as error:
        raise ValueError(f"{kind}: {error}") from error
    if message is None or len(message.payload) < READ_SENTENCES[kind]:
        raise ValueError(f"{kind}: too few fields")
    return kind, Sentence(kind, dict(zip(_field_names(kind), message.payload, strict=False)), message)


def _field_names(kind: str) -> tuple[str, ...]:
    if kind == "VNYMR":
        return VNYMR_FIELDS
    return tuple(NMEA_PAYLOADS_GET.get(kind) or NMEA_PAYLOADS_GET_PROP[kind[1:]])


def course_rad(course_deg: float) -> float:
    """ENU angle in [-pi, pi) of a direction in degrees clockwise from north."""
    return math.radians(math.remainder(90.0 - course_deg, 360.0))
