"""A canal between quay walls: straight reaches and bends, 12.6 to 20 m wide, with a basin to turn in at either end.

Everything is placed in channel coordinates, metres from the lock at its upper end.
"""

from typing import NamedTuple

import numpy as np

from paani_sim.worlds.channel import Channel
from paani_sim.worlds.curves import closed_length_m, resample_closed
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.world import Actor, Bank, Behaviour, Kind, Light, Obstacle, Pose2, Waves, Wind, World

ROUTE_START_M = 24.0
ROUTE_END_M = 406.0
LANE_M = 0.17  # of the channel's width, to starboard of the centre line
LEG_M = 7.5
BRIDGE_ALONG_M = 178.0
QUAY_M = 0.9  # height of the quay


class Reach(NamedTuple):
    """A stretch of the centre line; `turn_rad` is to the left over its whole length."""

    length_m: float
    turn_rad: float = 0.0


REACHES = (
    Reach(110.0),
    Reach(30.0, -0.70),
    Reach(80.0),
    Reach(36.0, 1.22),
    Reach(90.0),
    Reach(26.0, -0.52),
    Reach(60.0),
)
HALF_WIDTH_M = (
    (0.0, 7.0),
    (10.0, 12.5),
    (36.0, 12.5),
    (48.0, 8.0),
    (158.0, 8.0),
    (170.0, 6.3),
    (186.0, 6.3),
    (200.0, 8.4),
    (250.0, 8.4),
    (262.0, 10.0),
    (346.0, 10.0),
    (358.0, 8.2),
    (386.0, 8.2),
    (396.0, 12.5),
    (420.0, 12.5),
    (432.0, 7.0),
)


def build_canal() -> World:
    """Build the canal."""
    channel = _channel()
    loop_m = channel.loop_m(ROUTE_START_M, ROUTE_END_M, LANE_M)
    route_m = resample_closed(loop_m, round(closed_length_m(loop_m) / LEG_M))
    return World(
        name="canal",
        seed=17,
        origin_lat_deg=52.0803,
        origin_lon_deg=5.1202,
        shore_m=channel.shore_m(),
        route_m=route_m,
        start=start_pose(route_m),
        obstacles=_obstacles(channel),
        actors=_actors(channel),
        wind=Wind(speed_mps=1.5, toward_rad=0.2),
        light=Light(sky="overcast", sun_azimuth_rad=2.4, sun_elevation_rad=0.7, seed=8),
        water_rgb=(0.26, 0.27, 0.19),
        bank=Bank.QUAY,
        channel_m=channel.centre_m,
        waves=Waves(fetch_m=40.0),
    )


def _channel() -> Channel:
    heading_rad = np.concatenate([np.full(round(r.length_m), r.turn_rad / r.length_m) for r in REACHES])
    heading_rad = np.cumsum(heading_rad) - 0.5 * heading_rad
    steps = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    centre_m = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    along_m = np.arange(float(len(centre_m)))
    return Channel(along_m, centre_m, np.interp(along_m, *np.array(HALF_WIDTH_M).T))


def _obstacles(channel: Channel) -> tuple[Obstacle, ...]:
    at, half, bank = channel.pose_at, channel.half_width_m, channel.bank

    def off_lane(along_m: float, side: float, left_m: float, turn_rad: float = 0.0) -> Pose2:
        """`left_m` to the left of the route's lane on that side of the centre line."""
        return at(along_m, side * 2.0 * LANE_M * half(along_m) + left_m, turn_rad)

    vessel, person, buoy, pier = Kind.VESSEL, Kind.PERSON, Kind.BUOY, Kind.PIER
    back = np.pi
    return (
        Obstacle("pontoon_lock", pier, "pontoon", bank(22.0, -1, -1.3), 13.0, 2.0, 0.45),
        Obstacle("pontoon_end", pier, "pontoon", bank(408.0, 1, -1.3), 12.0, 2.0, 0.45, 0.0, 1),
        Obstacle("steps_right", pier, "quay_steps", bank(88.0, -1, -0.55), 4.0, 1.2, QUAY_M),
        Obstacle("steps_left", pier, "quay_steps", bank(226.0, 1, -0.55), 4.0, 1.2, QUAY_M),
        Obstacle("narrow_1", vessel, "narrowboat", bank(66.0, 1, -1.4, back), 12.0, 2.1, 1.8),
        Obstacle("narrow_2", vessel, "narrowboat", bank(81.0, 1, -1.4, back), 14.0, 2.1, 1.8, 0.0, 1),
        Obstacle("narrow_3", vessel, "narrowboat", bank(104.0, -1, -1.4), 11.0, 2.1, 1.8, 0.0, 2),
        Obstacle("cruiser_bend", vessel, "cruiser", bank(208.0, 1, -1.5, back), 6.6, 2.2, 2.0),
        Obstacle("barge_reach", vessel, "barge", bank(276.0, -1, -1.8), 15.0, 2.9, 2.2, 0.0, 3),
        Obstacle("narrow_4", vessel, "narrowboat", bank(294.0, -1, -1.4), 13.0, 2.1, 1.8, 0.0, 4),
        Obstacle("workboat_reach", vessel, "workboat", bank(306.0, -1, -1.6), 7.2, 2.5, 2.6),
        Obstacle("sail_reach", vessel, "sailboat", bank(318.0, -1, -1.4), 6.4, 2.1, 8.0),
        Obstacle("narrow_5", vessel, "narrowboat", bank(288.0, 1, -1.4, back), 12.0, 2.1, 1.8, 0.0, 5),
        Obstacle("dinghy_reach", vessel, "dinghy", bank(326.0, 1, -1.1, back), 3.4, 1.5, 0.9),
        Obstacle("narrow_6", vessel, "narrowboat", bank(372.0, -1, -1.4), 11.0, 2.1, 1.8, 0.0, 6),
        Obstacle("double_banked", vessel, "cruiser", off_lane(280.0, -1, -1.7, 0.05), 6.4, 2.2, 2.0, 0.0, 1),
        Obstacle("rowboat_lane", vessel, "rowboat", off_lane(142.0, -1, -0.3, 0.5), 3.6, 1.4, 0.6, 0.0, 1),
        Obstacle("buoy_red", buoy, "can", off_lane(58.0, -1, -0.5), 0.7, 0.7, 1.2),
        Obstacle("buoy_green", buoy, "cone", off_lane(236.0, -1, 0.5), 0.7, 0.7, 1.2, 0.0, 1),
        Obstacle("buoy_yellow", buoy, "sphere", off_lane(120.0, 1, 0.5), 0.8, 0.8, 0.7, 0.0, 2),
        Obstacle("buoy_upper", buoy, "pillar", at(14.0, 0.0), 0.8, 0.8, 2.0, 0.0, 4),
        Obstacle("buoy_lower", buoy, "pillar", at(418.0, 0.0), 0.8, 0.8, 2.0, 0.0, 1),
        Obstacle("keeper", person, "standing", bank(6.0, -1, 1.6, 1.5), 0.5, 0.5, 1.75, QUAY_M),
        Obstacle("sitter_lock", person, "sitting", bank(20.0, -1, -1.3, 1.4), 0.6, 0.6, 1.2, 0.45, 2),
        Obstacle("walker_tow", person, "walking", bank(74.0, -1, 1.4), 0.5, 0.5, 1.7, QUAY_M, 1),
        Obstacle("couple_a", person, "standing", bank(130.0, 1, 1.0, -1.6), 0.5, 0.5, 1.7, QUAY_M, 4),
        Obstacle("couple_b", person, "standing", bank(131.0, 1, 1.2, -1.8), 0.5, 0.5, 1.8, QUAY_M, 5),
        Obstacle("walker_far", person, "walking", bank(240.0, 1, 1.4, back), 0.5, 0.5, 1.75, QUAY_M, 3),
        Obstacle("angler", person, "standing", bank(352.0, 1, 0.6, -1.6), 0.5, 0.5, 1.75, QUAY_M, 6),
        Obstacle("angler_end", person, "standing", bank(410.0, 1, -1.4, -1.6), 0.5, 0.5, 1.75, 0.45),
        Obstacle("swimmer", person, "swimming", bank(222.0, 1, -1.6), 1.1, 0.6, 0.4, 0.0, 4),
        Obstacle("store_reach", Kind.OTHER, "warehouse", bank(300.0, -1, 15.0), 26.0, 10.0, 8.5, QUAY_M),
        Obstacle("store_lock", Kind.OTHER, "warehouse", bank(60.0, 1, 13.0), 18.0, 9.0, 7.0, QUAY_M, 1),
        Obstacle(
            "bridge",
            Kind.OTHER,
            "bridge",
            at(BRIDGE_ALONG_M, 0.0, 0.5 * np.pi),
            2.0 * half(BRIDGE_ALONG_M) + 5.0,
            5.0,
            1.4,
            2.6,
        ),
    )


def _actors(channel: Channel) -> tuple[Actor, ...]:
    """A boat that comes up on the other side and moors, and a kayak that circles in the middle."""
    up_m = channel.lane_m(398.0, 176.0, LANE_M)
    berth_m = np.array(
        [channel.bank(along_m, 1, -1.5 - 0.05 * (along_m - 150.0))[:2] for along_m in (166.0, 158.0, 150.0)]
    )
    kayak_m = resample_closed(channel.loop_m(62.0, 108.0, 0.04)[::-1], 70)
    gives_way = Behaviour.GIVES_WAY
    return (
        Actor(
            "boat_under_way",
            Kind.VESSEL,
            "cruiser",
            np.vstack([up_m, berth_m]),
            0.9,
            6.2,
            2.1,
            1.9,
            0.0,
            2,
            closed=False,
            behaviour=gives_way,
        ),
        Actor("kayak_under_way", Kind.VESSEL, "kayak", kayak_m, 0.8, 4.2, 0.7, 1.1, 30.0, 1, behaviour=gives_way),
    )
