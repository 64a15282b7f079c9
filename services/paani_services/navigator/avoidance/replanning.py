"""The metric planner at work: what the pictures show is remembered, and every new one gives a new plan. Pure."""

import math

import msgspec

from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani.messages import Evidence, Odometry
from paani_services.navigator.avoidance.fence import Fence
from paani_services.navigator.avoidance.fence_cells import fenced
from paani_services.navigator.avoidance.planner import Plan, plan
from paani_services.navigator.avoidance.rollout import CARRIED_MPS, Start, Wish
from paani_services.navigator.mapping.dynamic_obstacles import is_denied, movers
from paani_services.navigator.mapping.observation import Memory, remember
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import Moving, lay

SAME_COURSE_RAD = math.radians(3.0)


class Pilot(msgspec.Struct, frozen=True):
    """What was seen, the plan in force, the course and side it was made for, when, and on which picture.

    waits_us: since when no plan has led the boat on.
    """

    memory: Memory = Memory()
    plan: Plan | None = None
    course_rad: float = 0.0
    side: float = 0.0
    planned_us: int = 0
    waits_us: int | None = None
    frame: tuple[int, int] = (-1, -1)


def looked(pilot: Pilot, odometry: Odometry | None, evidence: Evidence | None, config: PlannerConfig) -> Pilot:
    """The pilot with what is new to remember."""
    return msgspec.structs.replace(pilot, memory=remember(pilot.memory, odometry, evidence, config))


def steered(
    pilot: Pilot,
    odometry: Odometry,
    wish: Wish,
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    fence: Fence = (),
) -> tuple[Pilot, Plan]:
    """The plan for this wish, within the fence and no faster than wished for.

    It is made anew for a new picture, another course or side, or after `replan_s`.
    """
    held, here = pilot.plan, pilot.memory.here
    if here is None:
        return pilot, Plan(odometry.yaw_rad, 0.0)
    is_other = wish.side != pilot.side or abs(wrap_rad(wish.course_rad - pilot.course_rad)) > SAME_COURSE_RAD
    is_new = is_other or pilot.memory.frame != pilot.frame
    if held is None or is_new or not 0.0 <= (now_us - pilot.planned_us) * 1e-6 < config.replan_s:
        sights = pilot.memory.sights
        moving = movers(sights, now_us, camera, config) if config.predict else ()
        boxes: Moving = frozenset().union(*(mover.boxes for mover in moving))
        grid = lay(sights, (here.x_m, here.y_m), now_us, camera, config, boxes)
        moving = tuple(mover for mover in moving if not is_denied(mover, grid))
        grid = fenced(grid, fence, (odometry.x_m - here.x_m, odometry.y_m - here.y_m))
        moves = (odometry.surge_mps, odometry.yaw_rate_radps, odometry.sway_mps)
        start = Start(here.x_m, here.y_m, odometry.yaw_rad, *moves)
        since_us = now_us if pilot.waits_us is None else pilot.waits_us
        patient = (now_us - since_us) * 1e-6 < config.patience_s
        held = plan(grid, start, wish, held, config, moving, patient=patient)
        waits_us = since_us if held.waits or held.speed_mps == 0.0 else None
        pilot = Pilot(pilot.memory, held, wish.course_rad, wish.side, now_us, waits_us, pilot.memory.frame)
    return pilot, msgspec.structs.replace(held, speed_mps=min(held.speed_mps, wish.speed_mps))


def brakes(pilot: Pilot, odometry: Odometry, now_us: int, config: PlannerConfig) -> bool:
    """Whether a boat that no plan moves any more is still to take its way off: what is left may be wind and current."""
    waits_us = pilot.waits_us
    is_new = waits_us is not None and (now_us - waits_us) * 1e-6 < config.brake_s
    return is_new and odometry.surge_mps > CARRIED_MPS
