"""Boxes of one picture joined to the boxes before: identity, confirmation, hold, urgency. Pure.

No motion filter and no re-identification (G10): a box that is not seen stays where it was until its
hold ends. What the boat's own turning did to a box decides only whose identity it has.
"""

import itertools
import math
import statistics
from collections.abc import Iterator

import msgspec

from paani import portable
from paani.config import AdvisorConfig, Config, TrackerConfig
from paani.geometry import clip
from paani.messages import (
    BoxXyxy,
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
from paani_services.advisor.association import Pairs, area, associate, kinship
from paani_services.advisor.motion import MotionHistory, Sighting, Window, estimate, observe, window_for
from paani_services.advisor.rotation import Attitude, View, expected, heard, log_size, view_of

HAZARDS = {  # resolution 22
    Label.PERSON: Hazard.SWIMMER,
    Label.VESSEL: Hazard.CRAFT,
    Label.PIER: Hazard.STRUCTURE,
    Label.BUOY: Hazard.MARKER,
}
MIN_SIDE = 1e-6
PERIODS_KEPT = 8
MAX_PERIOD_S = 5.0  # a longer pause is no frame period
MAX_AGE_S = 1e9


class Identity(msgspec.Struct, frozen=True):
    """Who a track is: its number, since when, how often seen, and how its size went."""

    id: int
    born_us: int
    hits: int = 0
    motion: MotionHistory = MotionHistory()


class TrackMemory(msgspec.Struct, frozen=True):
    """What is remembered of one place in the picture where something is or was.

    `box` is the last one seen there, `display_*` are smoothed (G6, G7), `hits` counts sightings there. `identity` may
    have come from another place when the boat turned, and then has sightings of its own. `seen_from`: how the boat lay.
    `left`: what was here has been seen elsewhere since, so that nobody is expected from here.
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
    seen_from: Attitude | None = None
    left: bool = False

    @property
    def id(self) -> int:
        return self.identity.id


class TrackerState(msgspec.Struct, frozen=True):
    """Everything between two pictures. `malformed` counts boxes refused since the start."""

    tracks: tuple[TrackMemory, ...] = ()
    next_id: int = 1
    at_us: int = 0
    epoch: int | None = None
    began_again: bool = False
    periods_s: tuple[float, ...] = ()
    malformed: int = 0
    attitudes: tuple[Attitude, ...] = ()
    rotation: RotationUse = RotationUse.OFF

    @property
    def period_s(self) -> float:
        """Median time between the last distinct frames [s]; 0 before there are two."""
        return statistics.median(self.periods_s) if self.periods_s else 0.0


class _Frame(msgspec.Struct, frozen=True):
    """What every box of one frame has in common."""

    at_us: int
    view: View
    window: Window
    began_again: bool
    config: AdvisorConfig


def hear(state: TrackerState, odometry: Odometry | None) -> TrackerState:
    """Remember how the boat lay; odometry heard before changes nothing."""
    attitudes = heard(state.attitudes, odometry)
    return state if attitudes is state.attitudes else msgspec.structs.replace(state, attitudes=attitudes)


def update(state: TrackerState, evidence: Evidence, config: Config) -> TrackerState:
    """Join one new frame's boxes to the tracks; an unusable frame only lets holds run out.

    The caller passes each distinct frame once. Malformed boxes are left out and counted. The boxes, their hold and
    their weight go by overlap with the last place alone, whatever the boat's turning; identities go with the turning.
    """
    settings = config.advisor.tracker
    state = _on_the_clock(state, evidence)
    given = evidence.detections if evidence.usable else ()
    sound = sorted((d for d in given if is_sound(d)), key=lambda d: -d.confidence)[: settings.max_tracks]
    frame = _Frame(
        state.at_us,
        view_of(state.attitudes, evidence, config),
        window_for(state.period_s, config.advisor.motion),
        state.began_again,
        config.advisor,
    )
    seen, kin = _joined(state.tracks, sound, frame)
    continued, new_ids = set(kin.track_of.values()), itertools.count(state.next_id)
    detection_of = {t: d for d, t in seen.track_of.items()}
    tracks = []
    for t, track in enumerate(state.tracks):
        if t in detection_of:
            d = detection_of[t]
            tracks.append(
                _seen_again(track, sound[d], _identity(d, sound[d], state.tracks, kin, new_ids, frame), frame)
            )
        else:
            left = t in continued
            tracks.append(
                msgspec.structs.replace(
                    track,
                    identity=Identity(next(new_ids), frame.at_us) if left else track.identity,
                    held=True,
                    seen_us=min(track.seen_us, frame.at_us),
                    left=track.left or left,
                )
            )
    tracks += [
        _first_seen(detection, _identity(d, detection, state.tracks, kin, new_ids, frame), frame)
        for d, detection in enumerate(sound)
        if d not in seen.track_of
    ]
    alive = [t for t in tracks if (frame.at_us - t.seen_us) * 1e-6 < settings.hold_s]
    newest = sorted(range(len(alive)), key=lambda i: (-alive[i].seen_us, -alive[i].display_confidence, i))
    return msgspec.structs.replace(
        state,
        tracks=tuple(alive[i] for i in sorted(newest[: settings.max_tracks])),
        next_id=next(new_ids),
        began_again=False,
        malformed=state.malformed + sum(not is_sound(d) for d in given),
        rotation=frame.view.use,
    )


def _on_the_clock(state: TrackerState, evidence: Evidence) -> TrackerState:
    """The state at the frame's time; a new epoch of frames forgets the tracks."""
    at_us = evidence.source_us if evidence.time_base is TimeBase.CAPTURE else evidence.media_us
    if state.epoch is not None and state.epoch != evidence.frame_epoch:
        state = msgspec.structs.replace(state, tracks=(), periods_s=(), began_again=True)
    elif state.epoch is not None:
        gap_s = (at_us - state.at_us) * 1e-6
        if 0.0 < gap_s <= MAX_PERIOD_S:
            state = msgspec.structs.replace(state, periods_s=(*state.periods_s, gap_s)[-PERIODS_KEPT:])
    return msgspec.structs.replace(state, at_us=at_us, epoch=evidence.frame_epoch)


def _joined(tracks: tuple[TrackMemory, ...], sound: list[Detection], frame: _Frame) -> tuple[Pairs, Pairs]:
    """Which place each detection is at, and whose identity it has."""
    boxes, min_iou = [d.box_xyxy for d in sound], frame.config.tracker.iou
    places = [track.box for track in tracks]
    seen = associate(places, boxes, min_iou)
    if frame.view.attitude is None:
        return seen, seen
    turned = expected([(track.box, track.seen_from) for track in tracks], frame.view)
    if turned == places:
        return seen, seen
    left_out = [None if track.left else place for track, place in zip(tracks, turned, strict=True)]
    return seen, kinship(seen, associate(left_out, boxes, min_iou))


def is_sound(detection: Detection) -> bool:
    """Finite, inside the picture, and not empty. NaN fails each comparison."""
    x1, y1, x2, y2 = detection.box_xyxy
    inside = all(0.0 <= value <= 1.0 for value in (x1, y1, x2, y2, detection.confidence))
    return inside and x2 - x1 >= MIN_SIDE and y2 - y1 >= MIN_SIDE


def is_immediate_danger(box: BoxXyxy, config: TrackerConfig) -> bool:
    """Low and large in the picture: accepted without waiting for a second sighting (G5)."""
    return box[3] >= config.danger_bottom and area(box) >= config.danger_area


def urgency_now(track: TrackMemory, at_us: int, config: TrackerConfig) -> float:
    """Urgency of the last sighting, fading while the box is held (H4)."""
    if not track.held:
        return track.urgency
    return track.urgency * portable.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.urgency_decay_s)


def presence(track: TrackMemory, at_us: int, config: TrackerConfig) -> float:
    """How much of the obstacle's weight is left: 1 when seen, fading while held."""
    if not track.held:
        return 1.0
    return portable.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.held_decay_s)


def is_accepted(track: TrackMemory, config: TrackerConfig) -> bool:
    """Does it count as an obstacle: confirmed at this place or by its identity, or an immediate danger (G4, G5)?"""
    return is_confirmed(track, config) or is_immediate_danger(track.box, config)


def is_confirmed(track: TrackMemory, config: TrackerConfig) -> bool:
    """Seen often enough (G4)."""
    return max(track.hits, track.identity.hits) >= config.confirm_hits


def published(state: TrackerState, evidence: Evidence, config: AdvisorConfig) -> Tracks:
    """The tracks as a message, with the times that their motion was measured by."""
    window = window_for(state.period_s, config.motion)
    return Tracks(
        source_us=evidence.source_us,
        frame_seq=evidence.frame_seq,
        frame_epoch=evidence.frame_epoch,
        tracks=tuple(_published(track, state.at_us, window, config) for track in state.tracks),
        rotation=state.rotation,
        period_s=state.period_s,
        motion_history_s=window.history_s,
        motion_max_gap_s=window.max_gap_s,
    )


def _published(track: TrackMemory, at_us: int, window: Window, config: AdvisorConfig) -> Track:
    """Acceptance, danger and hold are their own fields (G11)."""
    motion = estimate(track.identity.motion, at_us, window, config.motion)
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
        urgency=urgency_now(track, at_us, config.tracker),
        motion=motion.state,
        motion_cause=motion.cause,
        motion_rate_per_s=clip(motion.rate_per_s, -1e6, 1e6),
        motion_margin_per_s=min(motion.margin_per_s, 1e6),
        motion_confidence=motion.confidence,
    )


def _identity(
    d: int,
    detection: Detection,
    tracks: tuple[TrackMemory, ...],
    kin: Pairs,
    new_ids: Iterator[int],
    frame: _Frame,
) -> Identity:
    """Whoever detection `d` is, with this sighting; somebody new where it is nobody's kin."""
    if d in kin.track_of:
        before = tracks[kin.track_of[d]].identity
    else:
        began = MotionHistory(reset=MotionCause.EPOCH_CHANGE if frame.began_again else MotionCause.NONE)
        before = Identity(next(new_ids), frame.at_us, motion=began)
    size = log_size(detection.box_xyxy, frame.view.lens)
    sighting = Sighting(frame.at_us, detection.box_xyxy, size, detection.confidence, d in kin.doubtful)
    return Identity(
        id=before.id,
        born_us=min(before.born_us, frame.at_us),
        hits=before.hits + 1,
        motion=observe(before.motion, sighting, frame.window, frame.config.motion),
    )


def _first_seen(detection: Detection, identity: Identity, frame: _Frame) -> TrackMemory:
    return TrackMemory(
        identity=identity,
        label=detection.label,
        box=detection.box_xyxy,
        display_box=detection.box_xyxy,
        display_confidence=detection.confidence,
        hits=1,
        seen_us=frame.at_us,
        urgency=0.0,
        seen_from=frame.view.attitude,
    )


def _seen_again(track: TrackMemory, detection: Detection, identity: Identity, frame: _Frame) -> TrackMemory:
    settings, box = frame.config.tracker, detection.box_xyxy
    return TrackMemory(
        identity=identity,
        label=detection.label,
        box=box,
        display_box=_blend(track.display_box, box, settings.box_retain),
        display_confidence=_mix(track.display_confidence, detection.confidence, settings.confidence_retain),
        hits=track.hits + 1,
        seen_us=frame.at_us,
        urgency=_urgency(track, box, frame.at_us, settings),
        seen_from=frame.view.attitude,
    )


def _urgency(track: TrackMemory, box: BoxXyxy, at_us: int, config: TrackerConfig) -> float:
    """Larger of growth (H1) and movement towards the picture's centre (H2), each saturated (H3)."""
    elapsed_s = (at_us - track.seen_us) * 1e-6
    if elapsed_s <= 0.0:
        return track.urgency
    growth = (math.sqrt(area(box)) - math.sqrt(area(track.box))) / elapsed_s
    centering = (_off_centre(track.box) - _off_centre(box)) / elapsed_s
    return clip(max(growth / config.growth_full_scale_per_s, centering / config.centering_full_scale_per_s), 0.0, 1.0)


def _off_centre(box: BoxXyxy) -> float:
    return math.hypot((box[0] + box[2]) / 2.0 - 0.5, (box[1] + box[3]) / 2.0 - 0.5)


def _blend(before: BoxXyxy, now: BoxXyxy, retain: float) -> BoxXyxy:
    x1, y1, x2, y2 = (_mix(b, n, retain) for b, n in zip(before, now, strict=True))
    return (x1, y1, x2, y2)


def _mix(before: float, now: float, retain: float) -> float:
    return clip(retain * before + (1.0 - retain) * now, 0.0, 1.0)
