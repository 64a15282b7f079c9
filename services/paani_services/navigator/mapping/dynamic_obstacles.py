"""Dynamic obstacles: tracks of detected boxes on the water, and their velocities. Pure.

A constant velocity is fitted to the positions of each track by weighted least squares. An obstacle whose velocity does
not differ significantly from rest is static.
"""

import math
from collections import Counter
from typing import NamedTuple

from paani.arrays import F64
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.mapping.association import associate_measurements
from paani_services.navigator.mapping.box_measurement import measure_positions
from paani_services.navigator.mapping.observation import Observation
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import BoxIds
from paani_services.navigator.mapping.velocity_fit import (
    PositionMeasurement,
    Velocity,
    VelocityEstimate,
    estimate_velocity,
    first_since,
    fit_velocity,
    velocity_if_significant,
)

DRIFT_FIT_S = 8.0  # a vessel adrift moves a metre in this time
MAX_DRIFT_MPS = 0.3  # vessels adrift are slower than this
MIN_DRIFT_DEVIATION_MPS = 0.05  # measured; a hull shows other parts of itself as it is passed


class DynamicObstacle(NamedTuple):
    """A tracked obstacle with a velocity: its outline now [n], when it was last seen, and the room kept around it.

    vacated_boxes: boxes that show it where it is no more. Where it was within `free_s` of when it was last seen stays
    occupied. track_id: the advisor's track that it was last seen as; 0: unknown. label: what the detector takes it for.
    mmsi: of a vessel that is known by AIS alone; 0: seen. position_std_m: of its outline when that was known.
    is_scanned: met by a range scanner's beams.
    """

    east_m: F64
    north_m: F64
    standoff_m: float
    velocity: Velocity
    age_s: float
    vacated_boxes: BoxIds
    track_id: int = 0
    label: Label = Label.VESSEL
    mmsi: int = 0
    position_std_m: float = 0.0
    is_scanned: bool = False

    @property
    def is_moving(self) -> bool:
        """Whether it moves for certain; a person who may swim has a standard deviation alone."""
        return any(self.velocity[:2])


def find_dynamic_obstacles(
    observations: tuple[Observation, ...], now_us: int, camera: Camera, config: PlannerConfig
) -> tuple[DynamicObstacle, ...]:
    """Track obstacles through the observations, oldest first, and estimate their velocities.

    Dynamic are obstacles that moved significantly when last seen whole, vessels adrift, and people in sight, who may
    begin to swim. Everything else is static and stays on the grid.
    """
    found = []
    pictures = (
        measure_positions(each, camera, config.mover_range_m)
        for each in observations
        if each.boxes and each.stamp_us <= now_us
    )
    for track in associate_measurements(pictures, config.fit_s):
        complete = _latest_whole(track, max(config.fit_s, DRIFT_FIT_S))
        velocity, last = estimate_velocity(complete, config.fit_s), complete[-1] if complete else track[-1]
        label = _commonest_label(track)
        if velocity is None and label is Label.VESSEL:
            velocity, last = _estimate_drift(track, complete), track[-1]
        if velocity is None:
            age_s = (now_us - track[-1].stamp_us) * 1e-6
            if label is Label.PERSON and len(track) > 1 and age_s <= config.occupied_s:
                found.append(_possible_swimmer(track, age_s, config))
            continue
        age_s, left = (now_us - last.stamp_us) * 1e-6, track[: first_since(track, round(config.free_s * 1e6))]
        found.append(
            DynamicObstacle(
                last.outline[0] + age_s * velocity.east_mps,
                last.outline[1] + age_s * velocity.north_mps,
                config.person_near_m if label is Label.PERSON else config.vessel_near_m,
                velocity,
                age_s,
                frozenset(each.box_id for each in left),
                _latest_track_id(track),
                label,
            )
        )
    return tuple(found)


def _latest_whole(track: list[PositionMeasurement], span_s: float) -> list[PositionMeasurement]:
    """The measurements that show it whole, from `span_s` before the last of them."""
    number = next((k for k in range(len(track), 0, -1) if track[k - 1].is_whole), 0)
    first = first_since(track[:number], round(span_s * 1e6))
    return [each for each in track[first:number] if each.is_whole]


def _estimate_drift(track: list[PositionMeasurement], complete: list[PositionMeasurement]) -> Velocity | None:
    """The velocity of a vessel adrift, estimated over `DRIFT_FIT_S`.

    It is that of its middle, or, where the newest picture does not show the vessel whole, of the more certain end.
    """
    estimates = [_fit_recent(complete, track[-1].stamp_us)]
    if not track[-1].is_whole:
        estimates += [_fit_recent(measurements_of_end(track, end), track[-1].stamp_us) for end in (0, 1)]
    known = [each for each in estimates if each is not None]
    velocity = velocity_if_significant(max(known, key=lambda each: each.squared_significance, default=None))
    if velocity is None:
        return None
    deviation_mps = max(velocity.deviation_mps, MIN_DRIFT_DEVIATION_MPS)
    if velocity.speed_mps - 2.0 * deviation_mps > MAX_DRIFT_MPS:
        return None
    return velocity._replace(deviation_mps=deviation_mps)


def _fit_recent(measurements: list[PositionMeasurement], last_us: int) -> VelocityEstimate | None:
    """The velocity over `DRIFT_FIT_S`, if the newest measurement is that recent."""
    if not measurements or (last_us - measurements[-1].stamp_us) * 1e-6 > DRIFT_FIT_S:
        return None
    return fit_velocity(measurements, DRIFT_FIT_S)


def measurements_of_end(track: list[PositionMeasurement], end: int) -> list[PositionMeasurement]:
    """The measurements that show the left end (0) or the right end (1), with that end as their position."""
    return [
        each._replace(position_m=(float(each.outline[0][-end]), float(each.outline[1][-end])))
        for each in track
        if each.shows_ends[end]
    ]


def _possible_swimmer(track: list[PositionMeasurement], age_s: float, config: PlannerConfig) -> DynamicObstacle:
    """A person seen more than once, who may stand, or swim in any direction.

    The speed is as high as the measurements do not rule out, those cut by the picture's sides included. The cells where
    the person is seen stay occupied.
    """
    estimate, last = fit_velocity(track, config.fit_s), track[-1]
    fastest_mps = config.person_mps
    if estimate is not None:
        fastest_mps = min(fastest_mps, math.hypot(*estimate.velocity_mps) + estimate.deviation_mps)
    return DynamicObstacle(
        *last.outline,
        config.person_near_m,
        Velocity(0.0, 0.0, fastest_mps),
        age_s,
        frozenset(),
        _latest_track_id(track),
        Label.PERSON,
    )


def _commonest_label(track: list[PositionMeasurement]) -> Label:
    """What most pictures show it as; of two as common, what the newest shows it as."""
    return Counter(each.label for each in reversed(track)).most_common(1)[0][0]


def _latest_track_id(track: list[PositionMeasurement]) -> int:
    """The advisor's track of the newest measurement that has one; the association here does not depend on it."""
    return next((each.track_id for each in reversed(track) if each.track_id), 0)
