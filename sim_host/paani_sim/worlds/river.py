"""A meandering river with banks, a bridge, piers, buoys, moored and moving boats, and people.

Everything is placed in channel coordinates; `along_m` is the centre line's x.
"""

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.channel import Channel
from paani_sim.worlds.curves import resample_closed
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.world import Actor, Behaviour, Kind, Light, Obstacle, Pose2, Wind, World

CHANNEL_START_M = -150.0
CHANNEL_END_M = 430.0
ROUTE_START_M = 12.0
ROUTE_END_M = 262.0
LANE_M = 0.19  # of the channel's width, to starboard of the centre line
LEG_M = 7.5
BRIDGE_ALONG_M = 196.0


def build_river() -> World:
    """Build the river."""
    channel = _channel()
    route_m = _route(channel)
    return World(
        name="river",
        seed=11,
        origin_lat_deg=50.1072,
        origin_lon_deg=8.6928,
        shore_m=channel.shore_m(),
        route_m=route_m,
        start=start_pose(route_m),
        obstacles=_obstacles(channel),
        actors=_actors(channel),
        wind=Wind(speed_mps=1.8, toward_rad=0.5),
        light=Light(sky="cloudy", sun_azimuth_rad=1.9, sun_elevation_rad=0.65, seed=5),
        channel_m=channel.centre_m,
    )


def _channel() -> Channel:
    x = np.arange(CHANNEL_START_M, CHANNEL_END_M + 1.0)
    bend_m = 24.0 * np.sin(x / 46.0) + 5.0 * np.sin(x / 25.0 + 1.0)
    ends_m = 0.004 * (np.maximum(0.0, x - 285.0) ** 2 + np.maximum(0.0, -30.0 - x) ** 2)
    wide_m = 11.0 * np.exp(-(((x - 12.0) / 26.0) ** 2))
    wide_m += 12.0 * np.exp(-(((x - 262.0) / 30.0) ** 2))
    wide_m += 6.0 * np.exp(-(((x - 120.0) / 34.0) ** 2))
    narrow_m = 4.2 * np.exp(-(((x - BRIDGE_ALONG_M) / 20.0) ** 2))
    half_width_m = 11.6 + wide_m - narrow_m + 0.6 * np.sin(x / 11.0)
    return Channel(x, np.column_stack([x, bend_m + ends_m]), half_width_m)


def _route(channel: Channel) -> F64:
    loop_m = channel.loop_m(ROUTE_START_M, ROUTE_END_M, LANE_M)
    length_m = float(np.linalg.norm(np.roll(loop_m, -1, axis=0) - loop_m, axis=1).sum())
    return resample_closed(loop_m, round(length_m / LEG_M))


def _obstacles(channel: Channel) -> tuple[Obstacle, ...]:
    at, half, bank = channel.pose_at, channel.half_width_m, channel.bank

    def off_lane(along_m: float, side: float, left_m: float, turn_rad: float = 0.0) -> Pose2:
        """`left_m` to the left of the route's lane on that side of the centre line."""
        return at(along_m, side * 2.0 * LANE_M * half(along_m) + left_m, turn_rad)

    vessel, person, buoy, pier = Kind.VESSEL, Kind.PERSON, Kind.BUOY, Kind.PIER
    across = 0.5 * np.pi
    return (
        Obstacle("pier_right", pier, "jetty", bank(46.0, -1, -2.6, across), 7.4, 1.8, 0.8),
        Obstacle("pier_left", pier, "jetty", bank(112.0, 1, -3.0, -across), 8.2, 2.0, 0.8),
        Obstacle("pontoon_right", pier, "pontoon", bank(144.0, -1, -1.9), 10.0, 2.4, 0.45),
        Obstacle("pontoon_left", pier, "pontoon", bank(262.0, 1, -2.2), 12.0, 2.4, 0.45),
        Obstacle("pier_far", pier, "jetty", bank(286.0, -1, -3.2, across), 8.6, 2.0, 0.8),
        Obstacle("rowboat_right", vessel, "rowboat", bank(52.0, -1, -2.4, 0.2), 3.7, 1.4, 0.6),
        Obstacle("sail_route", vessel, "sailboat", off_lane(84.0, -1, -0.8, 0.3), 6.0, 2.0, 8.0),
        Obstacle("cruiser_left", vessel, "cruiser", bank(100.0, 1, -2.6, 3.0), 6.6, 2.3, 2.1),
        Obstacle("dinghy_pier", vessel, "dinghy", bank(119.0, 1, -3.2, 2.9), 3.3, 1.5, 0.9),
        Obstacle("barge_right", vessel, "barge", bank(154.0, -1, -4.8), 13.0, 2.6, 2.2),
        Obstacle("rowboat_route", vessel, "rowboat", off_lane(136.0, 1, -0.5, 0.5), 3.6, 1.4, 0.6, 0, 1),
        Obstacle("workboat_left", vessel, "workboat", bank(250.0, 1, -4.6, 3.1), 7.4, 2.6, 2.7),
        Obstacle("cruiser_far", vessel, "cruiser", bank(300.0, 1, -3.6, 3.2), 7.0, 2.4, 2.2, 0, 1),
        Obstacle("kayak_bank", vessel, "kayak", bank(226.0, -1, -1.6, 0.2), 4.1, 0.7, 1.1, 0, 1),
        Obstacle("buoy_red", buoy, "can", off_lane(32.0, -1, 0.6), 0.7, 0.7, 1.2, 0, 0),
        Obstacle("buoy_green", buoy, "cone", off_lane(66.0, -1, -1.6), 0.7, 0.7, 1.2, 0, 1),
        Obstacle("buoy_yellow", buoy, "sphere", off_lane(120.0, -1, -0.4), 0.8, 0.8, 0.7, 0, 2),
        Obstacle("buoy_orange", buoy, "sphere", off_lane(240.0, -1, 0.3), 0.7, 0.7, 0.6, 0, 3),
        Obstacle("buoy_white", buoy, "pillar", at(262.0, 0.0), 0.8, 0.8, 2.2, 0, 4),
        Obstacle("buoy_can", buoy, "can", off_lane(216.0, 1, -0.9), 0.7, 0.7, 1.2, 0, 3),
        Obstacle("buoy_back", buoy, "cone", off_lane(72.0, 1, 0.5), 0.7, 0.7, 1.2, 0, 0),
        Obstacle("buoy_start", buoy, "pillar", at(8.0, 0.0), 0.8, 0.8, 2.2, 0, 1),
        Obstacle("angler_pier", person, "standing", bank(46.0, -1, -5.2, 1.2), 0.5, 0.5, 1.75, 0.8, 0),
        Obstacle("walker_right", person, "walking", bank(28.0, -1, 1.8, 0.0), 0.5, 0.5, 1.7, 0.55, 1),
        Obstacle("sitter_pontoon", person, "sitting", bank(142.0, -1, -1.9, 1.5), 0.6, 0.6, 1.2, 0.45, 2),
        Obstacle("walker_left", person, "walking", bank(92.0, 1, 2.0, 3.1), 0.5, 0.5, 1.8, 0.6, 3),
        Obstacle("couple_left", person, "standing", bank(170.0, 1, 1.6, -1.5), 0.5, 0.5, 1.7, 0.5, 4),
        Obstacle("couple_right", person, "standing", bank(171.0, 1, 1.8, -1.7), 0.5, 0.5, 1.8, 0.5, 5),
        Obstacle("angler_left", person, "standing", bank(262.0, 1, -2.4, -1.6), 0.5, 0.5, 1.75, 0.45, 6),
        Obstacle("swimmer", person, "swimming", bank(206.0, 1, -2.2), 1.1, 0.6, 0.4, 0.0, 4),
        Obstacle("walker_bridge", person, "walking", bank(212.0, -1, 1.6), 0.5, 0.5, 1.75, 0.5, 2),
        Obstacle(
            "bridge",
            Kind.OTHER,
            "bridge",
            at(BRIDGE_ALONG_M, 0.0, across),
            2.0 * half(BRIDGE_ALONG_M) + 9.0,
            4.2,
            1.5,
            3.6,
        ),
    )


def _actors(channel: Channel) -> tuple[Actor, ...]:
    """Both go round against the route's sense, near the middle: the boat meets them, in view."""
    boat_m = resample_closed(channel.loop_m(40.0, 178.0, 0.045)[::-1], 140)
    kayak_m = resample_closed(channel.loop_m(218.0, 276.0, 0.05)[::-1], 60)
    gives_way = Behaviour.GIVES_WAY
    return (
        Actor("boat_under_way", Kind.VESSEL, "cruiser", boat_m, 1.2, 5.6, 2.1, 1.9, 150.0, 2, behaviour=gives_way),
        Actor("kayak_under_way", Kind.VESSEL, "kayak", kayak_m, 0.8, 4.2, 0.7, 1.1, 30.0, 2, behaviour=gives_way),
    )
