"""How each candidate passes each vessel under way: on which side, how near, when, and how surely. Pure.

Boat and vessel are taken to keep their velocities, the boat the one that it has after `horizon_s`, when it has turned.
The closest point then lies across its velocity relative to the vessel, and the side is the one on which that track
leaves the vessel. It also says who crosses whose bow: who leaves a vessel from starboard to port passes astern of it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paani import portable
from paani.arrays import F64, I64
from paani.messages import Label
from paani_services.navigator.avoidance.clearance import (
    APPROACH_S,
    UNDER_WAY_MPS,
    UNSEEN_GROWTH_MPS,
    WANTED_CPA_M,
    position_deviation_m,
    predicted_clearance_m,
)
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation, is_faster_than
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle

LEAST_CLOSING_MPS = 1e-6  # keeps directions finite
HULL_SPREAD_M = 0.2  # by which a hull of which the velocity is known may lie elsewhere: a cell
SOON_S = 15.0  # manoeuvres are due from then on: 13 s before a barge at 3 m/s, 8.5 s before a kayak at 1.5 m/s
PAST_S = 1.0  # in which an encounter ends: the time that half a hull takes
# Vessels that meet within this angle (20 degrees) of the reciprocal course pass port to port.
HEAD_ON_TANGENT = portable.tan(math.radians(20.0))
SIDE_BLEND = 0.17  # sine of the angle by which the side that is wanted changes from one to the other
# The side counts in full where the courses differ by more than this (45 degrees): who overtakes may pass on either.
PARALLEL_COSINE = portable.cos(math.radians(45.0))


class Passages(NamedTuple):
    """Of each vessel, along each candidate [vessels, candidates].

    port_m: from the boat's middle to the vessel's outline where that is left to port; negative where it is not, as far
    as it reaches over to starboard. starboard_m: the other way round. deviation_m: standard deviation of either.
    wanted_side: 1 where it should be left to port, -1 to starboard, 0 either, between where its course is between.
    weight: of the encounter, in [0, 1]: none of a vessel that may be adrift, is past, far off, or may be anywhere.
    It is that at the highest speed: who slows down behind a vessel has not put off the encounter.
    collision: of a vessel that is faster than the boat and met soon, the probability that it strikes the hull. Its
    distance has Student's t distribution with two degrees of freedom around the least one along the candidate's path:
    a velocity is fitted to few measurements, and whoever steers may change it.
    """

    port_m: F64
    starboard_m: F64
    deviation_m: F64
    wanted_side: F64
    weight: F64
    collision: F64

    @property
    def clearance_m(self) -> F64:
        """From the boat's middle to the outline at the closest point; negative where the boat's track meets it."""
        return np.asarray(np.maximum(self.port_m, self.starboard_m))

    @property
    def middle_m(self) -> F64:
        """How far to port its middle is left; negative: to starboard."""
        return np.asarray(0.5 * (self.port_m - self.starboard_m))


def find_passages(evaluation: CandidateEvaluation) -> Passages:
    """The passages of the candidates by the vessels that the plan keeps off, and by those known by AIS."""
    paths, request = evaluation.trajectories, evaluation.request
    known = zip(request.predicted_obstacles, evaluation.predicted.candidates_m, evaluation.is_faster, strict=True)
    vessels = [
        (obstacle, clearance_m, is_faster)
        for obstacle, clearance_m, is_faster in known
        if (obstacle.label is not Label.PERSON or is_faster) and obstacle.velocity.speed_mps > UNDER_WAY_MPS[0]
    ]
    time_s, fastest_mps = paths.time_s[:, None], float(evaluation.speeds_mps[0])
    vessels += [
        (each, predicted_clearance_m(each, paths.x_m, paths.y_m, time_s), is_faster_than(each, fastest_mps))
        for each in request.ais_vessels
    ]
    last = int(evaluation.is_in_horizon.sum()) - 1
    then_s = float(paths.time_s[last])
    step_s = then_s - float(paths.time_s[last - 1])
    east_mps = (paths.x_m[last] - paths.x_m[last - 1]) / step_s
    north_mps = (paths.y_m[last] - paths.y_m[last - 1]) / step_s
    settled = (paths.x_m[last] - then_s * east_mps, paths.y_m[last] - then_s * north_mps, east_mps, north_mps)
    count = int((evaluation.offsets_rad == evaluation.offsets_rad[0]).sum())
    fastest = np.arange(evaluation.offsets_rad.size) // count * count  # of each candidate's heading
    course_rad = request.start.yaw_rad + float(evaluation.offsets_rad[0])
    shape = (len(vessels), evaluation.offsets_rad.size)
    found = Passages(*(np.zeros(shape) for _ in Passages._fields))
    for number, (vessel, clearance_m, is_faster) in enumerate(vessels):
        distance_m = clearance_m + np.reshape(position_deviation_m(vessel, paths.time_s), (-1, 1))
        overlap_m = request.config.hull_radius_m - distance_m.min(axis=0)
        for row, value in zip(found, _pass(vessel, settled, fastest, course_rad, overlap_m), strict=True):
            row[number] = value
        found.collision[number] *= is_faster
    return found


def _pass(
    vessel: DynamicObstacle, boat: Sequence[F64], fastest: I64, course_rad: float, overlap_m: F64
) -> tuple[F64 | float, ...]:
    """One row of `Passages`. boat: east, north, and velocity of each candidate as if it had held that all along.

    fastest: for each candidate, the number of the one with its heading and the highest speed. overlap_m: by which the
    hull reaches into the predicted outline along the candidate's own path; negative: by which it stays clear.
    """
    x_m, y_m, boat_east_mps, boat_north_mps = boat
    velocity = vessel.velocity
    east_mps, north_mps = boat_east_mps - velocity.east_mps, boat_north_mps - velocity.north_mps
    closing_mps = np.maximum(np.sqrt(east_mps * east_mps + north_mps * north_mps), LEAST_CLOSING_MPS)
    east_m, north_m = vessel.east_m[:, None] - x_m, vessel.north_m[:, None] - y_m
    to_port_m = (east_mps * north_m - north_mps * east_m) / closing_mps
    time_s = ((east_mps * east_m + north_mps * north_m) / (closing_mps * closing_mps)).max(axis=0)[fastest]
    across_variance = np.asarray(velocity.variance_along(-north_mps / closing_mps, east_mps / closing_mps))
    # Without motion between the two there is no direction across it: that of the same heading, faster, stands for it.
    across_variance = np.where(closing_mps > LEAST_CLOSING_MPS, across_variance, across_variance[fastest])
    unknown_s = vessel.age_s + np.minimum(np.maximum(time_s, 0.0), APPROACH_S)
    deviation_m = np.sqrt(across_variance) * unknown_s + UNSEEN_GROWTH_MPS * vessel.age_s + vessel.position_std_m
    speed_mps = velocity.speed_mps
    speed_variance = float(velocity.variance_along(velocity.east_mps / speed_mps, velocity.north_mps / speed_mps))
    adrift_mps, sure_mps = UNDER_WAY_MPS
    under_way = _part((speed_mps - 2.0 * math.sqrt(speed_variance) - adrift_mps) / (sure_mps - adrift_mps))
    soon_under_way = under_way * _part((APPROACH_S - time_s) / (APPROACH_S - SOON_S))
    score = overlap_m / (deviation_m + HULL_SPREAD_M)
    return (
        to_port_m.min(axis=0),
        -to_port_m.max(axis=0),
        deviation_m,
        _wanted_side(vessel, speed_mps, course_rad),
        soon_under_way * _part(time_s / PAST_S) * _part(1.0 - deviation_m / WANTED_CPA_M),
        soon_under_way * 0.5 * (1.0 + score / np.sqrt(2.0 + score * score)),
    )


def _wanted_side(vessel: DynamicObstacle, speed_mps: float, course_rad: float) -> float:
    """Where to leave the vessel, by the angle between its course and the one that the boat wants to steer.

    The boat's own heading does not count: it changes while the boat gives way.
    """
    ahead, across = portable.cos(course_rad), portable.sin(course_rad)
    along = (vessel.velocity.east_mps * ahead + vessel.velocity.north_mps * across) / speed_mps
    to_port = (vessel.velocity.north_mps * ahead - vessel.velocity.east_mps * across) / speed_mps
    meeting = max(0.0, -along) * HEAD_ON_TANGENT
    side = min(1.0, max(-1.0, (to_port + meeting) / SIDE_BLEND))
    return side * min(1.0, (1.0 - along) / (1.0 - PARALLEL_COSINE))


def _part(value: F64 | float) -> F64:
    return np.asarray(np.minimum(np.maximum(value, 0.0), 1.0))
