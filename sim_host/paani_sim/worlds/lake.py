"""The open lake of K1-K2, with the banks and obstacles that K3 found missing."""

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.curves import closed_length_m, normals_left, point_along_closed, resample_closed
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.world import Actor, Behaviour, Kind, Light, Obstacle, Pose2, Wind, World

EXTENT_X_M = 208.699  # K1
EXTENT_Y_M = 126.000  # K1
ROUTE_COUNT = 59  # K2
ROUTE_LENGTH_M = 465.443  # K2
SHORE_COUNT = 240


def build_lake() -> World:
    """Build the lake."""
    shore_m = _shore()
    route_m = _route(shore_m)
    return World(
        name="lake",
        seed=7,
        origin_lat_deg=47.6512,
        origin_lon_deg=9.4794,
        shore_m=shore_m,
        route_m=route_m,
        start=start_pose(route_m),
        obstacles=_obstacles(shore_m),
        actors=_actors(),
        wind=Wind(speed_mps=3.0, toward_rad=0.9),
        light=Light(sky="cloudy", sun_azimuth_rad=-2.0, sun_elevation_rad=0.75, seed=3),
    )


def _shore() -> F64:
    """Superellipse with bays, stretched to the exact extents."""
    angle = np.linspace(0.0, 2.0 * np.pi, SHORE_COUNT, endpoint=False)
    cos, sin = np.cos(angle), np.sin(angle)
    radius = (np.abs(cos) ** 2.5 + np.abs(sin) ** 2.5) ** (-1.0 / 2.5)
    radius *= 1.0 + 0.018 * np.sin(3.0 * angle + 0.4) + 0.012 * np.sin(5.0 * angle + 2.0)
    ring = np.column_stack([radius * cos, radius * sin])
    low, high = ring.min(axis=0), ring.max(axis=0)
    unit = (ring - 0.5 * (low + high)) / (high - low)
    return np.asarray(unit * np.array([EXTENT_X_M, EXTENT_Y_M]))


def _route(shore_m: F64) -> F64:
    """A loop along the shore, offset inwards until 59 equal legs add up to the exact length."""
    fine_m = resample_closed(shore_m, 720)
    inward = normals_left(fine_m, closed=True)

    def loop(offset_m: float) -> F64:
        return resample_closed(fine_m + offset_m * inward, ROUTE_COUNT, start_m=20.0)

    low_m, high_m = 5.0, 25.0
    for _ in range(40):
        middle_m = 0.5 * (low_m + high_m)
        if closed_length_m(loop(middle_m)) > ROUTE_LENGTH_M:
            low_m = middle_m
        else:
            high_m = middle_m
    route_m = loop(high_m)
    return route_m * (ROUTE_LENGTH_M / closed_length_m(route_m))


def _obstacles(shore_m: F64) -> tuple[Obstacle, ...]:
    def ashore(part: float, offset_m: float) -> Pose2:
        """A place `offset_m` off the shore (positive: in the water), heading into the lake."""
        length_m = closed_length_m(shore_m)
        x_m, y_m, yaw = point_along_closed(shore_m, part * length_m)
        inward = yaw + 0.5 * np.pi
        return Pose2(float(x_m + offset_m * np.cos(inward)), float(y_m + offset_m * np.sin(inward)), inward)

    def moored(part: float, offset_m: float, turn_rad: float) -> Pose2:
        pose = ashore(part, offset_m)
        return pose._replace(yaw_rad=pose.yaw_rad + turn_rad)

    vessel, person, buoy = Kind.VESSEL, Kind.PERSON, Kind.BUOY
    return (
        Obstacle("pier_east", Kind.PIER, "jetty", ashore(0.12, 2.6), 7.6, 1.8, 0.75),
        Obstacle("pier_north", Kind.PIER, "jetty", ashore(0.31, 2.2), 6.8, 1.6, 0.7),
        Obstacle("pontoon_west", Kind.PIER, "pontoon", ashore(0.55, 2.6), 7.0, 2.2, 0.45),
        Obstacle("pontoon_south", Kind.PIER, "pontoon", ashore(0.78, 2.8), 7.4, 2.0, 0.45),
        Obstacle("cruiser_east", vessel, "cruiser", moored(0.135, 4.6, 1.4), 6.4, 2.3, 2.1),
        Obstacle("sail_north", vessel, "sailboat", moored(0.335, 6.0, 0.3), 6.6, 2.1, 8.5),
        Obstacle("rowboat_north", vessel, "rowboat", moored(0.30, 2.4, 0.2), 3.6, 1.35, 0.6),
        Obstacle("dinghy_west", vessel, "dinghy", moored(0.565, 3.2, 0.1), 3.4, 1.6, 0.9),
        Obstacle("cabin_south", vessel, "workboat", moored(0.80, 5.2, -1.2), 7.2, 2.6, 2.6),
        Obstacle("rowboat_south", vessel, "rowboat", moored(0.765, 2.6, -0.3), 3.8, 1.4, 0.6, 0, 1),
        Obstacle("sail_middle", vessel, "sailboat", Pose2(-66.0, 8.0, 0.7), 7.0, 2.2, 9.0, 0, 1),
        Obstacle("buoy_red", buoy, "can", moored(0.16, 14.4, 0.0), 0.7, 0.7, 1.2, 0, 0),
        Obstacle("buoy_green", buoy, "cone", moored(0.22, 9.6, 0.0), 0.7, 0.7, 1.2, 0, 1),
        Obstacle("buoy_yellow", buoy, "sphere", moored(0.44, 13.0, 0.0), 0.8, 0.8, 0.7, 0, 2),
        Obstacle("buoy_orange", buoy, "sphere", moored(0.68, 9.4, 0.0), 0.7, 0.7, 0.6, 0, 3),
        Obstacle("buoy_white", buoy, "pillar", moored(0.90, 15.0, 0.0), 0.8, 0.8, 2.2, 0, 4),
        Obstacle("angler_east", person, "standing", ashore(0.12, 4.6), 0.5, 0.5, 1.75, 0.75, 0),
        Obstacle("walker_north", person, "walking", ashore(0.27, -2.0), 0.5, 0.5, 1.7, 0.7, 1),
        Obstacle("sitter_west", person, "sitting", ashore(0.55, 4.4), 0.6, 0.6, 1.2, 0.45, 2),
        Obstacle("walker_south", person, "walking", ashore(0.74, -1.8), 0.5, 0.5, 1.8, 0.7, 3),
        Obstacle("swimmer_south", person, "swimming", ashore(0.845, 7.5), 1.1, 0.6, 0.4, 0.0, 4),
    )


def _actors() -> tuple[Actor, ...]:
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    sail_m = ring * [52.0, 24.0] + [6.0, -4.0]
    kayak_m = (ring * [30.0, 14.0] + [20.0, 22.0])[::-1].copy()
    gives_way = Behaviour.GIVES_WAY
    return (
        Actor("sail_under_way", Kind.VESSEL, "sailboat", sail_m, 0.9, 6.2, 2.0, 8.0, 40.0, 2, behaviour=gives_way),
        Actor("kayak_under_way", Kind.VESSEL, "kayak", kayak_m, 0.8, 4.2, 0.7, 1.1, 10.0, 0, behaviour=gives_way),
    )
