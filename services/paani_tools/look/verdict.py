"""Evidence and advice for the frames of one path: stills each on their own, a video in sequence."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from paani.arrays import U8
from paani.config import Config
from paani.messages import Advisory, Evidence, PictureHeader, Tracks
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.camera.picture_sources import VIDEO_SUFFIXES, Frame, read_frames
from paani_services.perception.pipeline import Perceiver

PRESENTATIONS, PRESENTATION_US = 8, 100_000  # U8: a still is shown eight times at 10 Hz
START_US = 1_000_000


class Verdict(NamedTuple):
    """One frame, what was seen in it (mask None when unusable), the advice, and the advisor's memory after it."""

    name: str
    bgr: U8 | None
    mask: U8 | None
    evidence: Evidence
    advisory: Advisory
    tracks: Tracks
    state: AdvisorState


def judge_path(path: Path, epoch: int, perceiver: Perceiver, config: Config) -> Iterator[Verdict]:
    """Judge every frame of a picture, folder or video.

    epoch: the first of this path's; every still has its own, a video one. A still is looked at once and
    presented to a fresh advisor eight times, 0.1 s apart, so that tracks confirm and occupancy persists; no still
    knows of another. A video is one sequence on its own time, at no more than `camera.rate_hz`.
    Raises UserError as `camera.picture_sources.read_frames` does.
    """
    settings = msgspec.structs.replace(config.camera, timing="original", loop=False)
    state = AdvisorState()
    moving = path.suffix.lower() in VIDEO_SUFFIXES and path.is_file()
    for number, frame in enumerate(read_frames(path, settings)):
        if moving:
            evidence, mask = _perceive(perceiver, frame, epoch, number)
            state, advisory, tracks = advise(state, evidence, evidence.source_us, config)
            yield Verdict(frame.name, frame.bgr, mask, evidence, advisory, tracks, state)
        else:
            yield judge_still(frame, epoch + number, perceiver, config, number)


def judge_still(frame: Frame, epoch: int, perceiver: Perceiver, config: Config, number: int = 0) -> Verdict:
    """One still on its own, looked at once and presented to a fresh advisor eight times."""
    evidence, mask = _perceive(perceiver, frame, epoch, number)
    state, advisory, tracks = advise(AdvisorState(), evidence, evidence.source_us, config)
    for presentation in range(1, PRESENTATIONS):
        stamp_us = evidence.source_us + presentation * PRESENTATION_US
        again = msgspec.structs.replace(
            evidence,
            source_us=stamp_us,
            media_us=evidence.media_us + presentation * PRESENTATION_US,
            frame_seq=evidence.frame_seq + presentation,
        )
        state, advisory, tracks = advise(state, again, stamp_us, config)
    return Verdict(frame.name, frame.bgr, mask, evidence, advisory, tracks, state)


def _perceive(perceiver: Perceiver, frame: Frame, epoch: int, number: int) -> tuple[Evidence, U8 | None]:
    height, width = frame.bgr.shape[:2] if frame.bgr is not None else (0, 0)
    header = PictureHeader(
        source_us=START_US + frame.media_us,
        frame_seq=number,
        frame_epoch=epoch,
        width_px=width,
        height_px=height,
        time_base=frame.time_base,
        media_us=frame.media_us,
    )
    return perceiver.perceive(b"" if frame.bgr is None else frame.bgr, header, 0.0)
