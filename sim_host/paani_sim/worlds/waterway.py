"""A waterway that every seed lays out anew: bends, and along them an island, a bridge, a moored row, a weir, a jetty.

Everything is placed in channel coordinates; `along_m` is the centre line's x. The route goes down the starboard side
and back up the other. Land, water and things come from one stream of the seed, light from another.
"""

import zlib
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from paani_sim.worlds.channel import Channel
from paani_sim.worlds.curves import clearance_m, closed_length_m, resample_closed
from paani_sim.worlds.footprint import place_outline
from paani_sim.worlds.lighting import draw_condition, draw_light
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.world import Actor, Behaviour, Current, Kind, Light, Obstacle, Waves, Wind, World

WATERWAY = "waterway"
SHOWN_SEED = 4  # of the world of that name
CHANNEL_M, ROUTE_M = (-70.0, 334.0), (14.0, 250.0)
LANE_M = 0.23  # of the channel's width, to starboard of the centre line
LEG_M = 7.5
FEATURES = ("island", "bridge", "moored_row", "weir", "open")
# How much wider (+) or narrower the channel is on either side of the middle where one of them is, from and to [m].
WIDENING_M = {"island": (9.0, 12.0), "bridge": (-4.0, -2.0), "moored_row": (1.0, 3.0), "weir": (6.0, 8.0)}
WIDENED_OVER_M = 19.0
TURNING_M, TURNING_OVER_M = 7.0, 24.0  # more width where the route turns round
WEIR_OFF_M, WEIR_BUOYS_OFF_M, WEIR_BUOYS_EVERY_M = 2.6, 6.2, 3.6
ROW_CLEAR_M = 0.5  # between moored boats and the bank, which may bend towards them
ROW_LOOKS = ("rowboat", "dinghy", "cruiser", "sailboat", "narrowboat", "workboat", "pontoonboat")
MARKS = ("can", "cone", "spar", "pillar")
WATER_COLOURS_RGB = ((0.30, 0.34, 0.22), (0.40, 0.36, 0.24), (0.20, 0.28, 0.26), (0.16, 0.24, 0.30), (0.46, 0.42, 0.32))
_BOX = np.array([[1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]])
Rng = np.random.Generator


def build_waterway(seed: int = SHOWN_SEED, condition: str | None = None) -> World:
    """The waterway of a seed, in a condition of `LIGHT_CONDITIONS` (None: the seed's own)."""
    rng = _open_stream(seed, 1)
    sites = dict(zip(rng.permutation(FEATURES).tolist(), _middles_m(rng), strict=True))
    channel = _draw_channel(sites, rng)
    loop_m = channel.loop_m(*ROUTE_M, LANE_M)
    route_m = resample_closed(loop_m, round(closed_length_m(loop_m) / LEG_M))
    things = [thing for name, at_m in sites.items() for thing in _FEATURES[name](channel, float(at_m), rng)]
    things += [*_draw_marks(channel, rng), *_draw_people(channel, sites["bridge"], rng)]
    start = start_pose(route_m)
    return World(
        name=WATERWAY,
        seed=int(rng.integers(1 << 30)),
        origin_lat_deg=51.4416,
        origin_lon_deg=-0.9510,
        shore_m=channel.shore_m(),
        route_m=route_m,
        start=start,
        obstacles=tuple(things),
        actors=_build_actors(channel, sites),
        wind=Wind(
            float(rng.uniform(0.0, 5.0)), float(rng.uniform(-np.pi, np.pi)), float(rng.uniform(0.05, 0.35)), 12.0
        ),
        light=draw_waterway_light(seed, start.yaw_rad, condition),
        water_rgb=WATER_COLOURS_RGB[int(rng.integers(len(WATER_COLOURS_RGB)))],
        season_frac=float(rng.beta(0.8, 1.6)),
        channel_m=channel.centre_m,
        waves=Waves(90.0),
        current=Current(float(rng.uniform(0.0, 0.2))),
    )


def draw_waterway_light(seed: int, course_rad: float, condition: str | None = None) -> Light:
    """Light of a seed for a boat on this course, in a condition of `LIGHT_CONDITIONS` (None: the seed's own)."""
    rng = _open_stream(seed, 2)
    drawn = draw_condition(rng)
    return draw_light(condition or drawn, course_rad, rng)


def _open_stream(seed: int, number: int) -> Rng:
    return np.random.default_rng([zlib.crc32(WATERWAY.encode()), seed, number])


def _middles_m(rng: Rng) -> npt.NDArray[np.float64]:
    slot_m = (ROUTE_M[1] - ROUTE_M[0]) / len(FEATURES)
    return ROUTE_M[0] + slot_m * (np.arange(len(FEATURES)) + 0.5) + rng.uniform(-3.0, 3.0, len(FEATURES))


def _draw_channel(sites: dict[str, float], rng: Rng) -> Channel:
    """Bends of two lengths, nowhere tighter than half of the channel is wide."""
    x = np.arange(CHANNEL_M[0], CHANNEL_M[1] + 1.0)
    bend_m = np.zeros(len(x))
    for amplitude_m, scale_m in (((8.0, 19.0), (44.0, 62.0)), ((1.5, 3.5), (24.0, 32.0))):
        phase = rng.uniform(0.0, 2.0 * np.pi)
        bend_m += rng.uniform(*amplitude_m) * np.sin(x / rng.uniform(*scale_m) + phase)
    turned_m = 0.004 * (np.maximum(0.0, x - ROUTE_M[1] - 24.0) ** 2 + np.maximum(0.0, ROUTE_M[0] - 42.0 - x) ** 2)
    half_width_m = rng.uniform(13.0, 16.5) + 0.6 * np.sin(x / 11.0 + rng.uniform(0.0, 2.0 * np.pi))
    for name, at_m in sites.items():
        widening_m = rng.uniform(*WIDENING_M.get(name, (0.0, 0.0)))
        half_width_m += widening_m * np.exp(-(((x - at_m) / WIDENED_OVER_M) ** 2))
    for end_m in ROUTE_M:
        half_width_m += TURNING_M * np.exp(-(((x - end_m) / TURNING_OVER_M) ** 2))
    side = rng.choice([-1.0, 1.0])
    return Channel(x, np.column_stack([x, bend_m + side * turned_m]), half_width_m)


def _draw_island(channel: Channel, at_m: float, rng: Rng) -> list[Obstacle]:
    """In mid-channel, or a little to one side."""
    pose = channel.pose_at(at_m, float(rng.uniform(-2.0, 2.0)), float(rng.normal(0.0, 0.08)))
    size = float(rng.uniform(14.0, 26.0)), float(rng.uniform(5.0, 8.0)), SIZES["island"].height_m
    return [Obstacle("island", Kind.OTHER, "island", pose, *size, 0.0, int(rng.integers(12)))]


def _draw_bridge(channel: Channel, at_m: float, rng: Rng) -> list[Obstacle]:
    """A road bridge, every second one with a pier in the middle of the water."""
    half_m, across = channel.half_width_m(at_m), 0.5 * np.pi
    span = Obstacle(
        "bridge", Kind.OTHER, "bridge", channel.pose_at(at_m, 0.0, across), 2.0 * half_m + 9.0, 4.2, 1.5, 3.6
    )
    if rng.random() < 0.5:
        return [span]
    pier = Obstacle("bridge_pier", Kind.OTHER, "bridge_pier", channel.pose_at(at_m, 0.0), *SIZES["bridge_pier"][1:])
    return [span, pier]


def _draw_moored_row(channel: Channel, at_m: float, rng: Rng) -> list[Obstacle]:
    """Boats behind each other along one bank, here and there a second one outside the first."""
    side, row = float(rng.choice([-1.0, 1.0])), list[Obstacle]()
    along_m, last_m = at_m - 19.0, at_m + 19.0
    while True:
        look = str(rng.choice(ROW_LOOKS))
        size = SIZES[look].scaled(float(rng.uniform(0.85, 1.15)))
        if along_m + size.length_m > last_m:
            return row
        middle_m, out_m = along_m + 0.5 * size.length_m, 0.5 * size.width_m + 0.7
        lying_m = place_outline(_BOX * [0.5 * size.length_m, 0.5 * size.width_m], channel.bank(middle_m, side, -out_m))
        out_m += max(0.0, ROW_CLEAR_M - float(clearance_m(channel.shore_m(), lying_m).min()))
        askew_rad = float(np.clip(rng.normal(0.0, 0.03), -0.06, 0.06))
        for number in range(2 if rng.random() < 0.2 else 1):
            off_m = -(out_m + number * (size.width_m + 0.3))
            turn_rad = float(rng.choice([0.0, np.pi])) + askew_rad
            pose, name = channel.bank(middle_m, side, off_m, turn_rad), f"row_{len(row)}"
            row.append(Obstacle(name, size.kind, look, pose, *size[1:], 0.0, int(rng.integers(12))))
        along_m += size.length_m + float(rng.uniform(1.5, 4.0))


def _draw_weir(channel: Channel, at_m: float, rng: Rng) -> list[Obstacle]:
    """Along one bank of a bay, with a line of buoys before it."""
    side, length_m = float(rng.choice([-1.0, 1.0])), float(rng.uniform(16.0, 24.0))
    pose = channel.bank(at_m, side, -WEIR_OFF_M, 0.0 if side > 0.0 else np.pi)
    found = [Obstacle("weir", Kind.OTHER, "weir", pose, length_m, *SIZES["weir"][2:], 0.0, int(rng.integers(12)))]
    look, variant = str(rng.choice(("sphere", "can"))), int(rng.choice([2, 3]))
    count = round(length_m / WEIR_BUOYS_EVERY_M) + 1
    for number, off_m in enumerate(np.linspace(-0.5 * length_m, 0.5 * length_m, count).tolist()):
        place = channel.bank(at_m + off_m, side, -WEIR_BUOYS_OFF_M)
        found.append(Obstacle(f"weir_buoy_{number}", Kind.BUOY, look, place, *SIZES[look][1:], 0.0, variant))
    return found


def _draw_open(channel: Channel, at_m: float, rng: Rng) -> list[Obstacle]:
    """A jetty from one bank, with somebody on it."""
    side = float(rng.choice([-1.0, 1.0]))
    pose = channel.bank(at_m, side, -2.4, -side * 0.5 * np.pi)
    sitter = channel.bank(at_m, side, -4.8, -side * 0.5 * np.pi)
    return [
        Obstacle("jetty", Kind.PIER, "jetty", pose, 7.0, 1.8, 0.8, 0.0, int(rng.integers(6))),
        Obstacle("jetty_sitter", Kind.PERSON, "sitting", sitter, 0.6, 0.6, 1.2, 0.8, int(rng.integers(42))),
    ]


_FEATURES: dict[str, Callable[[Channel, float, Rng], list[Obstacle]]] = {
    "island": _draw_island,
    "bridge": _draw_bridge,
    "moored_row": _draw_moored_row,
    "weir": _draw_weir,
    "open": _draw_open,
}


def _draw_marks(channel: Channel, rng: Rng) -> list[Obstacle]:
    """A buoy on the lane, or almost, between two features, on the way down and on the way back."""
    slot_m = (ROUTE_M[1] - ROUTE_M[0]) / len(FEATURES)
    found = []
    for number, slot in enumerate(rng.permutation(np.arange(1, len(FEATURES)))[:3].tolist()):
        along_m, side = ROUTE_M[0] + slot * slot_m, -1.0 if number % 2 else 1.0
        left_m = side * 2.0 * LANE_M * channel.half_width_m(along_m) + float(rng.uniform(-0.8, 0.8))
        look = str(rng.choice(MARKS))
        pose = channel.pose_at(along_m, left_m)
        found.append(Obstacle(f"mark_{number}", Kind.BUOY, look, pose, *SIZES[look][1:], 0.0, int(rng.integers(12))))
    return found


def _draw_people(channel: Channel, bridge_m: float, rng: Rng) -> list[Obstacle]:
    """On the banks, not where the bridge's ramps are."""
    found = []
    for number in range(int(rng.integers(3, 8))):
        along_m, side = float(rng.uniform(*ROUTE_M)), float(rng.choice([-1.0, 1.0]))
        look, tall_m = str(rng.choice(("standing", "walking"))), float(rng.uniform(1.2, 1.9))
        pose = channel.bank(along_m, side, float(rng.uniform(1.4, 3.0)), float(rng.uniform(-np.pi, np.pi)))
        person = Obstacle(f"ashore_{number}", Kind.PERSON, look, pose, 0.5, 0.5, tall_m, 0.55, int(rng.integers(42)))
        if abs(along_m - bridge_m) > 9.0:
            found.append(person)
    return found


def _build_actors(channel: Channel, sites: dict[str, float]) -> tuple[Actor, ...]:
    """Who goes round where the middle of the channel is free, against the route's sense: the boat meets them."""
    gives_way, found = Behaviour.GIVES_WAY, []
    for number, (name, look) in enumerate((("moored_row", "paddleboard"), ("weir", "kayak"))):
        at_m = float(sites[name])
        loop_m = channel.loop_m(at_m - 17.0, at_m + 17.0, 0.05)[::-1]
        path_m = resample_closed(loop_m, 60)
        size = SIZES[look]
        found.append(
            Actor(f"{look}_under_way", size.kind, look, path_m, 0.8, *size[1:], 12.0, number, behaviour=gives_way)
        )
    return tuple(found)
