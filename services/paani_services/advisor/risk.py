"""Risk R_j of each corridor of the picture: its water, its obstacles and their urgency, weighted (J1-J4). Pure."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64, Bools
from paani.config import CalibrationConfig, Config, CorridorConfig, RiskConfig
from paani.geometry import clip
from paani.messages import BoxXyxy, Evidence, LaneEvidence, RotationUse, SegmentationSource
from paani_services.advisor.tracker import (
    TrackerState,
    TrackMemory,
    current_urgency,
    is_accepted,
    is_confirmed,
    is_immediate_danger,
    is_person,
    presence,
)

LANES = ("left", "center", "right")
Truth = bool | Bools
Value = float | F64
Operands = tuple[tuple[int, float], ...]  # of a noisy-OR: index of an obstacle, and its value
NEAR_FROM, NEAR_SPAN = 0.30, 0.70  # of the picture: a bottom at 0.30 is far, at 1.0 as near as can be
TALL_SPAN = 0.50  # of the picture: a box of half its height, or more, is as tall as counts
ASHORE_ROWS, MASK_ROWS = 3, 64  # of the mask: its edge is seldom off by more than two
ASHORE_HEIGHT = 0.20  # of the picture: an adult 8 m away through a lens of 70 degrees; who is nearer is in the way
SIDE_MARGIN = 0.01  # of the picture: what ends so near its side goes on beyond it
NEAR_SHARE, TALL_SHARE = 0.6, 0.4  # weights of nearness and height in the severity; the paper gives none


class Obstacle(msgspec.Struct, frozen=True):
    """An accepted track as the policy weighs it; `presence` decays from 1 while it is not seen.

    is_danger: it is low and large in the picture (G5). exempt_lanes: lanes it does not occupy, because the mask shows
    clear water across most of them. distance_m: of its foot; None without a calibration. is_ashore: it stands beyond
    the water's edge. candidate: of what is no track and may be a person, its number in the evidence, from 1.
    """

    id: int
    is_vessel: bool
    box: BoxXyxy
    severity: float
    urgency: float
    presence: float
    is_danger: bool
    exempt_lanes: tuple[str, ...] = ()
    is_person: bool = False
    is_confirmed: bool = True
    distance_m: float | None = None
    is_ashore: bool = False
    candidate: int | None = None


class LaneTerms(NamedTuple):
    """What one corridor's risk is made of in one frame, before it is asked which evidence counts.

    obstacles, urgencies: the operands of the two noisy-ORs, each with the index of its obstacle, in order. A track of
    which nothing is urgent adds no urgency. track_ids: of the obstacles that overlap the corridor (J13).
    """

    water: LaneEvidence
    obstacles: Operands
    urgencies: Operands
    track_ids: tuple[int, ...]


class LaneComponents(msgspec.Struct, frozen=True):
    """Risk R_j of one corridor and its components, as numbers, or as arrays where many selections are asked about."""

    risk: Value
    non_water: Value
    obstacle: Value
    urgency: Value
    uncertainty: Value


class Selection(Protocol):
    """Which evidence of a frame counts: all of it, or many selections of it at once, and then values are arrays."""

    def has_water(self, lane: str) -> Truth:
        """Whether the water of the lane counts; else it is clear and certain."""

    def water_value(self, lane: str, value: float) -> Value:
        """The value of a term of the lane's water, or 0 where that does not count."""

    def has_any(self, obstacles: Sequence[int]) -> Truth:
        """Whether any of these obstacles counts."""

    def noisy_or(self, operands: Operands) -> Value:
        """Noisy-OR of the operands whose obstacles count."""


class AllEvidence:
    """The selection that a frame is judged by: everything counts."""

    def has_water(self, lane: str) -> bool:
        """True of every lane."""
        return True

    def water_value(self, lane: str, value: float) -> float:
        """The value itself."""
        return value

    def has_any(self, obstacles: Sequence[int]) -> bool:
        """Whether there is one."""
        return bool(obstacles)

    def noisy_or(self, operands: Operands) -> float:
        """Noisy-OR of all operands."""
        return noisy_or(value for _, value in operands)


ALL_EVIDENCE = AllEvidence()


def severity(confidence: float, box: BoxXyxy) -> float:
    """Severity of a box in [0, 1], from confidence, nearness (its bottom edge) and height (J1)."""
    near = clip((box[3] - NEAR_FROM) / NEAR_SPAN, 0.0, 1.0)
    tall = clip((box[3] - box[1]) / TALL_SPAN, 0.0, 1.0)
    return clip(confidence * (NEAR_SHARE * near + TALL_SHARE * tall), 0.0, 1.0)


def foot_range_m(box: BoxXyxy, aspect: float, calibration: CalibrationConfig) -> float | None:
    """Range of a box's foot on level water, from a boat at rest; infinite above the horizon, None uncalibrated.

    aspect: width of the picture over its height. One degree of pitch is an error of a fifth at 10 m.
    """
    if not calibration.valid:
        return None
    focal = 0.5 * aspect / portable.tan(0.5 * math.radians(calibration.hfov_deg))  # heights of the picture
    horizon = calibration.centre_frac[1] - focal * portable.tan(math.radians(calibration.pitch_down_deg))
    # Of rays near the optical axis: range = height times focal length over how far below the horizon.
    below = box[3] - horizon
    return calibration.height_m * focal / below if below > 0.0 else math.inf


def range_weight(box: BoxXyxy, aspect: float, calibration: CalibrationConfig, weights: RiskConfig) -> float:
    """Weight of an obstacle by the range of its foot: 1 up to `near_m`, 0 from `far_m` on, linear between.

    aspect: width of the picture over its height. The weight is 1 without a valid calibration, and where `far_m` is 0.
    """
    range_m = foot_range_m(box, aspect, calibration)
    if range_m is None or weights.far_m == 0.0:
        return 1.0
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


def corridor_risk(non_water: Value, obstacle: Value, urgency: Value, uncertainty: Value, weights: RiskConfig) -> Value:
    """Risk of a corridor: R = min(1, 0.55 N + 0.65 O + 0.20 M + 0.15 U) (J4)."""
    risk = (
        weights.non_water * non_water
        + weights.obstacle * obstacle
        + weights.urgency * urgency
        + weights.uncertainty * uncertainty
    )
    return np.minimum(1.0, risk) if isinstance(risk, np.ndarray) else min(1.0, risk)


def nearest_range_m(box: BoxXyxy, aspect: float, calibration: CalibrationConfig) -> float | None:
    """As `foot_range_m`; 0 where the box goes on beyond the picture's lower edge: its foot may be anywhere nearer."""
    return 0.0 if calibration.valid and box[3] >= 1.0 - SIDE_MARGIN else foot_range_m(box, aspect, calibration)


def people_aside(state: TrackerState, aspect: float, config: Config) -> tuple[Obstacle, ...]:
    """People whom the boat has turned away from, as near as they can have come by swimming since they were seen."""
    settings, people = config.advisor.tracker, config.advisor.people
    found = []
    for track in state.tracks:
        if people.use and track.is_out_of_view and is_person(track, state.at_us, settings):
            box = track.seen_box or track.box
            range_m = nearest_range_m(box, aspect, config.calibration)
            swum_m = people.swim_mps * (state.at_us - track.seen_us) * 1e-6
            found.append(
                Obstacle(
                    id=track.id, is_vessel=False, box=box, severity=0.0, urgency=0.0, presence=1.0, is_danger=False,
                    is_person=True, distance_m=None if range_m is None else max(range_m - swum_m, 0.0),
                )
            )  # fmt: skip
    return tuple(found)


def obstacles_from_tracks(
    state: TrackerState,
    config: Config,
    aspect: float,
    water: dict[str, LaneEvidence],
    water_edge: tuple[float, ...] = (),
) -> tuple[Obstacle, ...]:
    """Obstacles: accepted tracks, and people at first sight, that reach below the top of the corridors.

    aspect: width of the picture over its height. water: of each lane. water_edge: of the evidence. The box of a quay
    that runs obliquely reaches its lower edge on one side only: where the metric planner acts, a quay occupies no lane
    that the mask shows clear; without it, not the centre where the mask shows the quay end above `occupancy_bottom`.
    """
    settings, sees_people = config.advisor.tracker, config.advisor.people.use
    is_turn_known = state.rotation is RotationUse.KNOWN  # so that a held box is where it shows
    open_lanes: tuple[str, ...] = ()
    if config.is_planner_active:
        clear = 1.0 - config.advisor.policy.planned_coverage
        open_lanes = tuple(lane for lane in LANES if water[lane].clear_width > clear)

    def exempt_lanes(track: TrackMemory) -> tuple[str, ...]:
        policy, span = config.advisor.policy, lane_span("center", config.perception.corridors)
        if track.label != "pier":
            return ()
        if config.is_planner_active or track.held or policy.open_width == 0.0:
            return open_lanes
        foot = foot_by_mask(track.box, span, water_edge)
        return ("center",) if foot is not None and foot < policy.occupancy_bottom else ()

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
            exempt_lanes=exempt_lanes(track),
            is_person=is_person(track, state.at_us, settings),
            is_confirmed=is_confirmed(track, settings),
            distance_m=nearest_range_m(track.box, aspect, config.calibration),
            is_ashore=sees_people and (is_turn_known or not track.held) and stands_ashore(track.box, water_edge),
        )
        for track in state.in_view
        if track.box[3] > config.perception.corridors.top
        and (is_accepted(track, settings) or (sees_people and is_person(track, state.at_us, settings)))
    )


def stands_ashore(box: BoxXyxy, water_edge: tuple[float, ...]) -> bool:
    """Whether what is boxed stands on land or aboard: it ends above the water's edge, there and on both sides.

    The water ends below the box by `ASHORE_ROWS` of the mask and more, across the box and as far again on each side;
    so somebody in the water before a shore, or beside it, is not ashore. Nobody of `ASHORE_HEIGHT` and more is, nor
    anybody above a column without water at the picture's bottom: the bow or a glint may be all that ends it there.
    """
    if not water_edge or box[3] - box[1] >= ASHORE_HEIGHT:
        return False
    columns, width = len(water_edge), box[2] - box[0]
    first, last = max(0, int((box[0] - width) * columns)), min(columns, math.ceil((box[2] + width) * columns))
    edge = water_edge[first:last]
    return bool(edge) and box[3] + ASHORE_ROWS / MASK_ROWS <= min(edge) and max(edge) < 1.0


def foot_by_mask(box: BoxXyxy, span: tuple[float, float], water_edge: tuple[float, ...]) -> float | None:
    """Where, inside a lane, something ends that goes on beyond the picture's side; None where the mask does not say.

    It comes lowest at that side, and its box claims the water before the rest of it. The mask says where it ends if it
    shows the thing itself in every column of the box in the lane: water from the bow that ends inside the box.
    """
    goes_on = box[0] <= SIDE_MARGIN or box[2] >= 1.0 - SIDE_MARGIN
    if not goes_on or shared_width(box, span) <= 0.0:
        return None
    columns = len(water_edge)
    edge = water_edge[int(max(box[0], span[0]) * columns) : math.ceil(min(box[2], span[1]) * columns)]
    return max(edge) if edge and box[1] < min(edge) and max(edge) < box[3] else None


def lane_water(evidence: Evidence, lane: str, config: Config) -> LaneEvidence:
    """The water of a corridor by the mask, or the default components where the mask is not eligible (F2, F3)."""
    if evidence.navigation_eligible and evidence.segmentation is SegmentationSource.LEARNED:
        found: LaneEvidence = getattr(evidence, lane)
        return found
    return LaneEvidence(non_water=config.advisor.fallback_non_water, uncertainty=config.advisor.fallback_uncertainty)


def lane_terms(water: LaneEvidence, obstacles: tuple[Obstacle, ...], lane: str, config: Config) -> LaneTerms:
    """The terms of one corridor's risk: its water, and the obstacles that overlap it."""
    span = lane_span(lane, config.perception.corridors)
    inside = [(i, o, share) for i, o in enumerate(obstacles) if (share := overlap(o.box, span)) > 0.0]
    return LaneTerms(
        water=water,
        obstacles=tuple((i, o.severity * share * o.presence) for i, o, share in inside),
        urgencies=tuple((i, o.urgency * share) for i, o, share in inside if o.urgency > 0.0),
        track_ids=tuple(o.id for _, o, _ in inside if o.candidate is None),
    )


def lane_components(terms: LaneTerms, lane: str, evidence: Selection, weights: RiskConfig) -> LaneComponents:
    """Risk R_j of one corridor with its components, from the evidence that counts (J4)."""
    non_water = evidence.water_value(lane, terms.water.non_water)
    uncertainty = evidence.water_value(lane, terms.water.uncertainty)
    obstacle, urgency = evidence.noisy_or(terms.obstacles), evidence.noisy_or(terms.urgencies)
    return LaneComponents(
        risk=corridor_risk(non_water, obstacle, urgency, uncertainty, weights),
        non_water=non_water,
        obstacle=obstacle,
        urgency=urgency,
        uncertainty=uncertainty,
    )


def lane_span(lane: str, corridors: CorridorConfig) -> tuple[float, float]:
    """Range of x of a corridor, as fractions of the picture's width."""
    span: tuple[float, float] = getattr(corridors, lane)
    return span
