"""Generated boxes that grow, shrink, stay, leave the frame, vanish for a while or stand beside another. Pure."""

import math
from collections.abc import Callable

import msgspec

from paani.config import Config
from paani.messages import (
    BoxXyxy,
    Detection,
    Evidence,
    Label,
    LaneEvidence,
    MotionCause,
    MotionState,
    SegmentationSource,
    Text,
    Track,
)
from paani_services.advisor.advise import AdvisorState, advise

PERIOD_S = 0.1  # U8: controlled 10 Hz stamps
FRAMES = 20
GAP_S = 1.0  # longer than I16 allows, shorter than the hold
FRAMES_AFTER = 2  # sightings after what breaks a history: too few to know again
START_US = 1_000_000
CENTRE = (0.5, 0.45)
ASPECT = 1.3
CONFIDENCE = 0.8
RATES_PER_S = (0.10, 0.15, 0.25, 0.40, 0.60)  # growth of log size; the dead band with its margin ends at 0.05
SIZES = (0.06, 0.10, 0.16)  # sqrt of the normalised area in the middle of the time
CLEAR = LaneEvidence(non_water=0.02, uncertainty=0.02, clear_width=0.98)


class FrameBoxes(msgspec.Struct, frozen=True):
    """Boxes of one frame; the first is the one that is followed."""

    at_s: float
    boxes: tuple[BoxXyxy, ...]


class Outcome(msgspec.Struct, frozen=True):
    """How often the track at the end of a trajectory was in this state for this cause."""

    state: MotionState
    cause: MotionCause
    count: int


class Family(msgspec.Struct, frozen=True):
    """One family of trajectories, what its tracks should be called at the end, and what they were."""

    name: Text
    wanted: MotionState
    wanted_cause: MotionCause
    trajectories: int
    as_wanted: int
    outcomes: tuple[Outcome, ...]


Trajectory = Callable[[float, float], list[FrameBoxes]]


def families(config: Config) -> tuple[Family, ...]:
    """The six families (U9), each over five rates and three sizes."""
    unknown = MotionState.UNKNOWN
    return (
        _family(
            "expansion",
            MotionState.APPROACHING,
            MotionCause.NONE,
            lambda rate, size: scaled_trajectory(rate, size),
            config,
        ),
        _family(
            "contraction",
            MotionState.RECEDING,
            MotionCause.NONE,
            lambda rate, size: scaled_trajectory(-rate, size),
            config,
        ),
        _family("steady", MotionState.STEADY, MotionCause.NONE, drifting_trajectory, config),
        _family("clipped", unknown, MotionCause.CLIPPED_BY_FRAME, clipped_trajectory, config),
        _family("gap", unknown, MotionCause.GAP, interrupted_trajectory, config),
        _family("ambiguity", unknown, MotionCause.AMBIGUOUS_ASSOCIATION, joined_trajectory, config),
    )


def scaled_trajectory(rate_per_s: float, size: float) -> list[FrameBoxes]:
    """A box about the centre whose log size grows at this rate, `size` in the middle of the time."""
    middle_s = (FRAMES - 1) * PERIOD_S / 2.0
    return [
        FrameBoxes(at_s, (_box(CENTRE, size * math.exp(rate_per_s * (at_s - middle_s))),))
        for at_s in (i * PERIOD_S for i in range(FRAMES))
    ]


def drifting_trajectory(rate_per_s: float, size: float) -> list[FrameBoxes]:
    """A box of constant size that moves sideways, faster for higher rates."""
    return [
        FrameBoxes(i * PERIOD_S, (_box((CENTRE[0] + 0.05 * rate_per_s * i * PERIOD_S, CENTRE[1]), size),))
        for i in range(FRAMES)
    ]


def clipped_trajectory(rate_per_s: float, size: float) -> list[FrameBoxes]:
    """A growing box whose last sightings reach beyond the frame's right edge."""
    seen = scaled_trajectory(rate_per_s, size)
    cut = [
        FrameBoxes(
            s.at_s, (_shifted_box(s.boxes[0], 1.0 - s.boxes[0][2] + (0.02 if i >= FRAMES - FRAMES_AFTER else -0.02)),)
        )
        for i, s in enumerate(seen)
    ]
    return [FrameBoxes(s.at_s, tuple(_clipped_box(box) for box in s.boxes)) for s in cut]


def interrupted_trajectory(rate_per_s: float, size: float) -> list[FrameBoxes]:
    """A growing box that is not seen for a second, and then only `FRAMES_AFTER` times."""
    seen = scaled_trajectory(rate_per_s, size)
    return [FrameBoxes(s.at_s + (GAP_S if i >= FRAMES - FRAMES_AFTER else 0.0), s.boxes) for i, s in enumerate(seen)]


def joined_trajectory(rate_per_s: float, size: float) -> list[FrameBoxes]:
    """A growing box beside which another appears at the end, so that either could be the one followed."""
    return [
        FrameBoxes(
            s.at_s, (s.boxes[0], _shifted_box(s.boxes[0], 0.3 * size)) if i >= FRAMES - FRAMES_AFTER else s.boxes
        )
        for i, s in enumerate(scaled_trajectory(rate_per_s, size))
    ]


def last_track(trajectory: list[FrameBoxes], config: Config) -> Track:
    """The first track after the last frame; frames without a sighting come at 10 Hz like the others."""
    state, epoch, seq = AdvisorState(), 1, 0
    tracks: tuple[Track, ...] = ()
    by_tick = {round(s.at_s / PERIOD_S): s.boxes for s in trajectory}
    for seq in range(max(by_tick) + 1):
        source_us = START_US + round(seq * PERIOD_S * 1e6)
        evidence = Evidence(
            source_us=source_us,
            frame_seq=seq,
            frame_epoch=epoch,
            width_px=320,
            height_px=240,
            usable=True,
            detections=tuple(
                Detection(label=Label.VESSEL, confidence=CONFIDENCE, box_xyxy=box) for box in by_tick.get(seq, ())
            ),
            left=CLEAR,
            center=CLEAR,
            right=CLEAR,
            segmentation=SegmentationSource.LEARNED,
            navigation_eligible=True,
        )
        state, _, given = advise(state, evidence, source_us, config)
        tracks = given.tracks
    return tracks[0]


def _family(name: str, wanted: MotionState, cause: MotionCause, trajectory: Trajectory, config: Config) -> Family:
    found = [last_track(trajectory(rate, size), config) for rate in RATES_PER_S for size in SIZES]
    ends = [(track.motion, track.motion_cause) for track in found]
    return Family(
        name=name,
        wanted=wanted,
        wanted_cause=cause,
        trajectories=len(ends),
        as_wanted=ends.count((wanted, cause)),
        outcomes=tuple(Outcome(*end, ends.count(end)) for end in sorted(set(ends))),
    )


def _box(centre: tuple[float, float], size: float) -> BoxXyxy:
    half_width, half_height = size * math.sqrt(ASPECT) / 2.0, size / math.sqrt(ASPECT) / 2.0
    x, y = centre
    return _clipped_box((x - half_width, y - half_height, x + half_width, y + half_height))


def _shifted_box(box: BoxXyxy, by: float) -> BoxXyxy:
    return (box[0] + by, box[1], box[2] + by, box[3])


def _clipped_box(box: BoxXyxy) -> BoxXyxy:
    x1, y1, x2, y2 = (min(1.0, max(0.0, value)) for value in box)
    return (x1, y1, x2, y2)
