"""Boxes of one picture joined to the boxes before: identity, confirmation, hold, urgency. Pure.

No motion filter and no re-identification (checklist G10): a box that is not seen stays where it was until its
hold ends.
"""

import math
import statistics

import msgspec

from paani.config import AdvisorConfig, TrackerConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, Detection, Evidence, Hazard, Label, MotionCause, TimeBase, Track
from paani_services.advisor.motion import MotionHistory, Window, estimate, observe, window_for

HAZARDS = {  # resolution 22
    Label.PERSON: Hazard.SWIMMER,
    Label.VESSEL: Hazard.CRAFT,
    Label.PIER: Hazard.STRUCTURE,
    Label.BUOY: Hazard.MARKER,
}
MIN_SIDE = 1e-6
PERIODS_KEPT = 8
MAX_PERIOD_S = 5.0  # a longer pause is no frame period


class TrackMemory(msgspec.Struct, frozen=True):
    """What is remembered of one object. `box` is the last one seen; `display_*` are smoothed (G6, G7)."""

    id: int
    label: Label
    box: BoxXyxy
    display_box: BoxXyxy
    display_confidence: float
    hits: int
    born_us: int
    seen_us: int
    urgency: float
    motion: MotionHistory
    held: bool = False


class TrackerState(msgspec.Struct, frozen=True):
    """Everything between two pictures. `malformed` counts boxes refused since the start."""

    tracks: tuple[TrackMemory, ...] = ()
    next_id: int = 1
    at_us: int = 0
    epoch: int | None = None
    began_again: bool = False
    periods_s: tuple[float, ...] = ()
    malformed: int = 0

    @property
    def period_s(self) -> float:
        """Median time between the last distinct frames [s]; 0 before there are two."""
        return statistics.median(self.periods_s) if self.periods_s else 0.0


def update(state: TrackerState, evidence: Evidence, config: AdvisorConfig) -> TrackerState:
    """Join one new frame's boxes to the tracks; an unusable frame only lets holds run out.

    The caller passes each distinct frame once. Malformed boxes are left out and counted.
    """
    at_us = evidence.source_us if evidence.time_base is TimeBase.CAPTURE else evidence.media_us
    if state.epoch is not None and state.epoch != evidence.frame_epoch:
        state = TrackerState(next_id=state.next_id, malformed=state.malformed, began_again=True)
    elif state.epoch is not None:
        gap_s = (at_us - state.at_us) * 1e-6
        if 0.0 < gap_s <= MAX_PERIOD_S:
            state = msgspec.structs.replace(state, periods_s=(*state.periods_s, gap_s)[-PERIODS_KEPT:])
        state = msgspec.structs.replace(state, began_again=False)
    given = evidence.detections if evidence.usable else ()
    sound = [d for d in given if is_sound(d)]
    sound = sorted(sound, key=lambda d: -d.confidence)[: config.tracker.max_tracks]
    window = window_for(state.period_s, config.motion)
    pairs, ambiguous = associate([t.box for t in state.tracks], [d.box_xyxy for d in sound], config.tracker.iou)
    taken = {d: t for t, d in pairs.items()}
    tracks = [
        _seen(track, sound[pairs[i]], at_us, pairs[i] in ambiguous, window, config)
        if i in pairs
        else msgspec.structs.replace(track, held=True, seen_us=min(track.seen_us, at_us))
        for i, track in enumerate(state.tracks)
    ]
    born = [detection for i, detection in enumerate(sound) if i not in taken]
    tracks += [
        _born(state.next_id + i, detection, at_us, state.began_again, window, config)
        for i, detection in enumerate(born)
    ]
    alive = [t for t in tracks if (at_us - t.seen_us) * 1e-6 < config.tracker.hold_s]
    alive.sort(key=lambda t: (-t.seen_us, -t.display_confidence, t.id))
    return TrackerState(
        tracks=tuple(sorted(alive[: config.tracker.max_tracks], key=lambda t: t.id)),
        next_id=state.next_id + len(born),
        at_us=at_us,
        epoch=evidence.frame_epoch,
        periods_s=state.periods_s,
        malformed=state.malformed + sum(not is_sound(d) for d in given),
    )


def associate(
    tracks: list[BoxXyxy], detections: list[BoxXyxy], min_iou: float
) -> tuple[dict[int, int], frozenset[int]]:
    """Greedy best-overlap-first pairs {track: detection} (G2), and detections that could have gone elsewhere too.

    Labels are not compared: one object may change its label from frame to frame.
    """
    candidates = sorted(
        (-overlap, t, d)
        for t, track in enumerate(tracks)
        for d, detection in enumerate(detections)
        if (overlap := iou(track, detection)) >= min_iou
    )
    pairs: dict[int, int] = {}
    used: set[int] = set()
    for _, t, d in candidates:
        if t not in pairs and d not in used:
            pairs[t] = d
            used.add(d)
    ambiguous = frozenset(d for t, d in pairs.items() if sum(ct == t or cd == d for _, ct, cd in candidates) > 1)
    return pairs, ambiguous


def iou(a: BoxXyxy, b: BoxXyxy) -> float:
    """Intersection over union of two sound boxes."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0.0 or height <= 0.0:
        return 0.0
    both = width * height
    return both / (area(a) + area(b) - both)


def area(box: BoxXyxy) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


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
    return track.urgency * math.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.urgency_decay_s)


def presence(track: TrackMemory, at_us: int, config: TrackerConfig) -> float:
    """How much of the obstacle's weight is left: 1 when seen, fading while held."""
    if not track.held:
        return 1.0
    return math.exp(-max(0, at_us - track.seen_us) * 1e-6 / config.held_decay_s)


def published(track: TrackMemory, at_us: int, config: AdvisorConfig) -> Track:
    """The track as a message: acceptance, danger and hold are their own fields (G11)."""
    confirmed = track.hits >= config.tracker.confirm_hits
    danger = is_immediate_danger(track.box, config.tracker)
    motion = estimate(track.motion, config.motion)
    return Track(
        id=track.id,
        label=track.label,
        hazard=HAZARDS[track.label],
        confidence=track.display_confidence,
        box_xyxy=track.display_box,
        hits=track.hits,
        confirmed=confirmed,
        immediate_danger=danger,
        accepted=confirmed or danger,
        held=track.held,
        age_s=max(0, at_us - track.born_us) * 1e-6,
        urgency=urgency_now(track, at_us, config.tracker),
        motion=motion.state,
        motion_cause=motion.cause,
        motion_rate_per_s=clip(motion.rate_per_s, -1e6, 1e6),
        motion_margin_per_s=min(motion.margin_per_s, 1e6),
        motion_confidence=motion.confidence,
    )


def _born(
    track_id: int, detection: Detection, at_us: int, began_again: bool, window: Window, config: AdvisorConfig
) -> TrackMemory:
    before = MotionHistory(reset=MotionCause.EPOCH_CHANGE if began_again else MotionCause.NONE)
    return TrackMemory(
        id=track_id,
        label=detection.label,
        box=detection.box_xyxy,
        display_box=detection.box_xyxy,
        display_confidence=detection.confidence,
        hits=1,
        born_us=at_us,
        seen_us=at_us,
        urgency=0.0,
        motion=observe(before, at_us, detection.box_xyxy, detection.confidence, False, window, config.motion),
    )


def _seen(
    track: TrackMemory, detection: Detection, at_us: int, ambiguous: bool, window: Window, config: AdvisorConfig
) -> TrackMemory:
    settings, box = config.tracker, detection.box_xyxy
    return msgspec.structs.replace(
        track,
        label=detection.label,
        box=box,
        display_box=_blend(track.display_box, box, settings.box_retain),
        display_confidence=_mix(track.display_confidence, detection.confidence, settings.confidence_retain),
        hits=track.hits + 1,
        born_us=min(track.born_us, at_us),
        seen_us=at_us,
        urgency=_urgency(track, box, at_us, settings),
        motion=observe(track.motion, at_us, box, detection.confidence, ambiguous, window, config.motion),
        held=False,
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
