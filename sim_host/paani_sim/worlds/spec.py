"""The world as a MuJoCo model: the boat as one free body, everything solid it can run into.

Gravity is -9.81 and there is no fluid: buoyancy, drag and thrust are the plant's passive forces.
"""

import mujoco
import numpy as np

from paani.arrays import F64
from paani_sim.vessels import Vessel, load_vessel
from paani_sim.worlds.bathymetry import SHOAL_GEOM_PREFIX, semi_axes_m
from paani_sim.worlds.curves import simplify_polygon
from paani_sim.worlds.footprint import CORNERS, build_outline, is_round, is_shaped
from paani_sim.worlds.passability import HEADROOM_M
from paani_sim.worlds.world import Actor, Obstacle, World, actor_pose_at

TIMESTEP_S = 0.01

BOAT_BIT = 1  # what the boat is; solids look for it
SOLID_BIT = 2  # what everything else is; the boat looks for it
GROUND_BIT = 4  # what shoals are; keels look for it

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
_ELLIPSOID = mujoco.mjtGeom.mjGEOM_ELLIPSOID
_MESH = mujoco.mjtGeom.mjGEOM_MESH
_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_SITE = mujoco.mjtObj.mjOBJ_SITE

_SUBMERGED_M = 1.0  # solids reach this far under water
_MAX_DEVIATION_M = 0.02  # a shore that bends less is straight
_BANK_HALF_HEIGHT_M = 1.2
_BANK_HALF_THICKNESS_M = 0.6


def build_spec(world: World, vessel: Vessel | None = None, *, visual: bool = False) -> mujoco.MjSpec:
    """Build the model, not yet compiled (no Python callback may be installed while compiling).

    `vessel` None: the paper's.

    Body `boat` on joint `boat_free` with geoms `hull_port`, `hull_starboard`, site `imu` and
    sensors `accelerometer`, `gyro` (body frame, SI). Geoms `bank_<n>`, one geom per obstacle and
    one mocap body and geom per actor, named by id. Only the boat collides, with everything else.
    Geoms `shoal_<n>` where the world has shoals; geoms `keel_port`, `keel_starboard` of the boat touch them alone.
    `visual` adds colours, a water plane and a light for MuJoCo's own viewer.
    """
    spec = mujoco.MjSpec()
    spec.modelname = world.name
    spec.option.timestep = TIMESTEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, -9.81]
    _add_boat(spec, world, vessel or load_vessel("paper"))
    _add_banks(spec, world.shore_m)
    _add_shoals(spec, world)
    for obstacle in world.obstacles:
        _add_obstacle(spec, obstacle)
    for actor in world.actors:
        _add_actor(spec, actor)
    if visual:
        _add_visuals(spec)
    return spec


def _add_boat(spec: mujoco.MjSpec, world: World, vessel: Vessel) -> None:
    hull, yaw = vessel.hull, world.start.yaw_rad
    boat = spec.worldbody.add_body(
        name="boat",
        pos=[world.start.x_m, world.start.y_m, vessel.buoyancy.equilibrium_z_m],
        quat=[np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)],
        mass=hull.mass_kg,
        ipos=[0.0, 0.0, 0.0],
        iquat=[1.0, 0.0, 0.0, 0.0],
        inertia=[hull.roll_inertia_kgm2, hull.pitch_inertia_kgm2, hull.yaw_inertia_kgm2],
        explicitinertial=True,
    )
    boat.add_freejoint(name="boat_free")
    reach_m = 0.5 * hull.length_m - hull.radius_m
    parts = [("hull", hull.axis_z_m, BOAT_BIT, SOLID_BIT)]
    if world.shoals:
        parts.append(("keel", hull.radius_m - vessel.draught_m - vessel.buoyancy.equilibrium_z_m, 0, GROUND_BIT))
    for name, side in (("port", 0.5), ("starboard", -0.5)):
        y_m = side * hull.spacing_m
        for part, z_m, contype, conaffinity in parts:
            boat.add_geom(
                name=f"{part}_{name}",
                type=_CAPSULE,
                fromto=[-reach_m, y_m, z_m, reach_m, y_m, z_m],
                size=[hull.radius_m, 0.0, 0.0],
                contype=contype,
                conaffinity=conaffinity,
                friction=[0.3, 0.005, 0.0001],
                priority=1,  # a wet hull slides along whatever it touches
                rgba=[0.9, 0.5, 0.1, 1.0],
            )
    boat.add_site(name="imu", pos=[0.0, 0.0, 0.0])
    for name, kind in (
        ("accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ("gyro", mujoco.mjtSensor.mjSENS_GYRO),
    ):
        spec.add_sensor(name=name, type=kind, objtype=_SITE, objname="imu")


def _add_banks(spec: mujoco.MjSpec, shore_m: F64) -> None:
    """One box behind each straight stretch of the shore, overlapping its neighbours."""
    starts_m = simplify_polygon(shore_m, _MAX_DEVIATION_M)
    ends_m = np.roll(starts_m, -1, axis=0)
    for number, (start, end) in enumerate(zip(starts_m, ends_m, strict=True)):
        along = end - start
        length_m = float(np.hypot(*along))
        outward = np.array([along[1], -along[0]]) / length_m
        centre = 0.5 * (start + end) + _BANK_HALF_THICKNESS_M * outward
        yaw = float(np.arctan2(along[1], along[0]))
        spec.worldbody.add_geom(
            name=f"bank_{number}",
            type=_BOX,
            pos=[float(centre[0]), float(centre[1]), 0.0],
            quat=[np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)],
            size=[0.5 * length_m + 0.1, _BANK_HALF_THICKNESS_M, _BANK_HALF_HEIGHT_M],
            contype=SOLID_BIT,
            conaffinity=BOAT_BIT,
            rgba=[0.35, 0.45, 0.2, 1.0],
        )


def _add_shoals(spec: mujoco.MjSpec, world: World) -> None:
    """Whole ellipsoids: what of them is no shoal lies under the bottom, where nothing is."""
    for number, shoal in enumerate(world.shoals):
        across_m, upward_m = semi_axes_m(shoal, world.bottom_m)
        spec.worldbody.add_geom(
            name=f"{SHOAL_GEOM_PREFIX}{number}",
            type=_ELLIPSOID,
            pos=[shoal.x_m, shoal.y_m, -(shoal.top_m + upward_m)],
            size=[across_m, across_m, upward_m],
            contype=GROUND_BIT,
            conaffinity=0,
            rgba=[0.6, 0.5, 0.3, 1.0],
        )


def _add_obstacle(spec: mujoco.MjSpec, obstacle: Obstacle) -> None:
    pose = obstacle.pose
    low_m = obstacle.base_z_m if obstacle.base_z_m > HEADROOM_M else -_SUBMERGED_M
    high_m = obstacle.base_z_m + obstacle.height_m
    _add_solid(
        spec,
        spec.worldbody,
        obstacle,
        pos=[pose.x_m, pose.y_m, 0.5 * (low_m + high_m)],
        yaw_rad=pose.yaw_rad,
        half_height_m=0.5 * (high_m - low_m),
    )


def _add_actor(spec: mujoco.MjSpec, actor: Actor) -> None:
    pose = actor_pose_at(actor, 0.0)
    yaw = pose.yaw_rad
    body = spec.worldbody.add_body(
        name=actor.id,
        mocap=True,
        pos=[pose.x_m, pose.y_m, 0.0],
        quat=[np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)],
    )
    _add_solid(
        spec,
        body,
        actor,
        pos=[0.0, 0.0, 0.5 * (actor.height_m - _SUBMERGED_M)],
        yaw_rad=0.0,
        half_height_m=0.5 * (actor.height_m + _SUBMERGED_M),
    )


def _add_solid(
    spec: mujoco.MjSpec,
    parent: mujoco.MjsBody,
    thing: Obstacle | Actor,
    *,
    pos: list[float],
    yaw_rad: float,
    half_height_m: float,
) -> None:
    """A box for what is long, an upright cylinder for what is round, and what narrows as it does."""
    half_length_m, half_width_m = 0.5 * thing.length_m, 0.5 * thing.width_m
    kind, size = _BOX, [half_length_m, half_width_m, half_height_m]
    if is_round(thing):
        kind, size = _CYLINDER, [half_width_m, half_height_m, 0.0]
    elif is_shaped(thing):
        kind = _MESH
        around = build_outline(thing)
        walls = [np.column_stack([around, np.full(CORNERS, z_m)]) for z_m in (-half_height_m, half_height_m)]
        spec.add_mesh(name=thing.id, uservert=np.concatenate(walls).ravel())
    parent.add_geom(
        name=thing.id,
        type=kind,
        meshname=thing.id if kind == _MESH else "",
        pos=pos,
        quat=[np.cos(yaw_rad / 2.0), 0.0, 0.0, np.sin(yaw_rad / 2.0)],
        size=size,
        contype=SOLID_BIT,
        conaffinity=BOAT_BIT,
        rgba=[0.7, 0.25, 0.2, 1.0],
    )


def _add_visuals(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_light(name="sun", pos=[0.0, 0.0, 100.0], dir=[0.3, 0.2, -1.0])
    spec.worldbody.add_geom(
        name="water",
        type=_PLANE,
        size=[800.0, 800.0, 400.0],
        contype=0,
        conaffinity=0,
        rgba=[0.15, 0.25, 0.3, 1.0],
    )
