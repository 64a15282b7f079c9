"""Shares of the pictures on which the advice was right or wrong, by source, with their intervals. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from paani.config import Config
from paani.messages import SIDE_OF, Advisory, Direction
from paani.statistics.figure_table import FigureTable
from paani_sim.trials.intervals import wilson_interval
from paani_tools.bench.advice.ahead import NOT_WATER, Ahead

ALL = "all"
STILL = (Direction.STOP, Direction.NO_DATA)


class Figure(NamedTuple):
    """One share: what is counted, of which pictures, and what it ought to be."""

    name: str
    asked_of: str
    bar: str


FIGURES = (
    Figure("person ahead, advised straight on", "person_ahead", "<= 0.03"),
    Figure("vessel ahead, advised straight on", "vessel_ahead", "<= 0.03"),
    Figure("advised lane not water, by the own mask", "own_mask", "0"),
    Figure("advised lane not water, by people's masks", "human_mask", "0"),
    Figure("open water ahead, advised straight on", "open_water", ">= 0.97"),
    Figure("person ahead, picture refused", "person_refused", ""),
)


class Judged(msgspec.Struct, frozen=True, kw_only=True):
    """One picture with its advice.

    counts: of each figure that the picture says something about (`Figure.asked_of`), whether it counts.
    """

    picture: str
    source: str
    sequence: str
    direction: Direction
    reason: str
    explanation: str
    counts: dict[str, bool]


def count_advice(ahead: Ahead, advisory: Advisory, own: float | None, human: float | None) -> dict[str, bool]:
    """What one picture adds to each figure.

    own, human: the share of the advised lane that is not water, by the segmenter and by people; None without an
    advised lane or without a mask.
    """
    is_straight = advisory.direction is Direction.STRAIGHT
    found = {}
    if ahead.person:
        found["person_ahead"] = is_straight
        found["person_refused"] = advisory.reason == "UNUSABLE_IMAGE"
    if ahead.vessel:
        found["vessel_ahead"] = is_straight
    if own is not None:
        found["own_mask"] = own > NOT_WATER
    if human is not None:
        found["human_mask"] = human > NOT_WATER
    if ahead.open_water:
        found["open_water"] = is_straight
    return found


def advised_lane(direction: Direction) -> str | None:
    """The lane that is advised; None where the boat is to stay where it is."""
    return None if direction in STILL else SIDE_OF.get(direction, "center")


def tabulate(judged: Sequence[Judged], side: str, config: Config) -> FigureTable:
    """Each figure over all sources and over each: pictures that count, pictures asked, share, 95 % interval."""
    rows = []
    for figure in FIGURES:
        asked: Counter[str] = Counter()
        counted: Counter[str] = Counter()
        for picture in judged:
            if figure.asked_of in picture.counts:
                for source in (ALL, picture.source):
                    asked[source] += 1
                    counted[source] += picture.counts[figure.asked_of]
        for source in [ALL, *sorted(set(asked) - {ALL})] if asked[ALL] else []:
            low, high = wilson_interval(counted[source], asked[source])
            share = counted[source] / asked[source]
            bar = figure.bar if source == ALL else ""
            rows.append((figure.name, source, counted[source], asked[source], share, low, high, bar))
    return FigureTable(
        name=f"advice on {len(judged)} annotated pictures, {side} sequences, profile {config.profile}",
        columns=("of the pictures with", "source", "count", "pictures", "share", "low", "high", "bar"),
        rows=tuple(rows),
        note="Each still is judged alone. Intervals are Wilson's, 95 %, over pictures; a sequence's are alike.",
    )
