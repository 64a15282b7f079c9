"""The named costs of a candidate of the local planner. Pure.

The unit is the cost of a quarter turn off the desired course.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from paani import portable
from paani.arrays import F64, Bools
from paani.geometry import wrap_rad
from paani_services.navigator.avoidance.clearance import (
    WANTED_CPA_M,
    DynamicClearance,
    advanced_in_time,
    least_of_obstacles_m,
    predict_clearances,
    separation_margin_m,
)
from paani_services.navigator.avoidance.evaluation import CandidateEvaluation
from paani_services.navigator.avoidance.passages import Passages

QUARTER_TURN_RAD = 0.5 * math.pi
PATH_OBSTACLE_WEIGHT = 3.0  # an obstacle on the path at the boat; it falls linearly to none at `look_m`
PROXIMITY_WEIGHT = 0.6  # required clearance just kept; it falls with the square to none at PROXIMITY_RANGE_M beyond it
PROXIMITY_RANGE_M = 2.0
# A metre of intrusion into the safety margin of what was seen, held over the whole horizon. What may have moved unseen
# refuses candidates, but a boat at rest there harms nobody, so it is not driven out, and turned away from its course.
MARGIN_INTRUSION_WEIGHT = 10.0
UNKNOWN_WATER_WEIGHT = 0.3  # a path all over unknown water: the boat turns to what it sees, and sees further from there
LOST_PROGRESS_WEIGHT = 0.3  # nothing made good along the desired course
HEADING_CHANGE_WEIGHT = 0.15  # a quarter turn between a candidate's turn and the one that the plan before still makes
# Of a candidate's other costs, a quarter turn between the two: from picture to picture the costs of one heading change
# by less, with what is seen and how far off it is taken to be.
HEADING_CHANGE_FRAC = 0.1
# And of what a blow costs it, times its probability: the better side to leave a vessel on changes with each
# measurement of its velocity, and turning to the other costs the way that was made. Of 120 vessels whose velocity is
# measured within 0.25 m/s, known 6 s before, 30 strike without this and 23 with it. What is not imminent is still
# left on the side that courtesy asks for.
COLLISION_CHANGE_FRAC = 1.0
ADVICE_WEIGHT = 0.15  # nothing turned to the advised side (M5); it falls linearly to none at ADVISED_TURN_RAD
ADVISED_TURN_RAD = math.radians(25.0)
# A vessel on a collision course; it falls linearly to none at WANTED_CPA_M. With 2, turning further away is cheaper
# than not doing so until 2 s before the closest point (2 x 0.6 m/s x 2 s / 3.5 m against 2 / pi, per rad).
GIVE_WAY_WEIGHT = 2.0
# To be struck by a vessel for certain. With 12, a tenth less of it is worth a quarter turn off the course.
COLLISION_WEIGHT = 12.0
# A vessel that is left on the other side than courtesy asks for; it falls to none from WANTED_CPA_M to twice that.
# With 1 the other side is taken where it saves more than a quarter turn.
PASSING_SIDE_WEIGHT = 1.0
SIDE_SCALE_M = 0.5  # by which a side is certain of a vessel whose velocity is known: the reach of half a hull


class CandidateCosts(NamedTuple):
    """Each cost by name [candidates], as `paani.messages.HeadingCosts` tells them."""

    course: F64
    progress: F64
    heading_change: F64
    advice: F64
    unknown_water: F64
    proximity: F64
    path_obstacle: F64
    margin: F64
    give_way: F64
    passing_side: F64
    collision: F64

    @property
    def total(self) -> F64:
        """Their sum."""
        return np.asarray(functools.reduce(np.add, self))


def weigh_candidates(evaluation: CandidateEvaluation, margin_m: F64, passages: Passages) -> CandidateCosts:
    """The costs of each candidate, without courtesy. margin_m: beyond the required clearance [times, candidates]."""
    request, config, previous = evaluation.request, evaluation.request.config, evaluation.request.previous
    speeds_mps, deviation_rad = evaluation.speeds_mps, evaluation.deviation_rad
    travelled_m, is_in_horizon = evaluation.trajectories.travelled_m, evaluation.is_in_horizon
    made_good = speeds_mps / speeds_mps[0] * np.array([portable.cos(each) for each in deviation_rad.tolist()])
    change_rad = np.zeros_like(deviation_rad)
    if previous is not None and previous.speed_mps > 0.0:
        # Of two headings abaft the beam that lie side by side one may be reached over port, one over starboard.
        change_rad = np.abs(evaluation.offsets_rad - wrap_rad(previous.heading_rad - request.start.yaw_rad))
    disregard = np.clip(1.0 - request.setpoint.advised_side * evaluation.offsets_rad / ADVISED_TURN_RAD, 0.0, 1.0)
    is_looked_at = travelled_m <= config.look_m
    ahead_m = least_of_obstacles_m(separation_margin_m(_predict_leading(evaluation), evaluation.paths.time_s, config))
    nearest_m = np.where(is_in_horizon, np.minimum(margin_m, ahead_m), np.inf).min(axis=0)
    nearness = np.clip(1.0 - nearest_m / PROXIMITY_RANGE_M, 0.0, 1.0)
    first_m = np.where((margin_m < 0.0) & is_looked_at, travelled_m, np.inf).min(axis=0)
    path_obstacle = np.clip(1.0 - first_m / config.look_m, 0.0, 1.0) if config.look_m > 0.0 else np.zeros_like(first_m)
    intrusion_m = np.maximum(config.hull_radius_m + config.margin_m - evaluation.seen_clearance_m, 0.0)
    mean_intrusion_m = np.add.accumulate(np.where(is_in_horizon, intrusion_m, 0.0))[-1] / float(is_in_horizon.sum())
    struck = passages.collision.max(axis=0, initial=0.0)
    costs = CandidateCosts(
        course=deviation_rad / QUARTER_TURN_RAD,
        progress=LOST_PROGRESS_WEIGHT * (1.0 - made_good),
        heading_change=np.zeros_like(deviation_rad),
        advice=ADVICE_WEIGHT * abs(request.setpoint.advised_side) * disregard,
        unknown_water=UNKNOWN_WATER_WEIGHT * (evaluation.is_unknown & is_looked_at).sum(axis=0) / len(is_looked_at),
        proximity=PROXIMITY_WEIGHT * nearness * nearness,
        path_obstacle=PATH_OBSTACLE_WEIGHT * path_obstacle,
        margin=MARGIN_INTRUSION_WEIGHT * mean_intrusion_m,
        give_way=np.zeros_like(deviation_rad),
        passing_side=np.zeros_like(deviation_rad),
        collision=COLLISION_WEIGHT * struck,
    )
    weight = (
        HEADING_CHANGE_WEIGHT + HEADING_CHANGE_FRAC * costs.total + COLLISION_CHANGE_FRAC * struck * costs.collision
    )
    return costs._replace(heading_change=weight * change_rad / QUARTER_TURN_RAD)


def add_courtesy(costs: CandidateCosts, passages: Passages, is_refused: Bools) -> CandidateCosts:
    """The costs with those of courtesy towards vessels under way (after rules 13 to 17 of the collision regulations).

    They lead the boat no further into the safety margin: a candidate that intrudes more than the one it would take
    without courtesy is given their whole weight, and so gains nothing by them.
    """
    if not passages.weight.any() or is_refused.all():
        return costs
    clearance, scale_m = passages.clearance_m / WANTED_CPA_M, passages.deviation_m + SIDE_SCALE_M
    beyond_m = passages.middle_m * np.sign(passages.wanted_side)
    is_wrong = 0.5 * (1.0 - beyond_m / np.sqrt(beyond_m * beyond_m + scale_m * scale_m))
    near, side = np.clip(1.0 - clearance, 0.0, 1.0), np.abs(passages.wanted_side) * np.clip(2.0 - clearance, 0.0, 1.0)
    intrudes_more = costs.margin > costs.margin[np.where(is_refused, np.inf, costs.total).argmin()]
    give_way, passing_side = ((passages.weight * each).max(axis=0) for each in (near, side * is_wrong))
    return costs._replace(
        give_way=GIVE_WAY_WEIGHT * np.where(intrudes_more, 1.0, give_way),
        passing_side=PASSING_SIDE_WEIGHT * np.where(intrudes_more, 1.0, passing_side),
    )


def _predict_leading(evaluation: CandidateEvaluation) -> DynamicClearance:
    """The clearances where each obstacle will be `lead_s` later; those that do not move are predicted already."""
    request, obstacles = evaluation.request, evaluation.request.predicted_obstacles
    is_still = np.array([not each.is_moving for each in obstacles], dtype=np.bool_)
    is_leading = ~is_still & ~evaluation.runs_down
    leading = [advanced_in_time(obstacles[k], request.config.lead_s) for k in np.flatnonzero(is_leading)]
    later, still = predict_clearances(leading, evaluation.paths, request.config), evaluation.predicted.of(is_still)
    return DynamicClearance(*(np.concatenate(each) for each in zip(later, still, strict=True)))
