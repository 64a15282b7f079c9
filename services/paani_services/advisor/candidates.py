"""What may be a person, as obstacles of the policy: in the way it is as good as a person, and it weighs nothing. Pure.

Where the camera is calibrated, the range of a candidate's foot tells its size, and what a recognised obstacle stands
for is left to that obstacle; without a calibration everything that stands alone in the water may be somebody.
"""

import math

import msgspec

from paani import portable
from paani.boxes import covered_frac
from paani.config import CalibrationConfig, Config
from paani.messages import BoxXyxy, Candidate, Evidence
from paani_services.advisor.risk import LANES, Obstacle, nearest_range_m
from paani_services.advisor.tracker import TrackerState, is_confirmed

EXPLAINED_FRAC = 0.5  # of a candidate, inside the box of what it then is


def candidate_obstacles(evidence: Evidence, tracks: TrackerState, config: Config) -> tuple[Obstacle, ...]:
    """The candidates of a frame that may block a way, as obstacles without severity.

    tracks: as they are after the frame. Nothing where people are weighed as anything else.
    """
    people = config.advisor.people
    if not people.use or isinstance(evidence.candidates, msgspec.UnsetType):
        return ()
    aspect = evidence.width_px / max(1, evidence.height_px)
    recognised = _recognised_boxes(tracks, config) if config.calibration.valid else ()
    found = []
    for number, candidate in enumerate(evidence.candidates, 1):
        box = candidate.box_xyxy
        if box[3] <= config.perception.corridors.top:
            continue
        distance_m = nearest_range_m(box, aspect, config.calibration)
        if any(covered_frac(box, other) >= EXPLAINED_FRAC for other in recognised):
            continue
        if distance_m is not None and width_m(box, distance_m, config.calibration) > people.widest_m:
            continue
        found.append(_obstacle(number, candidate, distance_m))
    return tuple(found)


def width_m(box: BoxXyxy, distance_m: float, calibration: CalibrationConfig) -> float:
    """Width of what is boxed at this distance; infinite at the horizon and above."""
    if math.isinf(distance_m):
        return math.inf
    return 2.0 * portable.tan(0.5 * math.radians(calibration.hfov_deg)) * distance_m * (box[2] - box[0])


def _obstacle(number: int, candidate: Candidate, distance_m: float | None) -> Obstacle:
    return Obstacle(
        id=0,
        is_vessel=False,
        box=candidate.box_xyxy,
        severity=0.0,
        urgency=0.0,
        presence=1.0,
        is_danger=False,
        exempt_lanes=LANES,
        is_confirmed=False,
        distance_m=distance_m,
        candidate=number,
    )


def _recognised_boxes(tracks: TrackerState, config: Config) -> tuple[BoxXyxy, ...]:
    """Boxes of confirmed tracks that are surely something else than a person."""
    return tuple(
        track.box
        for track in tracks.in_view
        if track.label != "person"
        and is_confirmed(track, config.advisor.tracker)
        and track.display_confidence >= config.advisor.people.recognised_confidence
    )
