"""The water around a position: the occupancy grid, and what moves on it. Pure."""

from paani.config import PlannerConfig
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle, find_dynamic_obstacles
from paani_services.navigator.mapping.observation import Observation
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import BoxIds, OccupancyGrid, build_occupancy_grid
from paani_services.navigator.mapping.range_scans import Scan
from paani_services.navigator.mapping.scanned_obstacles import mark_echoes, scan_water

MIN_UNSEEN_S = 1.0  # five pictures


def map_water(
    observations: tuple[Observation, ...],
    position_m: tuple[float, float],
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    scans: tuple[Scan, ...] = (),
) -> tuple[OccupancyGrid, tuple[DynamicObstacle, ...]]:
    """The grid around a position, and the dynamic obstacles, which are not on it, by pictures and scans."""
    obstacles = find_dynamic_obstacles(observations, now_us, camera, config) if config.predict else ()
    boxes: BoxIds = frozenset().union(*(obstacle.vacated_boxes for obstacle in obstacles))
    grid = build_occupancy_grid(observations, position_m, now_us, camera, config, boxes)
    seen = tuple(obstacle for obstacle in obstacles if not is_refuted(obstacle, grid))
    scanned = scan_water(scans, now_us, config)
    return (grid, seen) if scanned is None else (mark_echoes(grid, scanned), (*seen, *scanned.obstacles))


def is_refuted(obstacle: DynamicObstacle, grid: OccupancyGrid) -> bool:
    """Whether the pictures show water everywhere an obstacle should be that is out of sight: it did not go on.

    That counts after `MIN_UNSEEN_S` out of sight.
    """
    if obstacle.age_s < MIN_UNSEEN_S:
        return False
    row, column, is_on_grid = grid.locate(obstacle.east_m, obstacle.north_m)
    return bool(is_on_grid.all() and grid.free[row, column].all())
