"""Scenarios in TOML: what ships, what a file can say, and how what cannot be is refused."""

import json
import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paani.config import WorldConfig, load_config
from paani.errors import UserError
from paani.messages import Keep
from paani_services.navigator.files.route_file import load_route
from paani_sim.worlds import WORLDS, Behaviour, FaultKind, Kind, Scenario, actor_pose_at, load_world
from paani_sim.worlds.curves import clearance_m, open_length_m
from paani_sim.worlds.encounter_paths import is_path_clear
from paani_sim.worlds.export_route import main as export_route
from paani_sim.worlds.load import SCENARIOS, configured_scenario, load_scenario
from paani_sim.worlds.passability import footprint_distance_m
from paani_sim.worlds.scenario_file import MAX_ACTORS, MAX_BYTES
from paani_sim.worlds.spec import build_spec
from tests.places import ROOT

pytestmark = pytest.mark.slow

WHOLE = """
seed = 7
[world]
kind = "harbour"
seed = 5
origin_lat_deg = 10.0
origin_lon_deg = -20.0
water_rgb = [0.1, 0.2, 0.3]
season_frac = 0.9
actors = false
[light]
sky = "dusk"
sun_azimuth_deg = 90.0
sun_elevation_deg = 10.0
[weather]
wind_mps = 4.0
wind_toward_deg = 180.0
gust_frac = 0.2
gust_s = 12.0
fetch_m = 150.0
current_mps = 0.1
current_toward_deg = 45.0
rain_mmph = 3.0
visibility_m = 400.0
[vessel]
profile = "otter"
[route]
waypoints_m = [[-40.0, 20.0], [-18.0, 20.0], [0.0, 24.0]]
[task]
distance_m = 30.0
time_limit_s = 100.0
[[faults]]
kind = "gps_jump"
start_s = 10.0
duration_s = 5.0
amount = 3.0
[fence]
keep_in = [[[-70.0, 5.0], [70.0, 5.0], [70.0, 80.0], [-70.0, 80.0]]]
keep_out = [[[-30.0, 30.0], [-20.0, 30.0], [-20.0, 40.0]]]
[[actors]]
id = "still"
look = "can"
frame = "route"
at_m = [20.0, 3.0]
[[actors]]
look = "dinghy"
path_m = [[-20.0, 44.0], [-4.0, 44.0], [-12.0, 38.0]]
closed = true
speed_mps = 1.0
length_m = 3.0
behaviour = "gives_way"
"""
MINIMAL = '[world]\nkind = "river"\n'
LAKE = '[world]\nkind = "lake"\n'


def _scenario(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return load_scenario(path)


@pytest.mark.parametrize("name", SCENARIOS)
def test_shipped_scenarios_load_by_name_and_are_sound(name: str) -> None:
    """Moving things keep off what stands still, and the scenario compiles."""
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.task.time_limit_s > scenario.world.route_length_m / 0.6
    for actor in scenario.world.actors:
        assert is_path_clear(scenario.world, actor), actor.id
    assert build_spec(scenario.world).compile().nmocap == len(scenario.world.actors)


def test_shipped_scenarios_cover_faults_and_encounters() -> None:
    """Every world, most kinds of encounter and faults of every sort of instrument."""
    scenarios = [load_scenario(name) for name in SCENARIOS]
    assert 6 <= len(scenarios) <= 12
    assert {scenario.world.name for scenario in scenarios} == set(WORLDS)
    kinds = {fault.kind for scenario in scenarios for fault in scenario.faults}
    assert {FaultKind.CAMERA_BLACK, FaultKind.GPS_OUTAGE, FaultKind.COMPASS_BIAS, FaultKind.LINK_LOSS} <= kinds


def test_k1_k2_k3_the_papers_lake_has_its_size_and_route_and_nothing_in_it() -> None:
    """K1, K2, K3: no bank, nothing that stands or moves, no wind, flat water; profile `paper` sails there."""
    lake, bare = load_world("lake"), configured_scenario(load_config(profile="paper").world)
    assert bare.name == "bare_lake"
    assert np.array_equal(bare.world.route_m, lake.route_m)
    assert (bare.world.obstacles, bare.world.actors, bare.faults, bare.fence) == ((), (), (), ())
    assert (bare.world.wind.speed_mps, bare.world.waves.fetch_m, bare.world.current.speed_mps) == (0.0, 0.0, 0.0)
    assert clearance_m(lake.shore_m, lake.shore_m).max() < 1.0
    assert clearance_m(bare.world.shore_m, lake.shore_m).min() > 75.0
    assert clearance_m(bare.world.shore_m, np.zeros((1, 2)))[0] < 250.0  # near enough to be drawn


def test_a_world_s_name_is_its_plain_scenario() -> None:
    scenario = load_scenario("lake")
    assert (scenario.name, scenario.faults, scenario.fence) == ("lake", (), ())
    assert np.array_equal(scenario.world.route_m, load_world("lake").route_m)


def test_a_file_sets_every_field(tmp_path: Path) -> None:
    scenario = _scenario(tmp_path, WHOLE)
    world, light, wind = scenario.world, scenario.world.light, scenario.world.wind
    assert (scenario.name, scenario.seed, scenario.vessel) == ("mine", 7, "otter")
    assert (world.seed, world.origin_lat_deg, world.origin_lon_deg) == (5, 10.0, -20.0)
    assert (world.water_rgb, world.season_frac) == ((0.1, 0.2, 0.3), 0.9)
    assert (light.sky, light.rain_mmph, light.visibility_m) == ("dusk", 3.0, 400.0)
    assert (light.sun_azimuth_rad, light.sun_elevation_rad) == pytest.approx((math.pi / 2, math.radians(10.0)))
    assert (wind.speed_mps, wind.toward_rad, wind.gust_frac, wind.gust_s) == (4.0, math.pi, 0.2, 12.0)
    assert world.waves.fetch_m == 150.0
    assert (world.current.speed_mps, world.current.toward_rad) == (0.1, math.radians(45.0))
    assert (scenario.task.distance_m, scenario.task.time_limit_s) == (30.0, 100.0)
    assert not world.route_closed
    assert world.start == pytest.approx((-40.0, 20.0, 0.0))
    assert scenario.faults[0][:] == (FaultKind.GPS_JUMP, 10.0, 5.0, 3.0)
    assert [area.keep for area in scenario.fence] == [Keep.IN, Keep.OUT]
    still = world.obstacles[-1]
    assert (still.id, still.kind) == ("still", Kind.BUOY)
    assert still.pose[:2] == pytest.approx((-20.0, 23.0))
    (dinghy,) = world.actors
    assert (dinghy.id, dinghy.closed, dinghy.behaviour) == ("actor_1", True, Behaviour.GIVES_WAY)
    assert (dinghy.length_m, dinghy.width_m) == (3.0, 1.5)


def test_the_readme_s_scenario_is_sound(tmp_path: Path) -> None:
    readme = (ROOT / "sim_host/paani_sim/worlds/README.md").read_text()
    scenario = _scenario(tmp_path, readme.split("```toml\n")[1].split("```")[0])
    assert [type(thing).__name__ for thing in (scenario.world.obstacles[-1], *scenario.world.actors)] == [
        "Obstacle",
        "Actor",
        "Actor",
    ]


@pytest.mark.parametrize(
    ("encounter", "speed_mps"), [("crossing", 0.8), ("head_on", 0.7), ("overtaking", 1.0), ("drifting", 0.1)]
)
def test_an_encounter_meets_a_boat_at_0_6_metres_a_second(tmp_path: Path, encounter: str, speed_mps: float) -> None:
    text = (
        '[world]\nkind = "lake"\nactors = false\n[route]\nfrom_m = 130.0\nlength_m = 60.0\n'
        f'[[actors]]\nid = "met"\nlook = "kayak"\nencounter = "{encounter}"\nmeets_at_m = 30.0\n'
        f"speed_mps = {speed_mps}\n"
    )
    scenario = _scenario(tmp_path, text)
    (actor,) = scenario.world.actors
    world = scenario.world
    arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(world.route_m, axis=0), axis=1))])
    here = np.array([[np.interp(30.0, arc_m, world.route_m[:, k]) for k in (0, 1)]])
    assert footprint_distance_m(actor, actor_pose_at(actor, 30.0 / 0.6), here)[0] < 0.8
    assert footprint_distance_m(actor, actor_pose_at(actor, 0.0), np.array([world.start[:2]]))[0] > 2.0


def test_part_of_the_world_s_route(tmp_path: Path) -> None:
    scenario = _scenario(tmp_path, MINIMAL + "[route]\nfrom_m = 300.0\nlength_m = 40.0\n")
    assert not scenario.world.route_closed
    assert open_length_m(scenario.world.route_m) == pytest.approx(40.0, rel=0.01)


def test_channel_coordinates(tmp_path: Path) -> None:
    actor = '[[actors]]\nid = "mark"\nlook = "spar"\nframe = "channel"\nat_m = [100.0, 2.0]\n'
    scenario = _scenario(tmp_path, '[world]\nkind = "canal"\n' + actor)
    assert scenario.world.obstacles[-1].pose[:2] == pytest.approx((100.0, 2.0), abs=0.01)
    with pytest.raises(UserError, match=r"actors\[0\]\.frame: the lake has no channel"):
        _scenario(tmp_path, '[world]\nkind = "lake"\n' + actor)


def test_the_configuration_may_ask_for_another_wind_and_seed() -> None:
    plain = configured_scenario(WorldConfig(name="river"))
    asked = configured_scenario(WorldConfig(name="river", seed=9, wind_mps=5.0))
    assert plain.world.wind == load_world("river").wind
    assert (asked.seed, asked.world.wind.speed_mps) == (9, 5.0)
    assert asked.world.wind.toward_rad == plain.world.wind.toward_rad


def test_an_open_route_is_exported_as_one(tmp_path: Path) -> None:
    file = tmp_path / "route.toml"
    assert export_route("random:lake:3", str(file), str(tmp_path / "fence.toml")) == 0
    assert not (tmp_path / "fence.toml").exists()
    route, world = load_route(file), load_scenario("random:lake:3").world
    assert not route.repeat
    np.testing.assert_allclose([(p.x_m, p.y_m) for p in route.waypoints], world.route_m, atol=1e-4)


BAD = {
    "unknown key": (MINIMAL + "[weather]\nwind = 3.0\n", r"unknown field `wind` - at `\$\.weather`"),
    "unknown table": (MINIMAL + "[wether]\n", r"unknown field `wether`"),
    "no world": ("seed = 1\n", r"required field `world`"),
    "unknown world": ('[world]\nkind = "pond"\n', r"world\.kind: unknown 'pond'"),
    "not a number": (MINIMAL + "[weather]\nwind_mps = nan\n", r"\$\.weather\.wind_mps"),
    "infinite": (MINIMAL + "[route]\nwaypoints_m = [[0.0, 0.0], [inf, 0.0]]\n", r"\$\.route\.waypoints_m"),
    "negative size": (MINIMAL + '[[actors]]\nlook = "can"\nat_m = [0.0, 0.0]\nwidth_m = -1.0\n', r"actors\[.*width_m"),
    "too many actors": (
        MINIMAL + '[[actors]]\nlook = "can"\nat_m = [0.0, 0.0]\n' * (MAX_ACTORS + 1),
        r"\$\.actors",
    ),
    "one waypoint": (MINIMAL + "[route]\nwaypoints_m = [[0.0, 0.0]]\n", r"\$\.route\.waypoints_m"),
    "zero leg": (
        LAKE + "[route]\nwaypoints_m = [[0.0, 0.0], [9.0, 0.0], [9.0, 0.0]]\n",
        r"route\.waypoints_m\[1\] and the next",
    ),
    "reserved name": (
        LAKE + '[[actors]]\nid = "bank_0"\nlook = "dinghy"\npath_m = [[5.0, 5.0], [9.0, 5.0]]\nspeed_mps = 0.5\n',
        r"actors\[0\]\.id: 'bank_0' is a name of the simulator's own",
    ),
    "over land": (
        LAKE + "[route]\nwaypoints_m = [[0.0, 0.0], [0.0, 90.0]]\n",
        r"leg 0 runs over land",
    ),
    "outside the fence": (
        LAKE + "[route]\nwaypoints_m = [[0.0, 0.0], [30.0, 0.0]]\n"
        "[fence]\nkeep_in = [[[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]]\n",
        r"leg 0 is outside the fence at \(9",
    ),
    "through a closed area": (
        LAKE + "[route]\nwaypoints_m = [[0.0, 0.0], [30.0, 0.0]]\n"
        "[fence]\nkeep_out = [[[8.0, -9.0], [9.0, -9.0], [9.0, 9.0], [8.0, 9.0]]]\n",
        r"outside the fence",
    ),
    "a fence that crosses itself": (
        LAKE + "[fence]\nkeep_in = [[[0.0, 0.0], [9.0, 9.0], [9.0, 0.0], [0.0, 9.0]]]\n",
        r"fence\.keep_in: the edges from corners 0 and 2 meet",
    ),
    "starts in a boat": (
        LAKE + "[route]\nwaypoints_m = [[-66.0, 8.0], [-40.0, 8.0]]\n",
        r"starts inside 'sail_middle'",
    ),
    "starts in an actor": (
        MINIMAL + '[[actors]]\nid = "in"\nlook = "barge"\nframe = "route"\nat_m = [1.0, 0.0]\n',
        r"starts inside 'in'",
    ),
    "vessel on land": (
        MINIMAL + '[[actors]]\nlook = "barge"\nat_m = [0.0, 300.0]\n',
        r"actors\[0\]\.at_m: barge on land",
    ),
    "path over land": (
        LAKE + '[[actors]]\nlook = "kayak"\npath_m = [[0.0, 0.0], [0.0, 90.0]]\nspeed_mps = 1.0\n',
        r"actors\[0\]: its way runs over land",
    ),
    "still path": (
        LAKE + '[[actors]]\nlook = "kayak"\npath_m = [[0.0, 0.0], [0.0, 0.0]]\nspeed_mps = 1.0\n',
        r"actors\[0\]\.path_m\[0\] and the next are the same point",
    ),
    "no speed": (
        MINIMAL + '[[actors]]\nlook = "kayak"\npath_m = [[0.0, 0.0], [0.0, 1.0]]\n',
        r"actors\[0\]\.speed_mps",
    ),
    "nowhere": (MINIMAL + '[[actors]]\nlook = "kayak"\n', r"actors\[0\]: needs one of"),
    "unknown look": (MINIMAL + '[[actors]]\nlook = "ufo"\nat_m = [0.0, 0.0]\n', r"actors\[0\]\.look: unknown 'ufo'"),
    "twice": (
        MINIMAL + '[[actors]]\nid = "bridge"\nlook = "can"\nframe = "route"\nat_m = [9.0, 3.0]\n',
        r"actors\[0\]\.id",
    ),
    "unknown vessel": (MINIMAL + '[vessel]\nprofile = "raft"\n', r"vessel\.profile: .*'raft'"),
    "unknown fault": (MINIMAL + '[[faults]]\nkind = "mutiny"\nstart_s = 0.0\n', r"\$\.faults\[0\]\.kind"),
    "goal beyond": (
        MINIMAL + "[route]\nfrom_m = 300.0\nlength_m = 20.0\n[task]\ndistance_m = 50.0\n",
        r"task\.distance_m: beyond",
    ),
    "encounter beyond": (
        MINIMAL + '[[actors]]\nlook = "kayak"\nencounter = "head_on"\nmeets_at_m = 9999.0\nspeed_mps = 1.0\n',
        r"actors\[0\]\.meets_at_m: beyond",
    ),
    "no TOML": ("[world\n", r"mine\.toml: .*line 1"),
    "too large": ("#" * (MAX_BYTES + 1), r"larger than 256 KiB"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_in_one_line_naming_file_and_field(tmp_path: Path, case: str) -> None:
    text, field = BAD[case]
    with pytest.raises(UserError, match=field) as caught:
        _scenario(tmp_path, text)
    line = str(caught.value)
    assert "mine.toml" in line
    assert "\n" not in line


def test_missing_binary_and_nested_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"none\.toml: No such file"):
        load_scenario(tmp_path / "none.toml")
    (tmp_path / "b.toml").write_bytes(bytes(range(128, 256)))
    with pytest.raises(UserError, match=r"b\.toml"):
        load_scenario(tmp_path / "b.toml")
    (tmp_path / "deep.toml").write_text("a = " + "[" * 50_000)
    with pytest.raises(UserError, match=r"deep\.toml"):
        load_scenario(tmp_path / "deep.toml")
    with pytest.raises(UserError, match="unknown world 'sea'"):
        load_scenario("sea")
    with pytest.raises(UserError, match="'sea'"):
        load_scenario("random:sea:1")


_NUMBERS = st.one_of(st.floats(), st.integers(-(10**6), 10**6))
_JUNK = st.one_of(_NUMBERS, st.booleans(), st.text("ab[]{}.:=", max_size=6), st.lists(_NUMBERS, max_size=3))
_POINTS = st.lists(st.lists(st.floats(-120.0, 120.0), min_size=2, max_size=2), min_size=1, max_size=5)


@given(
    st.fixed_dictionaries(
        {"look": st.sampled_from(["kayak", "barge", "swimming", "can", "ufo"])},
        optional={
            "frame": st.sampled_from(["map", "route", "channel"]),
            "at_m": st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=2),
            "path_m": _POINTS,
            "encounter": st.sampled_from(["crossing", "head_on", "overtaking", "drifting"]),
            "meets_at_m": st.floats(0.0, 500.0),
            "left_m": st.floats(-20.0, 20.0),
            "heading_deg": st.floats(-360.0, 360.0),
            "speed_mps": st.floats(0.01, 15.0),
            "length_m": _JUNK,
            "closed": st.booleans(),
        },
    ),
    st.one_of(st.just({}), st.dictionaries(st.sampled_from(["from_m", "length_m", "waypoints_m"]), _JUNK | _POINTS)),
)
@example({"look": "kayak", "at_m": [0.0, 0.0], "length_m": 3e-78}, {})
@example({"look": "kayak", "at_m": [0.0, 0.0], "length_m": 0.05}, {})
@settings(max_examples=60, deadline=None)
def test_any_file_is_sound_or_refused(actor: dict[str, object], route: dict[str, object]) -> None:
    """Never anything but a scenario that compiles, or one line."""
    tables = [
        '[world]\nkind = "river"',
        "[route]",
        *map(_pair, route.items()),
        "[[actors]]",
        *map(_pair, actor.items()),
    ]
    refusal = ""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.toml"
        path.write_text("\n".join(tables))
        try:
            build_spec(load_scenario(path).world).compile()
        except UserError as error:
            refusal = str(error)
    assert "\n" not in refusal
    assert not refusal or "any.toml" in refusal


def _pair(item: tuple[str, object]) -> str:
    """`key = value` in TOML; JSON is, but for what is not finite."""
    return f"{item[0]} = {json.dumps(item[1]).replace('NaN', 'nan').replace('Infinity', 'inf')}"


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text(WHOLE, encoding="utf-8-sig")
    marked = load_scenario(file)
    file.write_text(WHOLE, encoding="utf-8")
    assert marked.world.water_rgb == load_scenario(file).world.water_rgb
