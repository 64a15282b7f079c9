"""A harbour: a basin with quays, finger pontoons and moorings behind a mole, and the road outside its entrance."""

import numpy as np

from paani.arrays import F64
from paani_sim.worlds.curves import closed_length_m, resample_closed
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.world import Actor, Bank, Behaviour, Kind, Light, Obstacle, Pose2, Waves, Wind, World

LEG_M = 7.5
QUAY_M = 0.9  # height of the quay
EAST_M, NORTH_M, WEST_M = 58.0, 70.0, -58.0  # the basin's quays; the mole's inner face is y = 0
MOLE_M = 9.0  # thickness of the mole
ENTRANCE_M = (4.0, 22.0)
NORTH_BERTHS_M = (-42.0, -30.0, -18.0, -6.0, 6.0, 18.0, 30.0)  # where finger pontoons leave the north quay
WEST_BERTHS_M = (12.0, 25.0, 38.0)  # and the west quay
FINGER_M = 10.0

CORNERS_M = (
    (ENTRANCE_M[0], 0.0),
    (ENTRANCE_M[0], -MOLE_M),
    (-30.0, -MOLE_M),
    (-62.0, -15.0),
    (-76.0, -35.0),
    (-60.0, -56.0),
    (-24.0, -66.0),
    (30.0, -68.0),
    (66.0, -56.0),
    (78.0, -34.0),
    (62.0, -13.0),
    (40.0, -MOLE_M),
    (ENTRANCE_M[1], -MOLE_M),
    (ENTRANCE_M[1], 0.0),
    (EAST_M, 0.0),
    (EAST_M, 44.0),
    (44.0, 58.0),
    (44.0, NORTH_M),
    (-52.0, NORTH_M),
    (WEST_M, 64.0),
    (WEST_M, 0.0),
)
ROUTE_M = (
    (9.0, 0.0),
    (9.0, -12.0),
    (1.0, -24.0),
    (-24.0, -26.0),
    (-56.0, -34.0),
    (-34.0, -52.0),
    (14.0, -55.0),
    (52.0, -47.0),
    (58.0, -29.0),
    (28.0, -22.0),
    (17.0, -12.0),
    (17.0, 2.0),
    (24.0, 11.0),
    (46.0, 12.0),
    (50.0, 34.0),
    (34.0, 50.0),
    (0.0, 54.0),
    (-30.0, 54.0),
    (-44.0, 46.0),
    (-43.0, 14.0),
    (-30.0, 9.0),
    (-4.0, 12.0),
    (8.0, 10.0),
)


def build_harbour() -> World:
    """Build the harbour."""
    route_m = _route()
    return World(
        name="harbour",
        seed=23,
        origin_lat_deg=43.2951,
        origin_lon_deg=5.3652,
        shore_m=np.array(CORNERS_M),
        route_m=route_m,
        start=start_pose(route_m),
        obstacles=(*_berths(), *_obstacles()),
        actors=_actors(),
        wind=Wind(speed_mps=2.5, toward_rad=1.2),
        light=Light(sky="clear", sun_azimuth_rad=-1.4, sun_elevation_rad=0.8, seed=4),
        water_rgb=(0.18, 0.27, 0.29),
        season_frac=0.1,
        bank=Bank.QUAY,
        waves=Waves(fetch_m=120.0),
    )


def _route() -> F64:
    """The corners cut three times (Chaikin), then legs of equal length."""
    ring = np.array(ROUTE_M)
    for _ in range(3):
        after = np.roll(ring, -1, axis=0)
        ring = np.stack([0.75 * ring + 0.25 * after, 0.25 * ring + 0.75 * after], axis=1).reshape(-1, 2)
    return resample_closed(ring, round(closed_length_m(ring) / LEG_M), start_m=8.0)


def _berths() -> tuple[Obstacle, ...]:
    """Finger pontoons square to the north and west quays, with boats beside them."""
    north = tuple(Pose2(x_m, NORTH_M, -0.5 * np.pi) for x_m in NORTH_BERTHS_M)
    west = tuple(Pose2(WEST_M, y_m, 0.0) for y_m in WEST_BERTHS_M)
    boats = (
        ("sailboat", 7.2, 2.3, 9.5),
        ("cruiser", 6.8, 2.3, 2.1),
        ("sailboat", 6.6, 2.1, 8.5),
        ("dinghy", 3.6, 1.6, 0.9),
        ("cruiser", 7.4, 2.5, 2.3),
        ("sailboat", 7.6, 2.4, 10.0),
        ("rowboat", 3.8, 1.4, 0.6),
        ("workboat", 7.0, 2.5, 2.6),
    )
    found = []
    for number, root in enumerate((*north, *west)):
        finger = _out_from(root, 0.5 * FINGER_M, 0.0)
        found.append(Obstacle(f"finger_{number}", Kind.PIER, "finger", finger, FINGER_M, 1.6, 0.45, 0.0, number % 2))
        for side, name in ((1.0, "left"), (-1.0, "right")):
            pick = 2 * number + (side < 0.0)
            look, length_m, width_m, height_m = boats[pick % len(boats)]
            berth = _out_from(root, 0.5 * length_m + 1.2, side * (1.2 + 0.5 * width_m))
            if pick % 5 != 4:
                size = (length_m, width_m, height_m)
                found.append(Obstacle(f"berth_{number}_{name}", Kind.VESSEL, look, berth, *size, 0.0, pick))
    return tuple(found)


def _out_from(root: Pose2, out_m: float, left_m: float) -> Pose2:
    cos, sin = float(np.cos(root.yaw_rad)), float(np.sin(root.yaw_rad))
    return Pose2(root.x_m + out_m * cos - left_m * sin, root.y_m + out_m * sin + left_m * cos, root.yaw_rad)


def _obstacles() -> tuple[Obstacle, ...]:
    vessel, person, buoy, pier, other = Kind.VESSEL, Kind.PERSON, Kind.BUOY, Kind.PIER, Kind.OTHER
    north = 0.5 * np.pi
    return (
        Obstacle("steps_east", pier, "quay_steps", Pose2(EAST_M - 0.55, 7.0, north), 4.0, 1.2, QUAY_M),
        Obstacle("steps_mole", pier, "quay_steps", Pose2(-10.0, 0.55, 0.0), 4.0, 1.2, QUAY_M, 0.0, 1),
        Obstacle("jetty_outer", pier, "jetty", Pose2(-46.0, -15.0, -1.4), 8.0, 1.8, 0.8),
        Obstacle("barge_quay", vessel, "barge", Pose2(EAST_M - 1.9, 20.0, north), 14.0, 3.0, 2.6, 0.0, 1),
        Obstacle("tug_quay", vessel, "tug", Pose2(EAST_M - 2.1, 35.0, -north), 11.0, 3.5, 5.5),
        Obstacle("fisher_mole", vessel, "workboat", Pose2(36.0, 1.7, 0.0), 7.4, 2.6, 2.7, 0.0, 3),
        Obstacle("barge_mole", vessel, "barge", Pose2(-28.0, 1.9, 0.0), 14.0, 3.0, 2.2, 0.0, 2),
        Obstacle("sail_mooring", vessel, "sailboat", Pose2(-27.0, 33.0, 1.2), 7.0, 2.2, 9.0, 0.0, 1),
        Obstacle("cruiser_mooring", vessel, "cruiser", Pose2(-30.0, 20.0, 1.0), 6.4, 2.2, 2.0, 0.0, 2),
        Obstacle("sail_mooring_2", vessel, "sailboat", Pose2(-8.0, 26.0, 1.2), 6.4, 2.1, 8.0, 0.0, 3),
        Obstacle("rowboat_mooring", vessel, "rowboat", Pose2(10.0, 25.0, 1.2), 3.8, 1.4, 0.6, 0.0, 1),
        Obstacle("sail_mooring_3", vessel, "sailboat", Pose2(32.0, 24.0, 1.3), 6.8, 2.2, 8.6, 0.0, 4),
        Obstacle("cruiser_lane", vessel, "cruiser", Pose2(-8.0, 53.4, 0.4), 6.2, 2.2, 2.0, 0.0, 4),
        Obstacle("sail_road", vessel, "sailboat", Pose2(-12.0, -53.0, 0.9), 7.4, 2.3, 9.5, 0.0, 2),
        Obstacle("dinghy_road", vessel, "dinghy", Pose2(38.0, -36.0, 0.9), 3.4, 1.6, 0.9, 0.0, 1),
        Obstacle("mooring_1", buoy, "sphere", Pose2(-24.4, 37.6, 0.0), 0.8, 0.8, 0.7, 0.0, 4),
        Obstacle("mooring_2", buoy, "sphere", Pose2(-5.6, 30.4, 0.0), 0.8, 0.8, 0.7, 0.0, 3),
        Obstacle("mooring_3", buoy, "sphere", Pose2(20.0, 30.0, 0.0), 0.8, 0.8, 0.7, 0.0, 2),
        Obstacle("mooring_4", buoy, "sphere", Pose2(34.4, 29.0, 0.0), 0.8, 0.8, 0.7, 0.0, 3),
        Obstacle("mooring_lane", buoy, "sphere", Pose2(-43.2, 31.5, 0.0), 0.8, 0.8, 0.7, 0.0, 3),
        Obstacle("port_hand", buoy, "can", Pose2(13.2, -17.0, 0.0), 0.8, 0.8, 1.4),
        Obstacle("starboard_hand", buoy, "cone", Pose2(26.5, -14.5, 0.0), 0.8, 0.8, 1.4, 0.0, 1),
        Obstacle("road_mark", buoy, "pillar", Pose2(44.0, -48.0, 0.0), 0.9, 0.9, 2.4, 0.0, 2),
        Obstacle("crane_east", other, "crane", Pose2(EAST_M + 4.5, 24.0, np.pi), 6.0, 5.0, 15.0, QUAY_M),
        Obstacle("store_east", other, "warehouse", Pose2(EAST_M + 18.0, 22.0, north), 30.0, 11.0, 9.0, QUAY_M),
        Obstacle("store_north", other, "warehouse", Pose2(16.0, NORTH_M + 15.0, 0.0), 26.0, 10.0, 8.0, QUAY_M, 1),
        Obstacle("angler_mole", person, "standing", Pose2(-4.0, -1.6, 1.5), 0.5, 0.5, 1.75, QUAY_M),
        Obstacle("angler_head", person, "sitting", Pose2(23.6, -3.0, 2.6), 0.6, 0.6, 1.2, QUAY_M, 2),
        Obstacle("walker_mole", person, "walking", Pose2(-38.0, -4.0, 0.1), 0.5, 0.5, 1.7, QUAY_M, 1),
        Obstacle("walker_east", person, "walking", Pose2(EAST_M + 1.6, 12.0, 1.5), 0.5, 0.5, 1.8, QUAY_M, 3),
        Obstacle("docker", person, "standing", Pose2(EAST_M + 1.2, 29.0, 3.1), 0.5, 0.5, 1.8, QUAY_M, 5),
        Obstacle("couple_a", person, "standing", Pose2(-12.0, NORTH_M + 1.4, -1.6), 0.5, 0.5, 1.7, QUAY_M, 4),
        Obstacle("couple_b", person, "standing", Pose2(-11.0, NORTH_M + 1.2, -1.8), 0.5, 0.5, 1.8, QUAY_M, 6),
        Obstacle("walker_north", person, "walking", Pose2(24.0, NORTH_M + 1.8, 0.0), 0.5, 0.5, 1.75, QUAY_M, 2),
        Obstacle("sitter_west", person, "sitting", Pose2(WEST_M + 7.0, 25.0, 0.1), 0.6, 0.6, 1.2, 0.45, 1),
        Obstacle("walker_west", person, "walking", Pose2(WEST_M - 1.5, 32.0, 1.5), 0.5, 0.5, 1.75, QUAY_M, 5),
        Obstacle("swimmer", person, "swimming", Pose2(-58.0, -22.0, 0.6), 1.1, 0.6, 0.4, 0.0, 4),
    )


def _actors() -> tuple[Actor, ...]:
    """A dinghy that circles in the basin, and a boat that goes round in the road outside."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    dinghy_m = ring * [13.0, 5.0] + [13.0, 42.0]
    road_m = (ring * [32.0, 7.0] + [0.0, -39.0])[::-1].copy()
    gives_way = Behaviour.GIVES_WAY
    return (
        Actor("boat_under_way", Kind.VESSEL, "cruiser", road_m, 1.1, 6.0, 2.1, 1.9, 20.0, 2, behaviour=gives_way),
        Actor("dinghy_under_way", Kind.VESSEL, "dinghy", dinghy_m, 0.8, 3.4, 1.5, 0.9, 10.0, 1, behaviour=gives_way),
    )
