"""Messages of perception: the evidence of one picture."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.camera import TimeBase
from paani.messages.header import BoxXyxy, Count, Finite, Message, NonNegative, Stamp, Text, Unit


class Label(StrEnum):
    """Detector classes in output order (C2)."""

    PERSON = "person"
    VESSEL = "vessel"
    PIER = "pier"
    BUOY = "buoy"


class UnusableCause(StrEnum):
    """Why a picture is unusable as evidence; NONE when it is usable."""

    NONE = "none"
    UNDECODABLE = "undecodable"
    WRONG_SIZE = "wrong_size"
    BLACK = "black"
    WHITE = "white"
    FLAT = "flat"
    NOISE = "noise"
    BLURRED = "blurred"
    COVERED = "covered"
    SKEWED = "skewed"
    FROZEN = "frozen"
    UNFIT = "unfit"
    FILLED = "filled"
    NO_WATER = "no_water"
    NO_HORIZON = "no_horizon"
    STALE = "stale"


class SegmentationSource(StrEnum):
    """How the class mask was made. Only a LEARNED mask may count as evidence of free water (F2)."""

    LEARNED = "learned"
    FALLBACK = "fallback"
    NONE = "none"


class Detection(msgspec.Struct, frozen=True, kw_only=True):
    """One box of the detector."""

    label: Label
    confidence: Unit
    box_xyxy: BoxXyxy


class CandidateKind(StrEnum):
    """Why something may be a person: a box that is not sure of it, or an obstacle that stands alone in the water."""

    UNSURE_BOX = "unsure_box"
    LONE_OBSTACLE = "lone_obstacle"


class Candidate(msgspec.Struct, frozen=True, kw_only=True):
    """What may be a person, and is no detection.

    confidence: of the person in an unsure box; of a lone obstacle, the largest that the mask has in it.
    """

    kind: CandidateKind
    confidence: Unit
    box_xyxy: BoxXyxy


class LaneEvidence(msgspec.Struct, frozen=True, kw_only=True):
    """One corridor of the mask: non-water fraction N_j, uncertainty U_j and clear width, all of 1 (E4-E6).

    open_width: the widest way of connected water from the bow outwards, as a fraction of the corridor's width; unset
    where that is not asked.
    """

    non_water: Unit = 1.0
    uncertainty: Unit = 1.0
    clear_width: Unit = 0.0
    open_width: Unit | msgspec.UnsetType = msgspec.UNSET


class InferenceTiming(msgspec.Struct, frozen=True, kw_only=True):
    """Wall time of each step for one picture.

    `frame_age_ms`: age of the picture when inference starts. `gate_ms`: time of the image-quality check. `detector_ms`
    and `segmenter_ms` include preprocessing and decoding; `segmenter_run_ms` is the segmenter's network alone (V18).
    """

    frame_age_ms: NonNegative = 0.0
    decode_ms: NonNegative = 0.0
    gate_ms: NonNegative = 0.0
    detector_ms: NonNegative = 0.0
    segmenter_ms: NonNegative = 0.0
    segmenter_run_ms: NonNegative = 0.0
    inference_ms: NonNegative = 0.0
    total_ms: NonNegative = 0.0


class Evidence(Message, frozen=True, kw_only=True):
    """Evidence of one picture (B5).

    `roll_rad`: roll by which the corridors were levelled. Boxes and water edge lie in the picture as it is.
    `water_edge`: for each column of the mask as it is, left to right, the lower edge of the first cell that is not
    water, from the bottom up and own hull skipped, as a fraction of the picture's height from its top. 1: no water at
    the bottom of that column; 0: water to the top. Empty: no mask.
    `candidates`: what may be a person, unsure boxes first and each kind by falling confidence; unset where that is not
    asked. Of an unusable picture that was looked at, the people among its detections come first, as it has no
    detections.
    """

    frame_seq: Count
    frame_epoch: Count
    width_px: Count
    height_px: Count
    usable: bool
    cause: UnusableCause = UnusableCause.NONE
    time_base: TimeBase = TimeBase.CAPTURE
    detections: tuple[Detection, ...] = ()
    left: LaneEvidence = LaneEvidence()
    center: LaneEvidence = LaneEvidence()
    right: LaneEvidence = LaneEvidence()
    segmentation: SegmentationSource = SegmentationSource.NONE
    navigation_eligible: bool = False
    confidence_threshold: Unit = 0.4
    timing: InferenceTiming = InferenceTiming()
    models: Text = ""
    media_us: Stamp = 0
    roll_rad: Finite = 0.0
    water_edge: tuple[Unit, ...] = ()
    candidates: tuple[Candidate, ...] | msgspec.UnsetType = msgspec.UNSET
