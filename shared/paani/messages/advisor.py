"""Tracks and advice."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.header import BoxXyxy, Count, Finite, Message, NonNegative, Stamp, Text, Unit
from paani.messages.perception import Label, UnusableCause


class Hazard(StrEnum):
    """Compact hazard vocabulary, one to one with `Label` (G8)."""

    SWIMMER = "swimmer"
    CRAFT = "craft"
    STRUCTURE = "structure"
    MARKER = "marker"


class MotionState(StrEnum):
    """Apparent motion: diagnostic only, it lowers no risk and authorises nothing (I20)."""

    APPROACHING = "approaching"
    RECEDING = "receding"
    STEADY = "steady"
    UNKNOWN = "unknown"


class MotionCause(StrEnum):
    """Why the apparent motion is unknown, or NONE when it is known."""

    NONE = "none"
    TOO_FEW_SAMPLES = "too_few_samples"
    TOO_SHORT = "too_short"
    LOW_QUALITY = "low_quality"
    AMBIGUOUS_INTERVAL = "ambiguous_interval"
    CLIPPED_BY_FRAME = "clipped_by_frame"
    WEAK_DETECTION = "weak_detection"
    AMBIGUOUS_ASSOCIATION = "ambiguous_association"
    SHAPE_CHANGE = "shape_change"
    TIME_REVERSED = "time_reversed"
    EPOCH_CHANGE = "epoch_change"
    GAP = "gap"


class Track(msgspec.Struct, frozen=True, kw_only=True):
    """One tracked box. Acceptance and prediction are explicit, never hidden in the score (G11).

    detection_number: of the detection in the evidence of this frame that the track was matched to, from 1; 0: none.
    """

    id: Count
    label: Label
    hazard: Hazard
    confidence: Unit
    box_xyxy: BoxXyxy
    hits: Count
    confirmed: bool
    immediate_danger: bool
    accepted: bool
    held: bool
    age_s: NonNegative
    urgency: Unit
    motion: MotionState = MotionState.UNKNOWN
    motion_cause: MotionCause = MotionCause.TOO_FEW_SAMPLES
    motion_rate_per_s: Finite = 0.0
    motion_margin_per_s: NonNegative = 0.0
    motion_confidence: Unit = 0.0
    detection_number: Count = 0


class RotationUse(StrEnum):
    """Whether the boat's rotation was compensated in this picture, or why not."""

    KNOWN = "known"
    OFF = "off"
    UNKNOWN_LENS = "unknown_lens"
    NO_ODOMETRY = "no_odometry"
    RECORDING = "recording"


class Tracks(Message, frozen=True, kw_only=True):
    """Tracked boxes of one frame; `period_s` between frames set how far back and how far apart motion samples lie."""

    frame_seq: Count
    frame_epoch: Count
    tracks: tuple[Track, ...] = ()
    rotation: RotationUse = RotationUse.OFF
    period_s: NonNegative = 0.0
    motion_history_s: NonNegative = 0.0
    motion_max_gap_s: NonNegative = 0.0


class Direction(StrEnum):
    """The advised direction (J18)."""

    STRAIGHT = "STRAIGHT"
    SLIGHT_LEFT = "SLIGHT_LEFT"
    SLIGHT_RIGHT = "SLIGHT_RIGHT"
    LEFT = "LEFT"
    RIGHT = "RIGHT"
    STOP = "STOP"
    NO_DATA = "NO_DATA"


SIDE_OF = {
    Direction.LEFT: "left",
    Direction.SLIGHT_LEFT: "left",
    Direction.RIGHT: "right",
    Direction.SLIGHT_RIGHT: "right",
}


class Reason(StrEnum):
    """Why this direction. Scores, temporal rules, occupancy, age and input faults never share a code (B17)."""

    CENTER_CLEAR = "CENTER_CLEAR"
    CENTER_RISK = "CENTER_RISK"
    CENTER_OCCUPIED = "CENTER_OCCUPIED"
    CENTER_VESSEL = "CENTER_VESSEL"
    CENTER_EDGE_INCURSION = "CENTER_EDGE_INCURSION"
    TURN_RETAINED = "TURN_RETAINED"
    TIE_KEPT_SIDE = "TIE_KEPT_SIDE"
    TIE_STARBOARD = "TIE_STARBOARD"
    NO_SAFE_SIDE = "NO_SAFE_SIDE"
    NO_SIDE_UNOCCUPIED = "NO_SIDE_UNOCCUPIED"
    NO_SIDE_FOR_LONG = "NO_SIDE_FOR_LONG"
    STALE_EVIDENCE = "STALE_EVIDENCE"
    FUTURE_EVIDENCE = "FUTURE_EVIDENCE"
    UNUSABLE_IMAGE = "UNUSABLE_IMAGE"
    MALFORMED_EVIDENCE = "MALFORMED_EVIDENCE"
    NO_EVIDENCE = "NO_EVIDENCE"


INPUT_FAULTS = frozenset(
    {
        Reason.STALE_EVIDENCE,
        Reason.FUTURE_EVIDENCE,
        Reason.UNUSABLE_IMAGE,
        Reason.MALFORMED_EVIDENCE,
        Reason.NO_EVIDENCE,
    }
)


class LaneRisk(msgspec.Struct, frozen=True, kw_only=True):
    """Risk R_j of a corridor and the four components it was made from (J4), with the overrides that apply.

    limit: the risk at which this lane is blocked in this frame; lower where it was blocked before.
    """

    risk: Unit = 1.0
    non_water: Unit = 1.0
    obstacle: Unit = 0.0
    urgency: Unit = 0.0
    uncertainty: Unit = 1.0
    clear_width: Unit = 0.0
    occupied: bool = False
    blocked: bool = True
    track_ids: tuple[Count, ...] = ()
    limit: Unit = 0.0


class Purpose(StrEnum):
    """What an advised direction is for.

    PASS: to go there. LOOK: to turn towards a side that is blocked, on the spot, and look for a way. UNSAID: the
    advisory was recorded before advisories said their purpose.
    """

    PASS = "PASS"
    LOOK = "LOOK"
    UNSAID = "UNSAID"


class Lane(StrEnum):
    """A corridor of the picture."""

    LEFT = "left"
    CENTER = "center"
    RIGHT = "right"


class ChangedBy(StrEnum):
    """What would change an advised direction.

    NOTHING: the direction is STRAIGHT, so nothing is asked. EVIDENCE: one of the sets given, taken away.
    CLEAR_PICTURES: a turn is retained until enough pictures were clear. NEW_EVIDENCE: the input is at fault.
    MORE_EVIDENCE: no set as small as those that were tried.
    """

    NOTHING = "nothing"
    EVIDENCE = "evidence"
    CLEAR_PICTURES = "clear_pictures"
    NEW_EVIDENCE = "new_evidence"
    MORE_EVIDENCE = "more_evidence"


class Limit(StrEnum):
    """A limit that a number can cross; SIDE_GAIN is how much better the other side must be to be taken."""

    NONE = "none"
    CENTER_RISK = "center_risk"
    LEFT_RISK = "left_risk"
    RIGHT_RISK = "right_risk"
    SIDE_GAIN = "side_gain"


class Removal(msgspec.Struct, frozen=True, kw_only=True):
    """Evidence without which the direction would be another: tracks, and lanes taken as clear, certain water.

    candidates: numbers of `Evidence.candidates`, from 1; unset where none is taken away.
    """

    direction: Direction
    track_ids: tuple[Count, ...] = ()
    water: tuple[Lane, ...] = ()
    candidates: tuple[Count, ...] | msgspec.UnsetType = msgspec.UNSET


class Counterfactual(msgspec.Struct, frozen=True, kw_only=True):
    """The smallest evidence without which the direction would be another, found by asking the policy again.

    removals: the first of the smallest sets, those that lead straight on first; each is known to change the direction.
    found: how many sets of that size do. judged: how many sets the policy was asked about. left_out: tracks that were
    too many to be asked about. limit, margin: the nearest limit that would change the direction when crossed alone, and
    how far the number lies above it (negative: below).
    """

    changed_by: ChangedBy = ChangedBy.NOTHING
    removals: tuple[Removal, ...] = ()
    found: Count = 0
    judged: Count = 0
    left_out: Count = 0
    limit: Limit = Limit.NONE
    margin: Finite = 0.0


class Advisory(Message, frozen=True, kw_only=True):
    """What the advisor advises, the evidence it used (J11), and what would change it.

    speed_limit_mps: not to be exceeded while somebody is near, or by an uncalibrated camera; unset otherwise.
    people_ahead: tracks of people who block the way ahead, unset where people are weighed as anything else.
    candidates_ahead: numbers of `Evidence.candidates`, from 1, that block the way ahead, as they may be people; unset
    where none does. person_distance_m: of the nearest of the people, or else of what may be people; unset where no
    calibration tells it.
    may_keep_station: a STOP for what lies on the water, in a picture that is fit, with nobody near: thrust may hold the
    boat where it is. So it may in a picture whose view alone is doubted, for as long as the last fit one tells that
    nobody can have come near. Unset for every other advice.
    """

    direction: Direction
    reason: Reason
    cause: UnusableCause = UnusableCause.NONE
    left: LaneRisk = LaneRisk()
    center: LaneRisk = LaneRisk()
    right: LaneRisk = LaneRisk()
    center_block_risk: Unit = 0.48
    side_block_risk: Unit = 0.58
    contributing_track_ids: tuple[Count, ...] = ()
    evidence_age_s: Finite = 0.0
    lifetime_s: NonNegative = 3.5
    frame_seq: Count = 0
    frame_epoch: Count = 0
    evidence_sent_us: Stamp = 0
    explanation: Text = ""
    counterfactual: Counterfactual = Counterfactual()
    purpose: Purpose = Purpose.UNSAID
    speed_limit_mps: NonNegative | msgspec.UnsetType = msgspec.UNSET
    people_ahead: tuple[Count, ...] | msgspec.UnsetType = msgspec.UNSET
    person_distance_m: NonNegative | msgspec.UnsetType = msgspec.UNSET
    candidates_ahead: tuple[Count, ...] | msgspec.UnsetType = msgspec.UNSET
    may_keep_station: bool | msgspec.UnsetType = msgspec.UNSET
