"""How often advice changes its mind. Pure; for recordings, trials and benchmarks."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from paani.messages import INPUT_FAULTS, SIDE_OF, Advisory, Direction

STILL = (Direction.STOP, Direction.NO_DATA)
PAUSE_S = 5.0  # longer silence, a restart or time going backwards parts one run from the next


class Dithering(msgspec.Struct, frozen=True, kw_only=True):
    """Changes in a run of advisories, and how many that is a minute (0 where no time passed).

    changes: a direction other than the one before; interruptions: those of them that begin or end with a fault of the
    input, which no policy can help. side_flips: a turn to the other side than the last turn, with no
    STRAIGHT between. stop_go_flips: from a direction that moves the boat to one that does not, or back.
    """

    seconds: float = 0.0
    changes: int = 0
    interruptions: int = 0
    side_flips: int = 0
    stop_go_flips: int = 0
    changes_per_min: float = 0.0
    interruptions_per_min: float = 0.0
    side_flips_per_min: float = 0.0
    stop_go_flips_per_min: float = 0.0


def dithering(advice: Iterable[Advisory]) -> Dithering:
    """Count over advisories in the order they were given, republished ones and all."""
    last: Advisory | None = None
    side: str | None = None
    elapsed_us = changes = interruptions = side_flips = stop_go = 0
    for given in advice:
        gap_us = _given_us(given) - _given_us(last) if last is not None else -1
        if last is None or given.epoch != last.epoch or not 0 <= gap_us <= PAUSE_S * 1e6:
            last, side = given, SIDE_OF.get(given.direction)
            continue
        elapsed_us += gap_us
        if given.direction is not last.direction:
            changes += 1
            interruptions += given.reason in INPUT_FAULTS or last.reason in INPUT_FAULTS
        stop_go += (given.direction in STILL) is not (last.direction in STILL)
        turned = SIDE_OF.get(given.direction)
        side_flips += turned is not None and side is not None and turned != side
        if turned is not None or given.direction is Direction.STRAIGHT:
            side = turned
        last = given
    per_min = 60e6 / elapsed_us if elapsed_us else 0.0
    return Dithering(
        seconds=elapsed_us * 1e-6,
        changes=changes,
        interruptions=interruptions,
        side_flips=side_flips,
        stop_go_flips=stop_go,
        changes_per_min=round(changes * per_min, 3),
        interruptions_per_min=round(interruptions * per_min, 3),
        side_flips_per_min=round(side_flips * per_min, 3),
        stop_go_flips_per_min=round(stop_go * per_min, 3),
    )


def _given_us(advisory: Advisory) -> int:
    """When it was given: the date of its evidence and that evidence's age."""
    return advisory.source_us + round(advisory.evidence_age_s * 1e6)
