"""The worlds as MuJoCo models."""

import mujoco
import numpy as np
import pytest

from paani_sim.worlds import WORLDS, World, load_world
from paani_sim.worlds.spec import BOAT_BIT, SOLID_BIT, build_spec

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=sorted(WORLDS))
def world(request: pytest.FixtureRequest) -> World:
    return load_world(request.param)


@pytest.fixture(scope="module")
def model(world: World) -> mujoco.MjModel:
    return build_spec(world).compile()


def _move_boat(model: mujoco.MjModel, x_m: float, y_m: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:2] = x_m, y_m
    mujoco.mj_forward(model, data)
    return data


def test_everything_has_a_name(model: mujoco.MjModel) -> None:
    for count, name_of in (
        (model.nbody, model.body),
        (model.ngeom, model.geom),
        (model.njnt, model.joint),
        (model.nsite, model.site),
        (model.nsensor, model.sensor),
    ):
        assert all(name_of(k).name for k in range(count))


def test_boat_is_the_paper_s(model: mujoco.MjModel) -> None:
    """K4: 12.4 kg on one free joint, with an IMU, at 100 Hz."""
    boat = model.body("boat")
    assert boat.mass[0] == pytest.approx(12.4)
    assert boat.inertia == pytest.approx([0.86, 1.45, 2.05])
    assert boat.ipos == pytest.approx([0.0, 0.0, 0.0])
    assert model.joint("boat_free").type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert {model.sensor(k).name for k in range(model.nsensor)} == {"accelerometer", "gyro"}
    assert model.opt.timestep == pytest.approx(0.01)
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.gravity.tolist() == [0.0, 0.0, -9.81]


def test_hull_is_a_catamaran_of_the_stated_size(model: mujoco.MjModel) -> None:
    port, starboard = model.geom("hull_port"), model.geom("hull_starboard")
    length_m = 2.0 * (port.size[0] + port.size[1])
    beam_m = port.pos[1] - starboard.pos[1] + 2.0 * port.size[0]
    assert length_m == pytest.approx(1.3)
    assert beam_m == pytest.approx(0.75)


def test_only_the_boat_collides(model: mujoco.MjModel) -> None:
    boat = model.body("boat").id
    for k in range(model.ngeom):
        own, other = (BOAT_BIT, SOLID_BIT) if model.geom_bodyid[k] == boat else (SOLID_BIT, BOAT_BIT)
        assert (model.geom_contype[k], model.geom_conaffinity[k]) == (own, other)


def test_start_is_free_of_contact(world: World, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    assert data.qpos[:2] == pytest.approx(world.start[:2])


def test_bank_is_solid_all_round(world: World, model: mujoco.MjModel) -> None:
    """K3: there is a bank wherever the water ends."""
    for x_m, y_m in world.shore_m:
        data = _move_boat(model, x_m, y_m)
        touched = {model.geom(g).name for c in data.contact for g in c.geom}
        assert any(name.startswith("bank_") for name in touched)


def test_things_are_solid_but_the_bridge_can_be_passed(world: World, model: mujoco.MjModel) -> None:
    for obstacle in world.obstacles:
        data = _move_boat(model, *obstacle.pose[:2])
        touched = {model.geom(g).name for c in data.contact for g in c.geom}
        assert (obstacle.id in touched) is (obstacle.look != "bridge"), obstacle.id


def test_actors_are_mocap_bodies(world: World, model: mujoco.MjModel) -> None:
    for actor in world.actors:
        assert model.body(actor.id).mocapid[0] >= 0
        assert model.geom(actor.id).bodyid[0] == model.body(actor.id).id


def test_boat_at_rest_feels_gravity_only_through_a_contact_or_force(model: mujoco.MjModel) -> None:
    """Free fall reads zero; held up by its weight the accelerometer reads +9.81 upwards."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.sensor("accelerometer").data == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    data.qfrc_applied[2] = 12.4 * 9.81
    mujoco.mj_forward(model, data)
    assert data.sensor("accelerometer").data == pytest.approx([0.0, 0.0, 9.81], abs=1e-6)


def test_looks_change_no_physics(world: World, model: mujoco.MjModel) -> None:
    dressed = build_spec(world, visual=True).compile()
    assert dressed.nlight == 1
    assert dressed.body("boat").mass == model.body("boat").mass
    assert dressed.geom("water").contype[0] == dressed.geom("water").conaffinity[0] == 0
    assert np.array_equal(dressed.geom("bank_0").pos, model.geom("bank_0").pos)
