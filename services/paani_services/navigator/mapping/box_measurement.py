"""Measurements of where the obstacles in a picture's boxes are on the water. Pure."""

import functools
import math
from collections.abc import Sequence

import msgspec
import numpy as np

from paani.arrays import F64
from paani_services.navigator.mapping.observation import (
    BOX_STEPS,
    MASK_ROW_FRAC,
    MAX_OBSERVATIONS,
    OUTLINE_POINTS,
    Observation,
    ObstacleBox,
)
from paani_services.navigator.mapping.observed_cells import Camera, own_hull_top
from paani_services.navigator.mapping.projection import (
    PinholeCamera,
    pinhole_at,
    pixel_rays,
    ranges_to_water_m,
)
from paani_services.navigator.mapping.velocity_fit import PositionMeasurement

BOX_EDGE_DEVIATION = 1.0 / 240.0  # standard deviation of a box's lower end, of the picture's height
# Of its height, by which a box ends too low or too high in some pictures. A track has to go on over these; what they
# make of a velocity shows in its residuals.
BOX_OUTLIER_FRAC = 0.05
# The waterline of a hull aslant, where the mask ends the water, is that much less exact: half a row of 64, which
# persists until the hull has moved to the next row.
HULL_EDGE_FACTOR = 2.0
BESIDE_ROWS = 2  # of the mask, by which the waterline of a hull aslant rises less from one of its points to the next
POSITION_DEVIATION_M = 0.05  # all other errors of a position near the camera
CROSS_RANGE_FACTOR = 2.3  # and across the ray, in units of the angle of BOX_EDGE_DEVIATION
WIDTH_DEVIATION_FRAC = 0.03  # of an obstacle's width: its visible middle moves with the side that it shows
BORDER_STEPS = 4  # a box that comes this near to the picture's sides [1/512] may go on beyond


class MeasuredPicture(msgspec.Struct, frozen=True, eq=False):
    """The measurements of one picture. Each is made once, so it is equal to itself alone."""

    stamp_us: int
    measurements: Sequence[PositionMeasurement]


@functools.lru_cache(maxsize=MAX_OBSERVATIONS)
def measure_positions(observation: Observation, camera: Camera, max_range_m: float) -> MeasuredPicture:
    """The positions of the obstacles in one picture whose whole outline is within range.

    An observation never changes, so each is measured once and cached.
    """
    camera_model = pinhole_at(observation.pose, camera.calibration, observation.aspect_ratio)
    left, right = np.array([(box.left, box.right) for box in observation.boxes]).T[:, :, None]
    u = (left + (right - left) * ((np.arange(OUTLINE_POINTS) + 0.5) / OUTLINE_POINTS)) / BOX_STEPS
    lines = [(box.bottom,) * OUTLINE_POINTS if _is_level(box) else _waterline_of_hull(box) for box in observation.boxes]
    v = np.array(lines) / BOX_STEPS
    rays = pixel_rays(camera_model, u, np.minimum(v, own_hull_top(camera.ego_polygon, u)))
    range_m = ranges_to_water_m(camera_model, rays, max_range_m)
    in_range = np.asarray(np.isfinite(range_m).all(axis=1, keepdims=True))
    range_m = np.where(in_range, range_m, 0.0)
    east_m: F64 = camera_model.position_m[0] + range_m * rays.east
    north_m: F64 = camera_model.position_m[1] + range_m * rays.north
    measured = [
        _measure_position(observation, k, camera_model, camera.calibration.height_m, (east_m[k], north_m[k]))
        for k in np.flatnonzero(in_range[:, 0]).tolist()
    ]
    return MeasuredPicture(observation.stamp_us, measured)


def _measure_position(
    observation: Observation, number: int, camera_model: PinholeCamera, height_m: float, outline: tuple[F64, F64]
) -> PositionMeasurement:
    """The position of one box and its covariance, along and across the ray from the camera.

    One row of the picture is range^2 / height times its angle along the ray; across, much less.
    """
    box, box_id = observation.boxes[number], (observation.stamp_us, number)
    track_id = observation.box_track_ids[number] if observation.box_track_ids else 0
    camera_m, row_rad = camera_model.position_m[:2], BOX_EDGE_DEVIATION / camera_model.focal[1]
    width_rad = (box.right - box.left) / BOX_STEPS / camera_model.focal[0]
    height_rad = (box.bottom - box.top) / BOX_STEPS / camera_model.focal[1]
    easts, norths = (axis.tolist() for axis in outline)
    position_m = (sum(easts) / OUTLINE_POINTS, sum(norths) / OUTLINE_POINTS)
    distance_m = max(math.dist(position_m, camera_m), POSITION_DEVIATION_M)
    width_deviation_m = WIDTH_DEVIATION_FRAC * math.dist((easts[0], norths[0]), (easts[-1], norths[-1]))
    edge_rad = row_rad if _is_level(box) else HULL_EDGE_FACTOR * row_rad
    range_deviation_m = POSITION_DEVIATION_M + width_deviation_m + edge_rad * distance_m * distance_m / height_m
    gate_deviation_m = range_deviation_m + BOX_OUTLIER_FRAC * height_rad * distance_m * distance_m / height_m
    cross_range_deviation_m = POSITION_DEVIATION_M + width_deviation_m + CROSS_RANGE_FACTOR * row_rad * distance_m
    east, north = (position_m[0] - camera_m[0]) / distance_m, (position_m[1] - camera_m[1]) / distance_m
    range_information, cross_range_information = (
        1.0 / (range_deviation_m * range_deviation_m),
        1.0 / (cross_range_deviation_m * cross_range_deviation_m),
    )
    information_matrix = (
        range_information * east * east + cross_range_information * north * north,
        (range_information - cross_range_information) * east * north,
        range_information * north * north + cross_range_information * east * east,
    )
    size_m = (width_rad * distance_m, height_rad * distance_m)
    return PositionMeasurement(
        box_id, box.label, position_m, information_matrix, gate_deviation_m, outline, _shown_ends(box), size_m, track_id
    )


def _waterline_of_hull(box: ObstacleBox) -> tuple[int, ...]:
    """The waterline with ends that lie more than `BESIDE_ROWS` above what is next to them lowered to that.

    A box is a little wider than the hull in it: there the mask shows the water beside the hull, or behind it. Of a hull
    that the picture's side cuts, the end itself is followed, where it is.
    """
    if not all(_shown_ends(box)):
        return box.waterline
    first, second, *_, last_but_one, last = box.waterline
    most = round(BESIDE_ROWS * MASK_ROW_FRAC * BOX_STEPS)
    first = second if second - first > most else first
    last = last_but_one if last_but_one - last > most else last
    return (first, *box.waterline[1:-1], last)


def _shown_ends(box: ObstacleBox) -> tuple[bool, bool]:
    """Whether the picture shows the left and the right end of what is in the box."""
    foot = box.bottom < BOX_STEPS - BORDER_STEPS
    return foot and box.left > BORDER_STEPS, foot and box.right < BOX_STEPS - BORDER_STEPS


def _is_level(box: ObstacleBox) -> bool:
    """Whether it stands on its lower end all along: a small thing, or a whole hull end on or abeam.

    Of such a hull the mask ends the water within a row of the box's lower end, which is more exact.
    """
    highest = min(box.waterline)
    is_near_end = highest >= box.bottom - MASK_ROW_FRAC * BOX_STEPS
    return (box.is_small and highest == box.bottom) or (is_near_end and all(_shown_ends(box)))
