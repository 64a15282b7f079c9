"""The occupancy grid of the planner as a message in the map. Pure; it decides nothing."""

from __future__ import annotations

import numpy as np

from paani import messages as m
from paani.config import NavigatorConfig
from paani.occupancy_cells import pack_cells
from paani_services.navigator.avoidance.replanning import PlannerState
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS
from paani_services.navigator.mapping.shallow_cells import apply_shallow_cells, cells_on_grid
from paani_services.navigator.mapping.water_map import map_water


def occupancy_around(
    planner: PlannerState, odometry: m.Odometry | None, now_us: int, camera: Camera, config: NavigatorConfig
) -> m.OccupancyGrid | None:
    """The grid that a plan would be made on now, moved from the frame of dead reckoning to the map.

    None where the planner does not act on this camera, before anything was seen, and without a healthy position.
    """
    here, observations = planner.memory.odom_pose, planner.memory.observations
    if not config.planner.acts_on(camera.calibration) or here is None or not observations:
        return None
    if odometry is None or not odometry.healthy:
        return None
    grid, _ = map_water(observations, (here.x_m, here.y_m), now_us, camera, config.planner, planner.memory.scans)
    grid = apply_shallow_cells(grid, cells_on_grid(planner.soundings.cells, (here.x_m, here.y_m)))
    cells = np.full(grid.occupied.shape, m.Occupancy.UNKNOWN, np.uint8)
    cells[grid.free] = m.Occupancy.FREE
    cells[grid.blind_zone] = m.Occupancy.BLIND_ZONE
    cells[grid.occupied] = m.Occupancy.OCCUPIED
    return m.OccupancyGrid(
        source_us=odometry.source_us,
        west_m=grid.west_m + odometry.x_m - here.x_m,
        south_m=grid.south_m + odometry.y_m - here.y_m,
        cell_m=CELL_M,
        columns=GRID_CELLS,
        rows=GRID_CELLS,
        cells=pack_cells(cells),
    )
