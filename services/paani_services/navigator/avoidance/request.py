"""What the local planner is asked."""

from collections.abc import Sequence

import msgspec

from paani.config import PlannerConfig
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid


class PlanRequest(msgspec.Struct, frozen=True, kw_only=True):
    """All that a plan depends on: equal requests get equal plans.

    grid, obstacles: the water around the boat, and what moves on it, which is not on the grid; all in one frame.
    start: the boat in that frame. previous: the plan in force until now, None without one.
    may_wait: whether the boat may wait for obstacles to pass. Once it may no longer, people who may swim but were not
    seen to are static obstacles.
    """

    grid: OccupancyGrid
    start: BoatState
    setpoint: GuidanceSetpoint
    config: PlannerConfig
    obstacles: Sequence[DynamicObstacle] = ()
    previous: Plan | None = None
    may_wait: bool = True

    @property
    def predicted_obstacles(self) -> list[DynamicObstacle]:
        """Those that the plan keeps off: seen within `unseen_s`."""
        return [
            each for each in self.obstacles if each.age_s <= self.config.unseen_s and (self.may_wait or each.is_moving)
        ]
