"""Heading of the boat: NMEA HDT and THS (true), HDG and HDM (magnetic), carried on by the gyro in between. Pure."""

import math
from typing import NamedTuple

from paani.geometry import wrap_rad
from paani_services.sensors.sentences import Sentence, course_rad

MAX_GAP_S = 0.2  # between samples of the gyro; across a longer gap a heading is not carried on
MAX_VARIATION_DEG = 180.0  # near the magnetic poles
PREFERRED = ("HDT", "THS", "HDG", "HDM")  # what is true first, then what may bring its own variation


class Heading(NamedTuple):
    """What one heading sentence says. `yaw_rad` is None where it gives no true heading; `problem` says why."""

    yaw_rad: float | None
    problem: str = ""


def read_heading(sentence: Sentence, variation_deg: float | None, offset_deg: float) -> Heading:
    """The yaw that HDT, THS, HDG or HDM gives.

    Magnetic headings become true ones by the variation in the sentence, or else by `variation_deg` (east positive).
    `offset_deg`: direction of the compass or antenna pair on the boat, clockwise from ahead. Raises ValueError for a
    damaged sentence.
    """
    magnetic_deg: float | None
    match sentence.kind:
        case "HDT":
            true_deg = sentence.number("headingT", 0.0, 360.0)
        case "THS":
            true_deg = sentence.number("headt", 0.0, 360.0)
            if sentence.text("mi") != "A":
                return Heading(None, f"THS in mode '{sentence.text('mi')}'")
        case _:
            magnetic_deg = sentence.number("headingM", 0.0, 360.0)
            own_deg = _signed(sentence, "variation") if sentence.kind == "HDG" else None
            deviation_deg = _signed(sentence, "deviation") if sentence.kind == "HDG" else None
            variation_deg = variation_deg if own_deg is None else own_deg
            if magnetic_deg is not None and variation_deg is None:
                return Heading(None, f"{sentence.kind} without variation: set sensors.variation_deg")
            true_deg = None if magnetic_deg is None else magnetic_deg + (variation_deg or 0.0) + (deviation_deg or 0.0)
    if true_deg is None:
        return Heading(None, f"{sentence.kind} is empty")
    return Heading(course_rad(true_deg - offset_deg))


def _signed(sentence: Sentence, name: str) -> float | None:
    """Deviation or variation [deg], east positive."""
    value, side = sentence.number(name, 0.0, MAX_VARIATION_DEG), sentence.text(f"{name}EW")
    if value is None:
        return None
    if side not in {"E", "W"}:
        raise ValueError(f"{sentence.kind} {name}EW: {side}")
    return value if side == "E" else -value


class SourceChoice:
    """Which instrument gives the heading where several do: two that differ would turn the boat from one to the other.

    One that is preferred takes over at once, any other after the present one gave none for `silent_s`.
    """

    def __init__(self, silent_s: float) -> None:
        self._silent_s = silent_s
        self._chosen: Sentence | None = None  # its newest
        self._chosen_us = 0

    def takes(self, sentence: Sentence, now_us: int) -> bool:
        """Whether a heading of this sentence is to be used."""
        chosen = self._chosen if (now_us - self._chosen_us) * 1e-6 <= self._silent_s else None
        if chosen is not None and sentence.source != chosen.source and _rank(sentence) >= _rank(chosen):
            return False
        self._chosen, self._chosen_us = sentence, now_us
        return True


def _rank(sentence: Sentence) -> int:
    return PREFERRED.index(sentence.kind)


class YawKeeper:
    """The newest heading, turned on by the gyro until the next one comes, or until it is `max_age_s` old."""

    def __init__(self, max_age_s: float) -> None:
        self._max_age_s = max_age_s
        self._yaw_rad: float | None = None
        self._heading_us = self._sample_us = 0

    def take_heading(self, yaw_rad: float, at_us: int) -> None:
        """A new heading."""
        self._yaw_rad, self._heading_us = yaw_rad, at_us

    def forget(self) -> None:
        """The heading cannot be believed any more."""
        self._yaw_rad = None

    def take_sample(self, yaw_rate_radps: float, at_us: int) -> float | None:
        """Yaw at a sample of the gyro; None without a heading that is new enough."""
        since_s = (at_us - max(self._sample_us, self._heading_us)) * 1e-6
        self._sample_us = at_us
        if self._yaw_rad is None or (at_us - self._heading_us) * 1e-6 > self._max_age_s:
            return None
        if since_s > MAX_GAP_S:
            self._yaw_rad = None
            return None
        self._yaw_rad = wrap_rad(self._yaw_rad + yaw_rate_radps * max(since_s, 0.0))
        return self._yaw_rad


def true_yaw_rad(yaw_rad: float, reference: str, variation_deg: float | None) -> float | None:
    """Yaw in the map of one that an IMU gives against `reference`: true or magnetic north; None where it is unknown."""
    if reference == "true":
        return yaw_rad
    if reference == "magnetic" and variation_deg is not None:
        return wrap_rad(yaw_rad - math.radians(variation_deg))
    return None
