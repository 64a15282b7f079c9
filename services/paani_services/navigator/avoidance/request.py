"""What the local planner is asked."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from paani.arrays import F64
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.avoidance.clearance import position_deviation_m
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
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

    def nearest_person_m(self) -> float:
        """From the boat's middle to where the nearest remembered person may be by now; infinite without one.

        Whoever was seen again may have swum since, by one standard deviation.
        """
        rows, columns = np.nonzero(self.grid.possible_people)
        east_m = np.asarray(self.grid.west_m + (columns + 0.5) * CELL_M)
        north_m = np.asarray(self.grid.south_m + (rows + 0.5) * CELL_M)
        people = [each for each in self.obstacles if each.label is Label.PERSON]
        return min(
            self._distance_m(east_m, north_m),
            *(self._distance_m(each.east_m, each.north_m) - float(position_deviation_m(each, 0.0)) for each in people),
            math.inf,
        )

    def _distance_m(self, east_m: F64, north_m: F64) -> float:
        """From the boat's middle to the nearest of these places; infinite without one."""
        off_east_m, off_north_m = east_m - self.start.x_m, north_m - self.start.y_m
        return math.sqrt(float((off_east_m * off_east_m + off_north_m * off_north_m).min(initial=math.inf)))

    @property
    def predicted_obstacles(self) -> list[DynamicObstacle]:
        """Those that the plan keeps off: seen within `unseen_s`."""
        return [
            each for each in self.obstacles if each.age_s <= self.config.unseen_s and (self.may_wait or each.is_moving)
        ]
