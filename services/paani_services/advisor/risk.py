"""Risk R_j of each corridor of the picture: its water, its obstacles and their urgency, weighted (J1-J4). Pure."""

import math
from collections.abc import Iterable

import msgspec

from paani import portable
from paani.config import CalibrationConfig, Config, CorridorConfig, RiskConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, Evidence, LaneEvidence, SegmentationSource
from paani_services.advisor.tracker import TrackerState, current_urgency, is_accepted, is_immediate_danger, presence

LANES = ("left", "center", "right")
NEAR_FROM, NEAR_SPAN = 0.30, 0.70  # of the picture: a bottom at 0.30 is far, at 1.0 as near as can be
TALL_SPAN = 0.50  # of the picture: a box of half its height, or more, is as tall as counts
NEAR_SHARE, TALL_SHARE = 0.6, 0.4  # weights of nearness and height in the severity; the paper gives none


class Obstacle(msgspec.Struct, frozen=True):
    """An accepted track as the policy weighs it; `presence` decays from 1 while it is not seen.

    is_danger: it is low and large in the picture (G5). exempt_lanes: lanes it does not occupy, because the mask shows
    clear water across most of them.
    """

    id: int
    is_vessel: bool
    box: BoxXyxy
    severity: float
    urgency: float
    presence: float
    is_danger: bool
    exempt_lanes: tuple[str, ...] = ()


class LaneComponents(msgspec.Struct, frozen=True):
    """Risk R_j of one corridor and its components; `track_ids` are the obstacles that overlap it (J13)."""

    risk: float
    non_water: float
    obstacle: float
    urgency: float
    uncertainty: float
    clear_width: float
    track_ids: tuple[int, ...]


def severity(confidence: float, box: BoxXyxy) -> float:
    """Severity of a box in [0, 1], from confidence, nearness (its bottom edge) and height (J1)."""
    near = clip((box[3] - NEAR_FROM) / NEAR_SPAN, 0.0, 1.0)
    tall = clip((box[3] - box[1]) / TALL_SPAN, 0.0, 1.0)
    return clip(confidence * (NEAR_SHARE * near + TALL_SHARE * tall), 0.0, 1.0)


def range_weight(box: BoxXyxy, aspect: float, calibration: CalibrationConfig, weights: RiskConfig) -> float:
    """Weight of an obstacle by the range of its foot: 1 up to `near_m`, 0 from `far_m` on, linear between.

    aspect: width of the picture over its height. The weight is 1 without a valid calibration, and where `far_m` is 0.
    The range is that on level water from a boat at rest: one degree of pitch is an error of a fifth at 10 m.
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
    """Width that a box and a range of x share, as a fraction of the picture."""
    return max(0.0, min(box[2], span[1]) - max(box[0], span[0]))


def overlap(box: BoxXyxy, span: tuple[float, float]) -> float:
    """Fraction of the box's width inside the corridor (J2); corridors overlap, so that two of them may count it."""
    shared = shared_width(box, span)
    return min(1.0, shared / (box[2] - box[0])) if shared > 0.0 else 0.0


def noisy_or(values: Iterable[float]) -> float:
    """Noisy-OR of values in [0, 1]: E(a, b) = 1 - (1-a)(1-b), over any number of them (J3)."""
    none = 1.0
    for value in values:
        none *= 1.0 - value
    return clip(1.0 - none, 0.0, 1.0)


def corridor_risk(non_water: float, obstacle: float, urgency: float, uncertainty: float, weights: RiskConfig) -> float:
    """Risk of a corridor: R = min(1, 0.55 N + 0.65 O + 0.20 M + 0.15 U) (J4)."""
    return min(
        1.0,
        weights.non_water * non_water
        + weights.obstacle * obstacle
        + weights.urgency * urgency
        + weights.uncertainty * uncertainty,
    )


def obstacles_from_tracks(
    state: TrackerState, config: Config, aspect: float, water: dict[str, LaneEvidence]
) -> tuple[Obstacle, ...]:
    """Obstacles: accepted tracks, confirmed or an immediate danger, that reach below the top of the corridors.

    aspect: width of the picture over its height. water: of each lane. The box of a quay that runs obliquely reaches its
    lower edge on one side only: where the metric planner acts, a quay occupies no lane that the mask shows clear.
    """
    settings = config.advisor.tracker
    open_lanes: tuple[str, ...] = ()
    if config.navigator.planner.acts_on(config.calibration):
        clear = 1.0 - config.advisor.policy.planned_coverage
        open_lanes = tuple(lane for lane in LANES if water[lane].clear_width > clear)

    def weight(box: BoxXyxy) -> float:
        return range_weight(box, aspect, config.calibration, config.advisor.risk)

    return tuple(
        Obstacle(
            id=track.id,
            is_vessel=track.label == "vessel",
            box=track.box,
            severity=severity(track.display_confidence, track.box) * weight(track.box),
            urgency=current_urgency(track, state.at_us, settings) * weight(track.box),
            presence=presence(track, state.at_us, settings),
            is_danger=is_immediate_danger(track.box, settings),
            exempt_lanes=open_lanes if track.label == "pier" else (),
        )
        for track in state.tracks
        if track.box[3] > config.perception.corridors.top and is_accepted(track, settings)
    )


def lane_water(evidence: Evidence, lane: str, config: Config) -> LaneEvidence:
    """The water of a corridor by the mask, or the default components where the mask is not eligible (F2, F3)."""
    if evidence.navigation_eligible and evidence.segmentation is SegmentationSource.LEARNED:
        found: LaneEvidence = getattr(evidence, lane)
        return found
    return LaneEvidence(
        non_water=config.perception.fallback_non_water, uncertainty=config.perception.fallback_uncertainty
    )


def lane_components(water: LaneEvidence, obstacles: tuple[Obstacle, ...], lane: str, config: Config) -> LaneComponents:
    """Risk R_j of one corridor with its components."""
    span = lane_span(lane, config.perception.corridors)
    inside = [(o, share) for o in obstacles if (share := overlap(o.box, span)) > 0.0]
    obstacle = noisy_or(o.severity * share * o.presence for o, share in inside)
    urgency = noisy_or(o.urgency * share for o, share in inside)
    return LaneComponents(
        risk=corridor_risk(water.non_water, obstacle, urgency, water.uncertainty, config.advisor.risk),
        non_water=water.non_water,
        obstacle=obstacle,
        urgency=urgency,
        uncertainty=water.uncertainty,
        clear_width=water.clear_width,
        track_ids=tuple(o.id for o, _ in inside),
    )


def lane_span(lane: str, corridors: CorridorConfig) -> tuple[float, float]:
    """Range of x of a corridor, as fractions of the picture's width."""
    span: tuple[float, float] = getattr(corridors, lane)
    return span
