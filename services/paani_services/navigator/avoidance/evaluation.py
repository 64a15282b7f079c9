"""What each candidate of the local planner meets: clearances, people, unknown water. Pure."""

import math
from typing import NamedTuple

import numpy as np

from paani.arrays import F64, Bools
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.avoidance.clearance import (
    SWIMMING_MPS,
    UNDER_WAY_MPS,
    DynamicClearance,
    clearance_fields_m,
    interpolate_fields,
    is_coming_near,
    is_within_horizon,
    least_of_obstacles_m,
    predict_clearances,
    separation_margin_m,
)
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import (
    PIVOT_SPEED_FRACTION,
    BoatState,
    Trajectories,
    roll_out,
    sample_candidates,
    with_coasting_and_resting,
)
from paani_services.navigator.mapping.distance_field import distance_field_m
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle

# Deviation from the desired course up to which a candidate leads onward [rad]; beyond it less than a quarter of the
# distance sailed is made good.
ONWARD_SECTOR_RAD = math.radians(75.0)


class CandidateEvaluation(NamedTuple):
    """What each candidate meets: [candidates], or [times, candidates] of `trajectories`.

    paths: the trajectories, and those of the boat that coasts and that rests.
    deviation_rad: off the desired course; is_onward: within `ONWARD_SECTOR_RAD` of it.
    is_pivot_to_course: whether it is the pivot to the desired course.
    is_in_horizon: times within `horizon_s` [times, 1]; is_in_checked_range: those, or within `room_m` of path.
    static_clearance_m: to static obstacles; clearance_m: to dynamic ones as well; person_distance_m: to seen people.
    seen_clearance_m: as clearance_m, without what may have moved unseen.
    tight_clearance_m: hull and `tight_margin_m`.
    is_give_way_needed: a dynamic obstacle will come nearer than that to a boat that coasts to rest.
    predicted: the clearances to each of the request's `predicted_obstacles`.
    is_faster: which of them are under way for certain, and faster than the boat may be, but for who may swim
    [obstacles]. How probably they strike the boat is a cost.
    runs_down: which of these will come that near to a boat at rest. They refuse nothing, as it is met as well.
    dynamic: the clearances to all others, which is what the other fields count as dynamic obstacles.
    coasting_clearance_m: the least within the horizon with the thrusters off; coasting_static_m: to static ones.
    """

    request: PlanRequest
    offsets_rad: F64
    speeds_mps: F64
    deviation_rad: F64
    is_onward: Bools
    is_full_speed: Bools
    is_pivot: Bools
    is_pivot_to_course: Bools
    trajectories: Trajectories
    paths: Trajectories
    is_in_horizon: Bools
    is_in_checked_range: Bools
    static_clearance_m: F64
    clearance_m: F64
    seen_clearance_m: F64
    person_distance_m: F64
    is_unknown: Bools
    tight_clearance_m: float
    is_give_way_needed: bool
    predicted: DynamicClearance
    is_faster: Bools
    runs_down: Bools
    dynamic: DynamicClearance
    coasting_clearance_m: float
    coasting_static_m: float

    def separation_m(self, step: PlannerConfig) -> F64:
        """Clearance to each dynamic obstacle beyond the required one [obstacles, times, candidates].

        The whole margin is required, or that of `step` where one would come to a boat at rest: only then is being at
        rest no better than passing it closely.
        """
        config = step if self.is_give_way_needed else self.request.config
        return separation_margin_m(self.dynamic, self.trajectories.time_s, config)

    @property
    def is_safe_at_rest(self) -> bool:
        """Whether nothing comes near a boat that coasts to rest."""
        return not self.is_give_way_needed and self.coasting_clearance_m >= self.tight_clearance_m


def evaluate_candidates(request: PlanRequest) -> CandidateEvaluation:
    """Sample the candidates around the setpoint, roll each out, and look up what it meets."""
    grid, start, config, obstacles = request.grid, request.start, request.config, request.predicted_obstacles
    offsets_rad, speeds_mps = sample_candidates(start, request.setpoint, config)
    trajectories = roll_out(start, offsets_rad, speeds_mps, config)
    paths = with_coasting_and_resting(trajectories, start, config)
    fields_m = (*clearance_fields_m(grid, config), distance_field_m(grid.people), distance_field_m(grid.unknown))
    static_m, seen_m, person_m, unknown_m = interpolate_fields(grid, fields_m, paths)
    tight_m = config.hull_radius_m + config.tight_margin_m
    is_in_horizon = is_within_horizon(trajectories.time_s, config)[:, None]
    last = int(is_in_horizon.sum()) - 1
    at_rest = BoatState(float(paths.x_m[last, -2]), float(paths.y_m[last, -2]), start.yaw_rad)
    comes = np.array([is_coming_near(each, at_rest, tight_m) for each in obstacles], dtype=np.bool_)
    is_faster = np.array([is_faster_than(each, float(speeds_mps[0])) for each in obstacles], dtype=np.bool_)
    predicted, runs_down = predict_clearances(obstacles, paths, config), comes & is_faster
    dynamic = predicted.of(~runs_down)
    dynamic_m = least_of_obstacles_m(dynamic.candidates_m)
    coasting_m = np.minimum(static_m[:, -2], least_of_obstacles_m(dynamic.coasting_m))
    deviation_rad = angles_between_rad(offsets_rad, float(offsets_rad[0]))
    is_pivot = speeds_mps == PIVOT_SPEED_FRACTION * speeds_mps[0]
    return CandidateEvaluation(
        request,
        offsets_rad,
        speeds_mps,
        deviation_rad=deviation_rad,
        is_onward=deviation_rad <= ONWARD_SECTOR_RAD,
        is_full_speed=speeds_mps == speeds_mps[0],
        is_pivot=is_pivot,
        is_pivot_to_course=np.asarray(is_pivot & (offsets_rad == offsets_rad[0])),
        trajectories=trajectories,
        paths=paths,
        is_in_horizon=is_in_horizon,
        is_in_checked_range=is_in_horizon | (trajectories.travelled_m <= config.room_m),
        static_clearance_m=static_m[:, :-2],
        clearance_m=np.minimum(static_m[:, :-2], dynamic_m),
        seen_clearance_m=np.minimum(seen_m[:, :-2], dynamic_m),
        person_distance_m=person_m[:, :-2],
        is_unknown=unknown_m[:, :-2] < config.hull_radius_m,
        tight_clearance_m=tight_m,
        is_give_way_needed=bool(comes.any()),
        predicted=predicted,
        is_faster=is_faster,
        runs_down=runs_down,
        dynamic=dynamic,
        coasting_clearance_m=float(coasting_m[: last + 1].min()),
        coasting_static_m=float(static_m[: last + 1, -2].min()),
    )


def is_faster_than(obstacle: DynamicObstacle, limit_mps: float) -> bool:
    """Whether it is under way for certain and goes faster than the boat may; nobody who swims counts.

    A person who is faster for certain than anybody swims is aboard of what goes there.
    """
    least_mps = SWIMMING_MPS if obstacle.label is Label.PERSON else UNDER_WAY_MPS[1]
    speed_mps = obstacle.velocity.speed_mps
    return speed_mps - 2.0 * obstacle.velocity.deviation_mps > least_mps and speed_mps > limit_mps


def angles_between_rad(angles_rad: F64, other_rad: float) -> F64:
    """The angle between each and the other, both wrapped: [0, pi]."""
    off = np.abs(angles_rad - other_rad)
    return np.asarray(np.minimum(off, 2.0 * math.pi - off))
