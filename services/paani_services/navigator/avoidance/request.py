"""What the local planner is asked."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.avoidance.clearance import predicted_clearance_m
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid


class PlanRequest(msgspec.Struct, frozen=True, kw_only=True):
    """All that a plan depends on: equal requests get equal plans.

    grid, obstacles: the water around the boat, and what moves on it, which is not on the grid; all in one frame.
    ais_vessels: what is known by AIS alone: it has costs, and refuses nothing.
    start: the boat in that frame. previous: the plan in force until now, None without one.
    may_wait: whether the boat may wait for obstacles to pass. Once it may no longer, people who may swim but were not
    seen to are static obstacles.
    """

    grid: OccupancyGrid
    start: BoatState
    setpoint: GuidanceSetpoint
    config: PlannerConfig
    obstacles: Sequence[DynamicObstacle] = ()
    ais_vessels: Sequence[DynamicObstacle] = ()
    previous: Plan | None = None
    may_wait: bool = True

    def nearest_person_m(self) -> float:
        """From the boat's middle to where the nearest remembered person may be by now; infinite without one.

        Whoever was seen again may have swum since, by one standard deviation.
        """
        rows, columns = np.nonzero(self.grid.possible_people)
        east_m = np.asarray(self.grid.west_m + (columns + 0.5) * CELL_M)
        north_m = np.asarray(self.grid.south_m + (rows + 0.5) * CELL_M)
        off_east_m, off_north_m = east_m - self.start.x_m, north_m - self.start.y_m
        square_m2 = float((off_east_m * off_east_m + off_north_m * off_north_m).min(initial=math.inf))
        x_m, y_m, now_s = np.array([self.start.x_m]), np.array([self.start.y_m]), np.zeros(1)
        people = [each for each in self.obstacles if each.label is Label.PERSON]
        outlines_m = [float(predicted_clearance_m(each, x_m, y_m, now_s)[0]) + each.standoff_m for each in people]
        return min(math.sqrt(square_m2), *outlines_m, math.inf)

    @property
    def predicted_obstacles(self) -> list[DynamicObstacle]:
        """Those that the plan keeps off: seen within `unseen_s`."""
        return [
            each for each in self.obstacles if each.age_s <= self.config.unseen_s and (self.may_wait or each.is_moving)
        ]
