"""Each still shown eight times, a black picture, and what is said when no picture comes any more."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np

from paani.config import Config
from paani.errors import UserError
from paani.messages import (
    Advisory,
    Direction,
    MotionCause,
    MotionState,
    Reason,
    Text,
    TimeBase,
    Track,
    Unit,
    UnusableCause,
)
from paani_services.advisor.advise import advise
from paani_services.camera.picture_sources import VIDEO_SUFFIXES, Frame, list_pictures
from paani_services.perception.pipeline import Perceiver
from paani_tools.look.verdict import Verdict, judge_path, judge_still

STALE_AGE_S = 9.3  # V16
MIN_PROBES = 5  # V16
PROBE_PERIOD_S = 0.1
BLACK = "black"
BLACK_WH = (320, 240)  # A8


class Motion(msgspec.Struct, frozen=True):
    """Apparent motion of one accepted track after the last presentation."""

    label: Text
    confidence: Unit
    state: MotionState
    cause: MotionCause


class Row(msgspec.Struct, frozen=True):
    """One input, a file or `black`. `risk` is left, centre, right; 1 throughout where the picture is unusable."""

    input: Text
    usable: bool
    cause: UnusableCause
    risk: tuple[Unit, Unit, Unit]
    direction: Direction
    reason: Reason
    motion: tuple[Motion, ...]


class Stale(msgspec.Struct, frozen=True):
    """The advisor asked again long after the last picture of an input; `stopped` of `probes` said STOP."""

    age_s: float
    probes: int
    stopped: int
    reasons: tuple[Reason, ...]


class Skipped(msgspec.Struct, frozen=True):
    """A file of a folder that could not be shown, and why."""

    file: Text
    why: Text


def stills_of(paths: list[Path]) -> list[tuple[Path, bool]]:
    """Every picture file, and whether it was named itself. Raises UserError naming a path that holds none."""
    found: list[tuple[Path, bool]] = []
    for path in paths:
        if not path.exists():
            raise UserError(f"{path}: no such file or folder")
        if path.is_dir():
            pictures = list_pictures(path)
            if not pictures:
                raise UserError(f"{path}: holds no pictures")
            found += [(file, False) for file in pictures]
        elif path.suffix.lower() in VIDEO_SUFFIXES:
            raise UserError(f"{path}: a video, not a picture (`paani look` judges videos)")
        else:
            found.append((path, True))
    return found


def present_still(stills: list[tuple[Path, bool]], perceiver: Perceiver, config: Config) -> Iterator[Verdict | Skipped]:
    """Each still judged alone, the black picture last.

    Raises UserError naming a file that was asked for itself and is no picture; one among others in a folder is skipped.
    """
    for epoch, (file, named) in enumerate(stills):
        try:
            yield from judge_path(file, epoch, perceiver, config)
        except UserError as error:
            if named:
                raise
            yield Skipped(str(file), str(error).removeprefix(f"{file}: "))
    width, height = BLACK_WH
    black = Frame(np.zeros((height, width, 3), np.uint8), BLACK, 0, TimeBase.FRAME_INDEX, 0.0)
    yield judge_still(black, len(stills), perceiver, config)


def row_of(judgement: Verdict) -> Row:
    """The line of the table for one input."""
    advice = judgement.advisory
    return Row(
        input=judgement.name,
        usable=judgement.evidence.usable,
        cause=judgement.evidence.cause,
        risk=(advice.left.risk, advice.center.risk, advice.right.risk),
        direction=advice.direction,
        reason=advice.reason,
        motion=tuple(_motion(track) for track in judgement.tracks.tracks if track.accepted),
    )


def probe_stale(judgements: list[Verdict], config: Config) -> Stale:
    """Ask each input's advisor again when its last picture is 9.3 s old; at least five times over all inputs."""
    answers: list[Advisory] = []
    for number in range(max(MIN_PROBES, len(judgements))):
        turn, which = divmod(number, len(judgements))
        state = judgements[which].state
        assert state.evidence is not None
        now_us = state.evidence.source_us + round((STALE_AGE_S + turn * PROBE_PERIOD_S) * 1e6)
        answers.append(advise(state, None, now_us, config)[1])
    return Stale(
        age_s=STALE_AGE_S,
        probes=len(answers),
        stopped=sum(answer.direction is Direction.STOP for answer in answers),
        reasons=tuple(sorted({answer.reason for answer in answers})),
    )


def _motion(track: Track) -> Motion:
    return Motion(track.label, track.confidence, track.motion, track.motion_cause)
