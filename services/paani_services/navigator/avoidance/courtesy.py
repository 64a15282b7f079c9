"""Encounters with what moves on the water: how they meet, how near, and what the order does about it. Pure.

It is knowledge for people and steers nothing; the planner's costs do. The boat gives way to everything. It is courtesy,
not compliance with the collision regulations: a boat with one camera does not keep the lookout that they ask for.
"""

import math
from typing import NamedTuple

from paani.encounters import classify_encounter
from paani.geometry import wrap_rad
from paani.messages import EncounterClass, NavCommand
from paani_services.navigator.avoidance.clearance import (
    WANTED_CPA_M,
    Approach,
    closest_point_of_approach,
    position_deviation_m,
)
from paani_services.navigator.avoidance.rollout import BoatState
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle

WAITING_MPS = 0.1  # an order this slow is to wait, or to turn on the spot
ASIDE_RAD = math.radians(10.0)  # turns of more than this leave the course of what overtakes
MEETINGS = {
    EncounterClass.HEAD_ON: "head on",
    EncounterClass.CROSSING_STARBOARD: "crossing from starboard",
    EncounterClass.CROSSING_PORT: "crossing from port",
    EncounterClass.OVERTAKEN: "overtaking us",
    EncounterClass.OVERTAKING: "ahead and slower",
}


class Encounter(NamedTuple):
    """One obstacle that the boat meets, and how.

    approach: by the present velocities of both. cpa_std_m: standard deviation of its distance.
    """

    obstacle: DynamicObstacle
    kind: EncounterClass
    approach: Approach
    cpa_std_m: float


def assess_encounter(
    obstacle: DynamicObstacle, boat: BoatState, before: EncounterClass = EncounterClass.NONE
) -> Encounter:
    """How the boat meets an obstacle; `before`: the class so far, which is kept until they are past each other.

    An encounter begins when the closest point, less its standard deviation, is nearer than `WANTED_CPA_M`.
    """
    approach = closest_point_of_approach(obstacle, boat)
    cpa_std_m = float(position_deviation_m(obstacle, approach.tcpa_s))
    kind = before
    if approach.tcpa_s == 0.0 or not obstacle.is_moving:
        kind = EncounterClass.NONE
    elif before is EncounterClass.NONE and approach.cpa_m - cpa_std_m < WANTED_CPA_M:
        bearing_deg, aspect_deg = _bearing_and_aspect_deg(obstacle, boat, 0.0)
        kind = classify_encounter(bearing_deg, aspect_deg, boat.surge_mps, obstacle.velocity.speed_mps)
    return Encounter(obstacle, kind, approach, cpa_std_m)


def describe_encounter(encounter: Encounter, boat: BoatState, order: NavCommand) -> str:
    """The encounter in words, with what the order does about it; empty where it is none."""
    if encounter.kind is EncounterClass.NONE:
        return ""
    obstacle = encounter.obstacle
    action = _describe_action(encounter, boat, order)
    return f"Give way: {_name(obstacle)} {MEETINGS[encounter.kind]}, {action}"


def _name(obstacle: DynamicObstacle) -> str:
    if obstacle.is_scanned:
        return "something (lidar)"
    number = f" #{obstacle.track_id}" if obstacle.track_id else f" {obstacle.mmsi} (AIS)" if obstacle.mmsi else ""
    return f"{obstacle.label.value}{number}"


def _describe_action(encounter: Encounter, boat: BoatState, order: NavCommand) -> str:
    if not order.enable:
        return "lying without thrust"
    if order.speed_mps <= WAITING_MPS:
        return "waiting until it is past"
    if encounter.kind is EncounterClass.OVERTAKEN:
        return "moving aside" if abs(wrap_rad(order.heading_rad - boat.yaw_rad)) > ASIDE_RAD else "keeping the course"
    ordered = boat._replace(yaw_rad=order.heading_rad, surge_mps=order.speed_mps, sway_mps=0.0)
    then_s = closest_point_of_approach(encounter.obstacle, ordered).tcpa_s
    if then_s == 0.0:
        return "turning away from it"
    bearing_deg, aspect_deg = _bearing_and_aspect_deg(encounter.obstacle, ordered, then_s)
    if encounter.kind in (EncounterClass.CROSSING_STARBOARD, EncounterClass.CROSSING_PORT):
        return "passing astern of it" if abs(aspect_deg) > 90.0 else "passing ahead of it"
    return f"passing it on our {'port' if bearing_deg < 0.0 else 'starboard'} side"


def _bearing_and_aspect_deg(obstacle: DynamicObstacle, boat: BoatState, then_s: float) -> tuple[float, float]:
    """Bearing of the obstacle's middle off the bow, and of the boat off the obstacle's course, `then_s` from now.

    Clockwise, (-180, 180] deg.
    """
    velocity, count = obstacle.velocity, obstacle.east_m.size
    course_rad = math.atan2(velocity.north_mps, velocity.east_mps)
    east_mps = velocity.east_mps - boat.surge_mps * math.cos(boat.yaw_rad)
    north_mps = velocity.north_mps - boat.surge_mps * math.sin(boat.yaw_rad)
    east_m = math.fsum(obstacle.east_m) / count - boat.x_m + then_s * east_mps
    north_m = math.fsum(obstacle.north_m) / count - boat.y_m + then_s * north_mps
    towards_rad = math.atan2(north_m, east_m)
    return (
        -math.degrees(wrap_rad(towards_rad - boat.yaw_rad)),
        -math.degrees(wrap_rad(towards_rad + math.pi - course_rad)),
    )
