"""Every message that crosses the bus.

Closed, frozen structs that encode to plain JSON. Angles are radians, counter-clockwise from east (ENU);
boxes are `(x1, y1, x2, y2)`, normalised to the picture, origin top left; stamps are integer microseconds.
A `Unit` or `Finite` field cannot carry NaN or infinity: JSON has neither, and the bounds reject the rest.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

Unit = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Stamp = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Text = Annotated[str, msgspec.Meta(max_length=400)]
BoxXyxy = tuple[Unit, Unit, Unit, Unit]


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Common header. `source_us` dates the evidence, not this message; a republish keeps it.

    The bus fills the rest when it publishes: `seq` counts this producer's messages on the key, `epoch`
    changes when the producer restarts or its source begins again, `sent_us` is when it left.
    """

    source_us: Stamp
    seq: Count = 0
    epoch: Count = 0
    domain: Count = 43
    producer: Text = ""
    sent_us: Stamp = 0


# --- camera -----------------------------------------------------------------------------------------


class TimeBase(StrEnum):
    """What `source_us` of a picture counts (checklist I17)."""

    CAPTURE = "capture"
    MEDIA = "media"
    FRAME_INDEX = "frame_index"


class PictureHeader(Message, frozen=True, kw_only=True):
    """Travels beside encoded picture bytes. `frame_seq`/`frame_epoch` name the camera frame they show."""

    frame_seq: Count
    frame_epoch: Count
    width_px: Count
    height_px: Count
    media_type: Text = "image/jpeg"
    time_base: TimeBase = TimeBase.CAPTURE
    calibrated: bool = False


# --- perception -------------------------------------------------------------------------------------


class Label(StrEnum):
    """Detector classes in output order (checklist C2)."""

    PERSON = "person"
    VESSEL = "vessel"
    PIER = "pier"
    BUOY = "buoy"


class UnusableCause(StrEnum):
    """Why a picture cannot be evidence; NONE when it can."""

    NONE = "none"
    UNDECODABLE = "undecodable"
    WRONG_SIZE = "wrong_size"
    BLACK = "black"
    WHITE = "white"
    FLAT = "flat"
    NOISE = "noise"
    BLURRED = "blurred"
    COVERED = "covered"
    FROZEN = "frozen"
    STALE = "stale"


class SegmentationSource(StrEnum):
    """Who drew the mask. Only LEARNED may count as free-space evidence (checklist F2)."""

    LEARNED = "learned"
    FALLBACK = "fallback"
    NONE = "none"


class Detection(msgspec.Struct, frozen=True, kw_only=True):
    label: Label
    confidence: Unit
    box_xyxy: BoxXyxy


class LaneEvidence(msgspec.Struct, frozen=True, kw_only=True):
    """One corridor of the mask: N_j, U_j and clear width (checklist E4-E6), fractions of the corridor."""

    non_water: Unit = 1.0
    uncertainty: Unit = 1.0
    clear_width: Unit = 0.0


class InferenceTiming(msgspec.Struct, frozen=True, kw_only=True):
    """Wall time of each step for one picture; `frame_age_ms` is the picture's age at inference start."""

    frame_age_ms: NonNegative = 0.0
    decode_ms: NonNegative = 0.0
    gate_ms: NonNegative = 0.0
    detector_ms: NonNegative = 0.0
    segmenter_ms: NonNegative = 0.0
    inference_ms: NonNegative = 0.0
    total_ms: NonNegative = 0.0


class Evidence(Message, frozen=True, kw_only=True):
    """What perception saw in one picture (checklist B5)."""

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


# --- advisor ----------------------------------------------------------------------------------------


class Hazard(StrEnum):
    """Compact hazard vocabulary, one to one with `Label` (checklist G8)."""

    SWIMMER = "swimmer"
    CRAFT = "craft"
    STRUCTURE = "structure"
    MARKER = "marker"


class MotionState(StrEnum):
    """Apparent motion: diagnostic only, it lowers no risk and authorises nothing (checklist I20)."""

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
    """One tracked box. Acceptance and prediction are explicit, never hidden in the score (checklist G11)."""

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


class Tracks(Message, frozen=True, kw_only=True):
    frame_seq: Count
    frame_epoch: Count
    tracks: tuple[Track, ...] = ()


class Direction(StrEnum):
    """The advised direction (checklist J18)."""

    STRAIGHT = "STRAIGHT"
    SLIGHT_LEFT = "SLIGHT_LEFT"
    SLIGHT_RIGHT = "SLIGHT_RIGHT"
    LEFT = "LEFT"
    RIGHT = "RIGHT"
    STOP = "STOP"
    NO_DATA = "NO_DATA"


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
    STALE_EVIDENCE = "STALE_EVIDENCE"
    FUTURE_EVIDENCE = "FUTURE_EVIDENCE"
    UNUSABLE_IMAGE = "UNUSABLE_IMAGE"
    MALFORMED_EVIDENCE = "MALFORMED_EVIDENCE"
    NO_EVIDENCE = "NO_EVIDENCE"


class LaneRisk(msgspec.Struct, frozen=True, kw_only=True):
    """R_j and the four numbers it was made from (checklist J4), with the overrides that apply."""

    risk: Unit = 1.0
    non_water: Unit = 1.0
    obstacle: Unit = 0.0
    urgency: Unit = 0.0
    uncertainty: Unit = 1.0
    clear_width: Unit = 0.0
    occupied: bool = False
    blocked: bool = True
    track_ids: tuple[Count, ...] = ()


class Advisory(Message, frozen=True, kw_only=True):
    """What the advisor advises and the evidence it used (checklist J11)."""

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


# --- guidance ---------------------------------------------------------------------------------------


class Inhibit(StrEnum):
    """Why the boat is not ordered to move. An order that moves has none."""

    NOT_ARMED = "NOT_ARMED"
    NO_CLOCK = "NO_CLOCK"
    CLOCK_STOPPED = "CLOCK_STOPPED"
    NO_ODOMETRY = "NO_ODOMETRY"
    STALE_ODOMETRY = "STALE_ODOMETRY"
    UNHEALTHY_ODOMETRY = "UNHEALTHY_ODOMETRY"
    NO_ADVISORY = "NO_ADVISORY"
    STALE_ADVISORY = "STALE_ADVISORY"
    ADVISED_STOP = "ADVISED_STOP"
    ADVISED_NO_DATA = "ADVISED_NO_DATA"
    TURN_CAPPED = "TURN_CAPPED"
    NO_ROUTE = "NO_ROUTE"
    ROUTE_FINISHED = "ROUTE_FINISHED"
    WRONG_DOMAIN = "WRONG_DOMAIN"
    NO_COMMAND = "NO_COMMAND"
    STALE_COMMAND = "STALE_COMMAND"
    COMMAND_INVALID = "COMMAND_INVALID"


class NavCommand(Message, frozen=True, kw_only=True):
    """Atomic order to the controller: heading, speed, enable, frame, validity together (checklist B11).

    `echo_us` is the newest plant stamp the navigator had heard: the plant judges age on its own clock.
    """

    enable: bool
    heading_rad: Finite
    speed_mps: NonNegative
    frame: Text = "map"
    echo_us: Stamp = 0
    inhibits: tuple[Inhibit, ...] = ()
    direction: Direction = Direction.NO_DATA
    waypoint_index: Count = 0
    waypoints_reached: Count = 0
    cross_track_m: Finite = 0.0
    advisory_sent_us: Stamp = 0


class Waypoint(msgspec.Struct, frozen=True, kw_only=True):
    x_m: Finite
    y_m: Finite


class Route(Message, frozen=True, kw_only=True):
    """The route being followed, in the map frame; republished so that late joiners have it."""

    name: Text
    waypoints: tuple[Waypoint, ...]
    repeat: bool = True


class Thrust(Message, frozen=True, kw_only=True):
    """Normalised differential thrust, forward only (checklist B12, N7)."""

    left: Unit
    right: Unit
    enabled: bool
    echo_us: Stamp = 0
    inhibits: tuple[Inhibit, ...] = ()
    speed_error_mps: Finite = 0.0
    heading_error_rad: Finite = 0.0
    command_sent_us: Stamp = 0


class Arming(Message, frozen=True, kw_only=True):
    """The operator's word. `stopped` latches until the operator arms again."""

    armed: bool
    stopped: bool = False


class Odometry(Message, frozen=True, kw_only=True):
    """Estimated pose and body velocities; an estimate, never simulator truth (checklist L4)."""

    x_m: Finite
    y_m: Finite
    yaw_rad: Finite
    surge_mps: Finite
    sway_mps: Finite = 0.0
    yaw_rate_radps: Finite = 0.0
    position_std_m: NonNegative = 0.0
    yaw_std_rad: NonNegative = 0.0
    healthy: bool = False
    stopped: bool = False
    latitude_deg: Finite = 0.0
    longitude_deg: Finite = 0.0


# --- plant ------------------------------------------------------------------------------------------


class SimTime(Message, frozen=True, kw_only=True):
    """The plant's clock: `sim_us` advances only while the simulation runs; `stamp_us` is its own clock to echo."""

    sim_us: Stamp
    stamp_us: Stamp
    running: bool = True


class GpsFix(Message, frozen=True, kw_only=True):
    latitude_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
    sog_mps: NonNegative
    cog_rad: Finite
    position_std_m: NonNegative
    fix: bool = True


class ImuSample(Message, frozen=True, kw_only=True):
    """Body rates and specific force (at rest: +9.81 on z). `orientation_available` false means no yaw (A12)."""

    gyro_x_radps: Finite
    gyro_y_radps: Finite
    gyro_z_radps: Finite
    accel_x_mps2: Finite
    accel_y_mps2: Finite
    accel_z_mps2: Finite
    orientation_available: bool = False
    roll_rad: Finite = 0.0
    pitch_rad: Finite = 0.0
    yaw_rad: Finite = 0.0


class ZeroCause(StrEnum):
    """Why the thrust adapter applies zero; NONE when it applies the command."""

    NONE = "none"
    NO_COMMAND = "no_command"
    TIMEOUT = "timeout"
    NOT_ENABLED = "not_enabled"
    NOT_ARMED = "not_armed"
    ARMING_LOST = "arming_lost"
    PULSE_LOST = "pulse_lost"
    STALE_ECHO = "stale_echo"
    WRONG_PRODUCER = "wrong_producer"
    WRONG_DOMAIN = "wrong_domain"
    OLD_EPOCH = "old_epoch"
    REPLAYED = "replayed"
    FUTURE = "future"
    INVALID = "invalid"


class ThrustApplied(Message, frozen=True, kw_only=True):
    """What the last gate did: the force it applies now and why it is zero when it is."""

    left: Unit
    right: Unit
    left_n: NonNegative
    right_n: NonNegative
    zero_cause: ZeroCause
    command_seq: Count = 0
    command_sent_us: Stamp = 0
    command_source_us: Stamp = 0
    rejected: Count = 0
    lost_pulse: Text = ""


class TruePose(Message, frozen=True, kw_only=True):
    """Simulator truth, under the verbatim `@truth` chunk: for the eye, the dashboard and scoring only."""

    sim_us: Stamp
    x_m: Finite
    y_m: Finite
    z_m: Finite
    roll_rad: Finite
    pitch_rad: Finite
    yaw_rad: Finite
    surge_mps: Finite
    sway_mps: Finite
    yaw_rate_radps: Finite
    distance_m: NonNegative = 0.0
    collisions: Count = 0
    in_contact: bool = False


# --- health -----------------------------------------------------------------------------------------


class Pulse(Message, frozen=True, kw_only=True):
    """Ten times a second from the event loop of each vital process: silence means dead or hung."""


class InputHealth(msgspec.Struct, frozen=True, kw_only=True):
    topic: Text
    alive: bool
    fresh: bool
    rate_ok: bool
    rate_hz: NonNegative
    age_s: NonNegative
    received: Count
    superseded: Count


class DropCount(msgspec.Struct, frozen=True, kw_only=True):
    cause: Text
    count: Count


class Health(Message, frozen=True, kw_only=True):
    """Once a second from every process."""

    service: Text
    ready: bool
    uptime_s: NonNegative
    cpu_cores: NonNegative
    rss_mib: NonNegative
    inputs: tuple[InputHealth, ...] = ()
    drops: tuple[DropCount, ...] = ()
    note: Text = ""
