"""Floating things, wakes, shadows and quays, before they are drawn."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_sim.eye import water_patches
from paani_sim.eye.land import make_land
from paani_sim.eye.quay import PAVED_M, QUAY_TOP_M, furniture, quay
from paani_sim.eye.scene import FIRST_THING, place_obstacles
from paani_sim.eye.surfaces import surface_tiles
from paani_sim.eye.wave_motion import compute_wave_motion, is_floating, wind_sea_state
from paani_sim.worlds import Actor, Kind, Obstacle, Pose2, Waves, Wind, load_world
from paani_sim.worlds.curves import clearance_m

BUOY = Obstacle("buoy", Kind.BUOY, "can", Pose2(3.0, 4.0, 0.0), 0.7, 0.7, 1.2)
BARGE = Obstacle("barge", Kind.VESSEL, "barge", Pose2(3.0, 4.0, 0.0), 16.0, 3.0, 2.4)
JETTY = Obstacle("jetty", Kind.PIER, "jetty", Pose2(3.0, 4.0, 0.0), 8.0, 2.0, 0.8)
STRAIGHT = Actor(
    "boat", Kind.VESSEL, "cruiser", np.array([[0.0, 0.0], [90.0, 0.0]]), 1.4, 6.0, 2.1, 1.9, 30.0, closed=False
)


@given(st.floats(0.0, 12.0), st.floats(0.0, 5000.0), st.floats(0.0, 600.0))
def test_wave_motion_stays_small_and_finite(wind_mps: float, fetch_m: float, t_s: float) -> None:
    """No more heave than the sea is high, no more roll than a boat survives."""
    sea = wind_sea_state(Wind(wind_mps, 0.4), Waves(fetch_m))
    for thing in (BUOY, BARGE):
        up_m, roll_rad, pitch_rad = compute_wave_motion(sea, thing, thing.pose, t_s)
        assert abs(up_m) <= 0.51 * sea.height_m
        assert abs(roll_rad) < 0.2
        assert abs(pitch_rad) < 0.12


def test_jonswap_sea_of_a_lake() -> None:
    """Hasselmann et al. (1973): 6 m/s over 200 m raise waves of about 4 cm, half a metre long."""
    sea = wind_sea_state(Wind(6.0, 0.0), Waves(200.0))
    assert sea.height_m == pytest.approx(0.043, abs=0.005)
    assert sea.wave_m == pytest.approx(0.6, abs=0.15)


def test_a_buoy_bobs_more_than_a_barge_and_a_jetty_stands() -> None:
    sea = wind_sea_state(Wind(6.0, 0.0), Waves(2000.0))
    heave = [
        np.std([compute_wave_motion(sea, thing, thing.pose, t)[0] for t in np.arange(0.0, 60.0, 0.1)])
        for thing in (BUOY, BARGE)
    ]
    assert heave[0] > 5.0 * heave[1]
    assert is_floating(BUOY)
    assert not is_floating(JETTY)
    assert [own.thing.id for own in place_obstacles([BUOY, JETTY], FIRST_THING).afloat] == ["buoy"]


def test_wake_lies_behind_the_boat_in_a_wedge() -> None:
    rows = water_patches.wake(STRAIGHT, 60.0)
    assert (rows[:, 0] <= 60.0 + 0.5 * 6.0).all()
    assert (rows[:, 0] >= 60.0 + 0.5 * 6.0 - water_patches.TRAIL_M - 1.0).all()
    behind, aside = rows[:, 3], rows[:, 4]
    assert (np.abs(aside) >= water_patches.KELVIN * behind).all()
    assert rows[:, 9:] == pytest.approx(np.tile([1.0, 0.0], (len(rows), 1)), abs=1e-6)
    assert np.sign(rows[:, 1]).tolist() == np.sign(aside).tolist()


def test_a_wake_ends_where_the_boat_came_round_a_bend() -> None:
    hairpin = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 3.0], [0.0, 3.0]])
    rows = water_patches.wake(dataclasses.replace(STRAIGHT, path_m=hairpin), 63.0 + 8.0)
    assert 0 < len(rows) < 4 * water_patches.TRAIL_STEPS
    assert (rows[:, 9] < 0.0).all() or rows[rows[:, 9] >= 0.0, 6].max() == 0.0
    assert rows[:4, 6].min() > 0.1


def test_no_wake_without_way() -> None:
    assert len(water_patches.wake(dataclasses.replace(STRAIGHT, speed_mps=0.1), 60.0)) == 0
    assert len(water_patches.wake(STRAIGHT, 500.0)) == 0


def test_shadow_falls_away_from_the_sun() -> None:
    low_in_the_west = np.array([-0.9, 0.0, 0.43], np.float32)
    rows = water_patches.shadow(
        Pose2(0.0, 0.0, 0.0), 0.9, (1.0, 1.0, 2.0), 0.5, water_patches.shadow_cast_per_m(low_in_the_west)
    )
    assert rows[:, 0].max() > 4.0
    assert rows[:, 0].min() > -1.0
    assert (rows[:, 2] == 0.9).all()


@pytest.mark.parametrize("name", ["canal", "harbour"])
def test_quay_wall_stands_on_the_shore_and_paving_stays_ashore(name: str) -> None:
    world = load_world(name)
    whole = quay(world, np.random.default_rng(1))
    wall_and_ground = whole.vertices[np.unique(whole.triangles)]
    clear = clearance_m(world.shore_m, wall_and_ground[:, :2].astype(float))
    assert clear.max() < 0.15
    wall = np.abs(clear) < 0.1
    assert wall_and_ground[wall, 2].max() == pytest.approx(QUAY_TOP_M)
    assert wall_and_ground[wall, 2].min() < -1.0
    used = {
        round(float(z), 2) for z in wall_and_ground[wall_and_ground[:, 2] > 0.5, 2]
    }  # the coping's underside, the ground with its grid a hair lower
    assert used <= {0.68, 0.89, QUAY_TOP_M}
    for part in furniture(world, np.random.default_rng(1)):
        middle = part.vertices[:, :2].mean(axis=0, dtype=float)
        assert -PAVED_M < clearance_m(world.shore_m, middle[None])[0] < 0.35


def test_grass_banks_keep_their_reeds_and_quays_have_none() -> None:
    near = {}
    for name in ("river", "canal"):
        world = load_world(name)
        plants = make_land(world).plants
        near[name] = (clearance_m(world.shore_m, plants[:, :2].astype(float)) > -0.8 * PAVED_M).mean()
    assert near["river"] > 0.3
    assert near["canal"] == 0.0


def test_surfaces_are_seeded_and_tile() -> None:
    first = surface_tiles(1)
    assert np.array_equal(first, surface_tiles(1))
    assert not np.array_equal(first, surface_tiles(2))
    assert first[1:, ..., 1].mean(axis=(1, 2)) == pytest.approx([120.0] * 3, abs=14.0)


@pytest.mark.parametrize(
    ("kind", "look", "size"),
    [
        (Kind.VESSEL, "narrowboat", (14.0, 2.1, 1.8)),
        (Kind.VESSEL, "tug", (12.0, 3.8, 6.0)),
        (Kind.PIER, "quay_steps", (2.6, 2.0, 0.9)),
        (Kind.PIER, "finger", (8.0, 1.0, 0.45)),
        (Kind.OTHER, "warehouse", (22.0, 11.0, 9.0)),
    ],
)
def test_new_looks_have_their_stated_size(kind: Kind, look: str, size: tuple[float, float, float]) -> None:
    for variant in range(4):
        stands = place_obstacles(
            [Obstacle("it", kind, look, Pose2(0.0, 0.0, 0.0), *size, variant=variant)], FIRST_THING
        )
        rows = stands.afloat[0].rows.rows if stands.afloat else stands.still.rows
        own = rows[rows[:, 10] == FIRST_THING, :3]
        assert np.ptp(own[:, 0]) == pytest.approx(size[0], rel=0.2)
        assert np.ptp(own[:, 1]) == pytest.approx(size[1], rel=0.4)
        assert 0.9 * size[2] < own[:, 2].max() < size[2] + 2.1


def test_crane_stands_on_its_feet_and_is_as_high_as_stated() -> None:
    crane = Obstacle("crane", Kind.OTHER, "crane", Pose2(5.0, 0.0, 0.0), 6.0, 6.0, 16.0, 0.9)
    rows = place_obstacles([crane], FIRST_THING).still.rows
    assert rows[:, 2].min() == pytest.approx(0.9, abs=0.15)
    assert rows[:, 2].max() == pytest.approx(16.9, abs=0.2)
    low = rows[rows[:, 2] < 1.2, :2]
    assert np.abs(low - [5.0, 0.0]).max() < 3.2
