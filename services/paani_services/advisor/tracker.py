"""Multi-object tracker in the picture: identity, confirmation, hold and urgency of boxes. Pure.

Greedy association by overlap (G2), two sightings to confirm (G4), a fixed hold after the last sighting (G3), and
neither a motion filter nor re-identification (G10): an unseen box stays where it was until its hold ends. What is ours:
where it was is a direction, so that the boat's rotation moves the box in the picture, as far as it is known.
"""

import itertools
import math
import statistics
from collections.abc import Iterator

import msgspec

from paani import portable
from paani.boxes import area
from paani.config import AdvisorConfig, Config, TrackerConfig
from paani.geometry import clip
from paani.messages import (
    BoxXyxy,
    Candidate,
    Detection,
    Evidence,
    Hazard,
    Label,
    MotionCause,
    Odometry,
    RotationUse,
    TimeBase,
    Track,
    Tracks,
)
from paani_services.advisor.association import Assignment, assign_boxes, merge_assignments
from paani_services.advisor.motion import (
    MotionHistory,
    SizeMeasurement,
    Window,
    add_measurement,
    estimate_motion,
    motion_window,
)
from paani_services.advisor.rotation import (
    Attitude,
    CameraView,
    append_attitude,
    camera_view,
    log_angular_size,
    predict_boxes,
)

HAZARDS = {  # the four labels of the detector, one to one (G8)
    Label.PERSON: Hazard.SWIMMER,
    Label.VESSEL: Hazard.CRAFT,
    Label.PIER: Hazard.STRUCTURE,
    Label.BUOY: Hazard.MARKER,
}
MIN_SIDE = 1e-6  # of the picture; a thinner box is malformed
MAX_PERIODS = 8  # times between frames that the median is taken of
MAX_PERIOD_S = 5.0  # a longer pause between frames is no frame period
MAX_AGE_S = 1e9  # bound of the message field


class Identity(msgspec.Struct, frozen=True):
    """The identity of a track: its number, when it began, its sightings, and the history of its size.

    person_us: when it was last seen to be a person; 0: never.
    """

    id: int
    born_us: int
    hits: int = 0
    motion: MotionHistory = MotionHistory()
    person_us: int = 0


class TrackMemory(msgspec.Struct, frozen=True, rename={"attitude": "seen_from", "is_out_of_view": "left"}):
    """One track: a direction in which something is or was.

    `box` is where it is in the newest picture, `seen_box` where it was last detected, with the boat in `attitude`; they
    differ while it is held and the boat turns. `display_*` are smoothed (G6, G7). `is_out_of_view`: the boat has turned
    away from it.
    """

    identity: Identity
    label: Label
    box: BoxXyxy
    display_box: BoxXyxy
    display_confidence: float
    hits: int
    seen_us: int
    urgency: float
    held: bool = False
    attitude: Attitude | None = None
    seen_box: BoxXyxy | None = None  # None: `box`
    is_out_of_view: bool = False

    @property
    def id(self) -> int:
        return self.identity.id


class TrackerState(msgspec.Struct, frozen=True, rename={"epoch_changed": "began_again"}):
    """What the tracker keeps from one picture to the next. `malformed` counts boxes refused since the start."""

    tracks: tuple[TrackMemory, ...] = ()
    next_id: int = 1
    at_us: int = 0
    epoch: int | None = None
    epoch_changed: bool = False
    periods_s: tuple[float, ...] = ()
    malformed: int = 0
    attitudes: tuple[Attitude, ...] = ()
    rotation: RotationUse = RotationUse.OFF

    @property
    def in_view(self) -> Iterator[TrackMemory]:
        """The tracks that the boat has not turned away from."""
        return (track for track in self.tracks if not track.is_out_of_view)

    @property
    def period_s(self) -> float:
        """Median time between the last distinct frames [s]; 0 before there are two."""
        return statistics.median(self.periods_s) if self.periods_s else 0.0


class _Frame(msgspec.Struct, frozen=True):
    """What every box of one frame has in common."""

    at_us: int
    view: CameraView
    window: Window
    epoch_changed: bool
    config: AdvisorConfig


def remember_attitude(state: TrackerState, odometry: Odometry | None) -> TrackerState:
    """Add the attitude of new odometry; odometry that is already known changes nothing."""
    attitudes = append_attitude(state.attitudes, odometry)
    return state if attitudes is state.attitudes else msgspec.structs.replace(state, attitudes=attitudes)


def update_tracks(state: TrackerState, evidence: Evidence, config: Config) -> TrackerState:
    """Update the tracks with the detections of one new frame; an unusable frame only lets holds run out.

    The caller passes each distinct frame once. Malformed boxes are left out and counted. Where there are more boxes or
    tracks than are kept, people come before all others.
    """
    settings, sees_people = config.advisor.tracker, config.advisor.people.use
    state = _advance_clock(state, evidence)
    detections = evidence.detections if evidence.usable else ()
    ranked = sorted((d for d in detections if is_valid_box(d)), key=lambda d: -d.confidence)
    first = sorted(range(len(ranked)), key=lambda i: not (sees_people and ranked[i].label is Label.PERSON))
    valid = [ranked[i] for i in sorted(first[: settings.max_tracks])]
    frame = _Frame(
        state.at_us,
        camera_view(state.attitudes, evidence, config),
        motion_window(state.period_s, config.advisor.motion),
        state.epoch_changed,
        config.advisor,
    )
    seen = [track.seen_box or track.box for track in state.tracks]
    places = predict_boxes([(box, track.attitude) for box, track in zip(seen, state.tracks, strict=True)], frame.view)
    assigned = _assign_detections(seen, places, valid, frame)
    new_ids = itertools.count(state.next_id)
    detection_of = {t: d for d, t in assigned.track_of.items()}
    tracks = []
    for t, (track, place) in enumerate(zip(state.tracks, places, strict=True)):
        if t in detection_of:
            d = detection_of[t]
            identity = _update_identity(track.identity, valid[d], frame, is_ambiguous=d in assigned.ambiguous)
            tracks.append(_update_track(track, place or seen[t], valid[d], identity, frame))
        else:
            tracks.append(_hold_track(track, place, frame))
    for d, detection in enumerate(valid):
        if d not in assigned.track_of:
            history = MotionHistory(reset_cause=MotionCause.EPOCH_CHANGE if frame.epoch_changed else MotionCause.NONE)
            identity = Identity(next(new_ids), frame.at_us, motion=history)
            tracks.append(_new_track(detection, _update_identity(identity, detection, frame), frame))
    alive = [t for t in tracks if (frame.at_us - t.seen_us) * 1e-6 < settings.hold_s]
    newest = sorted(alive, key=lambda t: (-t.seen_us, -t.display_confidence))
    newest.sort(key=lambda t: not (sees_people and is_person(t, frame.at_us, settings)))
    kept = {t.id for t in newest[: settings.max_tracks]}
    return msgspec.structs.replace(
        state,
        tracks=tuple(t for t in alive if t.id in kept),
        next_id=next(new_ids),
        epoch_changed=False,
        malformed=state.malformed + sum(not is_valid_box(d) for d in detections),
        rotation=frame.view.use,
    )


def _advance_clock(state: TrackerState, evidence: Evidence) -> TrackerState:
    """Set the state to the frame's time; a new epoch of frames forgets the tracks."""
    at_us = evidence.source_us if evidence.time_base is TimeBase.CAPTURE else evidence.media_us
    if state.epoch is not None and state.epoch != evidence.frame_epoch:
        state = msgspec.structs.replace(state, tracks=(), periods_s=(), epoch_changed=True)
    elif state.epoch is not None:
        gap_s = (at_us - state.at_us) * 1e-6
        if 0.0 < gap_s <= MAX_PERIOD_S:
            state = msgspec.structs.replace(state, periods_s=(*state.periods_s, gap_s)[-MAX_PERIODS:])
    return msgspec.structs.replace(state, at_us=at_us, epoch=evidence.frame_epoch)


def _assign_detections(
    seen: list[BoxXyxy], places: list[BoxXyxy | None], valid: list[Detection], frame: _Frame
) -> Assignment:
    """The track of each detection: by where tracks are, else, ambiguously, by where they were last detected."""
    boxes, min_iou = [d.box_xyxy for d in valid], frame.config.tracker.iou
    by_prediction = assign_boxes(places, boxes, min_iou)
    return by_prediction if places == seen else merge_assignments(assign_boxes(seen, boxes, min_iou), by_prediction)


def is_valid_box(detection: Detection | Candidate) -> bool:
    """Whether its box is finite, inside the picture and not empty. NaN fails each comparison."""
    x1, y1, x2, y2 = detection.box_xyxy
    inside = all(0.0 <= value <= 1.0 for value in (x1, y1, x2, y2, detection.confidence))
    return inside and x2 - x1 >= MIN_SIDE and y2 - y1 >= MIN_SIDE


def is_immediate_danger(box: BoxXyxy, config: TrackerConfig) -> bool:
    """Whether the box is low and large in the picture: accepted without a second sighting (G5)."""
    return box[3] >= config.danger_bottom and area(box) >= config.danger_area


def current_urgency(track: TrackMemory, at_us: int, config: TrackerConfig) -> float:
    """Urgency of the last sighting, decaying exponentially while the track is held (H4)."""
    if not track.held:
        return track.urgency
    return track.urgency * portable.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.urgency_decay_s)


def presence(track: TrackMemory, at_us: int, config: TrackerConfig) -> float:
    """Factor on the obstacle's weight: 1 while it is seen, decaying exponentially while the track is held."""
    if not track.held:
        return 1.0
    return portable.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.held_decay_s)


def is_accepted(track: TrackMemory, config: TrackerConfig) -> bool:
    """Whether the track counts as an obstacle: confirmed, or an immediate danger (G4, G5)."""
    return is_confirmed(track, config) or is_immediate_danger(track.box, config)


def is_person(track: TrackMemory, at_us: int, config: TrackerConfig) -> bool:
    """Whether somebody is there: seen to be a person, and called nothing else for as long as a track is held."""
    person_us = track.identity.person_us
    return track.label is Label.PERSON or (person_us > 0 and (at_us - person_us) * 1e-6 < config.hold_s)


def is_confirmed(track: TrackMemory, config: TrackerConfig) -> bool:
    """Whether the track was seen often enough, at its place or by its identity (G4)."""
    return max(track.hits, track.identity.hits) >= config.confirm_hits


def tracks_message(state: TrackerState, evidence: Evidence, config: AdvisorConfig) -> Tracks:
    """The tracks as a message, with the time constants of their motion."""
    window = motion_window(state.period_s, config.motion)
    numbers = {detection.box_xyxy: number for number, detection in enumerate(evidence.detections, 1)}
    return Tracks(
        source_us=evidence.source_us,
        frame_seq=evidence.frame_seq,
        frame_epoch=evidence.frame_epoch,
        tracks=tuple(
            _track_message(track, 0 if track.held else numbers.get(track.box, 0), state.at_us, window, config)
            for track in state.in_view
        ),
        rotation=state.rotation,
        period_s=state.period_s,
        motion_history_s=window.history_s,
        motion_max_gap_s=window.max_gap_s,
    )


def _track_message(
    track: TrackMemory, detection_number: int, at_us: int, window: Window, config: AdvisorConfig
) -> Track:
    """One track as a message; acceptance, danger and hold are fields of their own (G11)."""
    motion = estimate_motion(track.identity.motion, at_us, window, config.motion)
    return Track(
        id=track.id,
        label=track.label,
        hazard=HAZARDS[track.label],
        confidence=track.display_confidence,
        box_xyxy=track.display_box,
        hits=max(track.hits, track.identity.hits),
        confirmed=is_confirmed(track, config.tracker),
        immediate_danger=is_immediate_danger(track.box, config.tracker),
        accepted=is_accepted(track, config.tracker),
        held=track.held,
        age_s=clip((at_us - track.identity.born_us) * 1e-6, 0.0, MAX_AGE_S),
        urgency=current_urgency(track, at_us, config.tracker),
        motion=motion.state,
        motion_cause=motion.cause,
        motion_rate_per_s=clip(motion.rate_per_s, -1e6, 1e6),
        motion_margin_per_s=min(motion.margin_per_s, 1e6),
        motion_confidence=motion.confidence,
        detection_number=detection_number,
    )


def _update_identity(before: Identity, detection: Detection, frame: _Frame, *, is_ambiguous: bool = False) -> Identity:
    """The identity with this sighting added."""
    size = log_angular_size(detection.box_xyxy, frame.view.lens)
    measurement = SizeMeasurement(frame.at_us, detection.box_xyxy, size, detection.confidence, is_ambiguous)
    return Identity(
        id=before.id,
        born_us=min(before.born_us, frame.at_us),
        hits=before.hits + 1,
        motion=add_measurement(before.motion, measurement, frame.window, frame.config.motion),
        person_us=max(frame.at_us, 1) if detection.label is Label.PERSON else before.person_us,
    )


def _hold_track(track: TrackMemory, place: BoxXyxy | None, frame: _Frame) -> TrackMemory:
    """The track in a picture that does not show it; with an unknown rotation, where it was in view last."""
    held = msgspec.structs.replace(track, held=True, seen_us=min(track.seen_us, frame.at_us))
    if frame.view.attitude is None:
        return msgspec.structs.replace(held, is_out_of_view=False)
    return msgspec.structs.replace(
        held,
        box=place or track.box,
        display_box=place or track.display_box,
        seen_box=track.seen_box or track.box,
        is_out_of_view=place is None,
    )


def _new_track(detection: Detection, identity: Identity, frame: _Frame) -> TrackMemory:
    return TrackMemory(
        identity=identity,
        label=detection.label,
        box=detection.box_xyxy,
        display_box=detection.box_xyxy,
        display_confidence=detection.confidence,
        hits=1,
        seen_us=frame.at_us,
        urgency=0.0,
        attitude=frame.view.attitude,
    )


def _update_track(
    track: TrackMemory, place: BoxXyxy, detection: Detection, identity: Identity, frame: _Frame
) -> TrackMemory:
    """The track with this sighting. place: where the rotation has moved the box of the last one."""
    settings, box = frame.config.tracker, detection.box_xyxy
    return TrackMemory(
        identity=identity,
        label=detection.label,
        box=box,
        display_box=_smooth_box(track.display_box, box, settings.box_retain),
        display_confidence=_smooth(track.display_confidence, detection.confidence, settings.confidence_retain),
        hits=track.hits + 1,
        seen_us=frame.at_us,
        urgency=_urgency(track, place, box, frame.at_us, settings),
        attitude=frame.view.attitude,
    )


def _urgency(track: TrackMemory, place: BoxXyxy, box: BoxXyxy, at_us: int, config: TrackerConfig) -> float:
    """The larger of growth (H1) and motion towards the picture's centre (H2), each saturated at 1 (H3)."""
    elapsed_s = (at_us - track.seen_us) * 1e-6
    if elapsed_s <= 0.0:
        return track.urgency
    growth = (math.sqrt(area(box)) - math.sqrt(area(place))) / elapsed_s
    centering = (_distance_from_centre(place) - _distance_from_centre(box)) / elapsed_s
    return clip(max(growth / config.growth_full_scale_per_s, centering / config.centering_full_scale_per_s), 0.0, 1.0)


def _distance_from_centre(box: BoxXyxy) -> float:
    return math.hypot((box[0] + box[2]) / 2.0 - 0.5, (box[1] + box[3]) / 2.0 - 0.5)


def _smooth_box(before: BoxXyxy, now: BoxXyxy, retain: float) -> BoxXyxy:
    x1, y1, x2, y2 = (_smooth(b, n, retain) for b, n in zip(before, now, strict=True))
    return (x1, y1, x2, y2)


def _smooth(before: float, now: float, retain: float) -> float:
    return clip(retain * before + (1.0 - retain) * now, 0.0, 1.0)
