"""The course of a boat that makes no headway, round what bars its path. Pure."""

from paani.config import PlannerConfig
from paani.messages import Odometry
from paani_services.navigator.avoidance.detour import REACH_M, find_detour_rad
from paani_services.navigator.avoidance.replanning import PlannerState
from paani_services.navigator.guidance.headway import path_ahead_m
from paani_services.navigator.guidance.mission_progress import LegSetpoint
from paani_services.navigator.mapping.barriers import barriers_around


def course_round_rad(
    state: PlannerState, setpoint: LegSetpoint, odometry: Odometry, config: PlannerConfig
) -> float | None:
    """The course; None where nothing that the boat remembers bars its path, or no way round is known."""
    here = state.memory.odom_pose
    if here is None:
        return None
    off_x_m, off_y_m = odometry.x_m - here.x_m, odometry.y_m - here.y_m  # of the map against dead reckoning
    path_m = path_ahead_m(setpoint, (odometry.x_m, odometry.y_m), REACH_M)
    path_m = [(x_m - off_x_m, y_m - off_y_m) for x_m, y_m in path_m]
    here_m = (here.x_m, here.y_m)
    return find_detour_rad(barriers_around(state.barriers, here_m), here_m, setpoint.course_rad, path_m, config)
