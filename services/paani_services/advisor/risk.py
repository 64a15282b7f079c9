"""How bad each corridor is: the water's part, the obstacles' part, their sum R_j (J1-J4). Pure."""

import math
from collections.abc import Iterable

import msgspec

from paani import portable
from paani.config import CalibrationConfig, Config, CorridorConfig, RiskConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, Evidence, LaneEvidence, SegmentationSource
from paani_services.advisor.tracker import TrackerState, is_accepted, is_immediate_danger, presence, urgency_now

LANES = ("left", "center", "right")
NEAR_FROM, NEAR_SPAN, TALL_SPAN = 0.30, 0.70, 0.50  # resolution 6
NEAR_SHARE, TALL_SHARE = 0.6, 0.4  # resolution 6


class Obstacle(msgspec.Struct, frozen=True):
    """An accepted track as the policy weighs it; `presence` falls from 1 while it is not seen.

    behind: the lanes that show clear water across more than it may take of them, so that it occupies none.
    """

    id: int
    craft: bool
    box: BoxXyxy
    severity: float
    urgency: float
    presence: float
    danger: bool
    behind: tuple[str, ...] = ()


class Components(msgspec.Struct, frozen=True):
    """R_j of one corridor and what it is made of; `track_ids` overlap it (J13)."""

    risk: float
    non_water: float
    obstacle: float
    urgency: float
    uncertainty: float
    clear_width: float
    track_ids: tuple[int, ...]


def severity(confidence: float, box: BoxXyxy) -> float:
    """Bounded severity of a box, from confidence, nearness (its bottom) and height (J1, resolution 6)."""
    near = clip((box[3] - NEAR_FROM) / NEAR_SPAN, 0.0, 1.0)
    tall = clip((box[3] - box[1]) / TALL_SPAN, 0.0, 1.0)
    return clip(confidence * (NEAR_SHARE * near + TALL_SHARE * tall), 0.0, 1.0)


def relevance(box: BoxXyxy, aspect: float, calibration: CalibrationConfig, weights: RiskConfig) -> float:
    """How much a thing counts by how far its foot is off: 1 up to `near_m`, 0 from `far_m` on.

    aspect: width of the picture over its height. 1 without a valid calibration, or where `far_m` is 0. The range is
    that of level water seen from a boat at rest: a boat that pitches by a degree misjudges 10 m by a fifth.
    """
    if not calibration.valid or weights.far_m == 0.0:
        return 1.0
    focal = 0.5 * aspect / portable.tan(0.5 * math.radians(calibration.hfov_deg))  # heights of the picture
    horizon = calibration.centre_frac[1] - focal * portable.tan(math.radians(calibration.pitch_down_deg))
    # Of rays near the optical axis: range = height times focal length over how far below the horizon.
    below = box[3] - horizon
    if below <= 0.0:
        return 0.0
    range_m = calibration.height_m * focal / below
    return clip((weights.far_m - range_m) / (weights.far_m - weights.near_m), 0.0, 1.0)


def shared_width(box: BoxXyxy, span: tuple[float, float]) -> float:
    """Width that a box and an x range have in common, normalised to the picture."""
    return max(0.0, min(box[2], span[1]) - max(box[0], span[0]))


def overlap(box: BoxXyxy, span: tuple[float, float]) -> float:
    """Fraction of the box's width inside the corridor (J2, resolution 7): two lanes may both count it."""
    shared = shared_width(box, span)
    return min(1.0, shared / (box[2] - box[0])) if shared > 0.0 else 0.0


def either(values: Iterable[float]) -> float:
    """E(a, b) = 1 - (1-a)(1-b), over any number of values in [0, 1] (J3)."""
    none = 1.0
    for value in values:
        none *= 1.0 - value
    return clip(1.0 - none, 0.0, 1.0)


def total(non_water: float, obstacle: float, urgency: float, uncertainty: float, weights: RiskConfig) -> float:
    """R = min(1, 0.55 N + 0.65 O + 0.20 M + 0.15 U) (J4)."""
    return min(
        1.0,
        weights.non_water * non_water
        + weights.obstacle * obstacle
        + weights.urgency * urgency
        + weights.uncertainty * uncertainty,
    )


def obstacles_of(
    state: TrackerState, config: Config, aspect: float, water: dict[str, LaneEvidence]
) -> tuple[Obstacle, ...]:
    """Accepted tracks, confirmed or an immediate danger, that reach below the corridors' top.

    aspect: width of the picture over its height. water: of each lane. A quay that lies aslant fills a box whose lower
    end it reaches on one side alone: where the metric planner acts it stands where the mask ends the water.
    """
    settings = config.advisor.tracker
    open_lanes: tuple[str, ...] = ()
    if config.navigator.planner.acts_on(config.calibration):
        clear = 1.0 - config.advisor.policy.planned_coverage
        open_lanes = tuple(lane for lane in LANES if water[lane].clear_width > clear)

    def weight(box: BoxXyxy) -> float:
        return relevance(box, aspect, config.calibration, config.advisor.risk)

    return tuple(
        Obstacle(
            id=track.id,
            craft=track.label == "vessel",
            box=track.box,
            severity=severity(track.display_confidence, track.box) * weight(track.box),
            urgency=urgency_now(track, state.at_us, settings) * weight(track.box),
            presence=presence(track, state.at_us, settings),
            danger=is_immediate_danger(track.box, settings),
            behind=open_lanes if track.label == "pier" else (),
        )
        for track in state.tracks
        if track.box[3] > config.perception.corridors.top and is_accepted(track, settings)
    )


def water_of(evidence: Evidence, lane: str, config: Config) -> LaneEvidence:
    """The mask's view of a corridor, or the default components where the mask may not count (F2, F3)."""
    if evidence.navigation_eligible and evidence.segmentation is SegmentationSource.LEARNED:
        found: LaneEvidence = getattr(evidence, lane)
        return found
    return LaneEvidence(
        non_water=config.perception.fallback_non_water, uncertainty=config.perception.fallback_uncertainty
    )


def components(water: LaneEvidence, obstacles: tuple[Obstacle, ...], lane: str, config: Config) -> Components:
    """Everything R_j of one corridor is made of."""
    span = lane_span(lane, config.perception.corridors)
    inside = [(o, share) for o in obstacles if (share := overlap(o.box, span)) > 0.0]
    obstacle = either(o.severity * share * o.presence for o, share in inside)
    urgency = either(o.urgency * share for o, share in inside)
    return Components(
        risk=total(water.non_water, obstacle, urgency, water.uncertainty, config.advisor.risk),
        non_water=water.non_water,
        obstacle=obstacle,
        urgency=urgency,
        uncertainty=water.uncertainty,
        clear_width=water.clear_width,
        track_ids=tuple(o.id for o, _ in inside),
    )


def lane_span(lane: str, corridors: CorridorConfig) -> tuple[float, float]:
    """Normalised x range of a corridor."""
    span: tuple[float, float] = getattr(corridors, lane)
    return span
