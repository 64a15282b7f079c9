"""Soundings from DPT and DBT sentences (NMEA 0183). Pure.

Both give the depth below the transducer. What a device says of its own offset differs from maker to maker, so the
setting alone counts. A sounder that writes both says one sounding twice: the kind that came first is read.
"""

from collections import Counter

from paani.messages import Depth
from paani.messages.depth import MAX_DEPTH_M
from paani_services.sensors.sentences import Sentence

DEPTH_SENTENCES = frozenset({"DPT", "DBT"})
FOOT_M = 0.3048


class DepthDecoder:
    """Sentences in, soundings out. `transducer_m`: how deep the transducer lies below the water's surface."""

    def __init__(self, drops: Counter[str], transducer_m: float) -> None:
        self._drops, self._transducer_m = drops, transducer_m
        self._kind = ""
        self._last_us = 0

    def take_sentence(self, sentence: Sentence, now_us: int) -> Depth | None:
        """The sounding of one of `DEPTH_SENTENCES`; without an echo it has no depth. None where it is refused.

        Raises ValueError for a depth that is no number.
        """
        self._kind = self._kind or sentence.kind
        if sentence.kind != self._kind:
            return None
        below_m = _depth_below_transducer_m(sentence)
        if below_m is not None and below_m < 0.0:
            self._drops["sonar_negative"] += 1
            return None
        if below_m is not None and below_m + self._transducer_m > MAX_DEPTH_M:
            self._drops["sonar_too_deep"] += 1
            return None
        self._last_us = max(now_us, self._last_us + 1)
        if below_m is None or below_m == 0.0:
            self._drops["sonar_no_echo"] += 1
            return Depth(source_us=self._last_us, available=False)
        return Depth(source_us=self._last_us, depth_m=below_m + self._transducer_m)


def _depth_below_transducer_m(sentence: Sentence) -> float | None:
    """In metres, or in feet where a DBT gives those alone; None where all its fields are empty."""
    if sentence.kind == "DPT":
        return sentence.number("depth")
    depth_m, depth_ft = sentence.number("depthm"), sentence.number("depthf")
    return depth_m if depth_m is not None or depth_ft is None else depth_ft * FOOT_M
