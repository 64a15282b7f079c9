"""The boat in its world: owns the MuJoCo model, advances it step by step, measures it."""

import hashlib
import math

import mujoco
import numpy as np

from paani.config import PlantConfig
from paani_sim.plant import passive
from paani_sim.plant.dynamics import Attitude, Fans, HullState, attitude, body_velocity, wrench
from paani_sim.plant.sensors import (
    GpsReading,
    ImuReading,
    Truth,
    initial_errors,
    measure_gps,
    measure_imu,
)
from paani_sim.worlds import World, actor_pose
from paani_sim.worlds.spec import build_spec

COLLISION_GAP_S = 1.0  # touching again within it is still the same collision
ACTORS_EVERY_S = 0.05


class PlantDiverged(Exception):
    """The integration left the finite numbers: forces or settings are impossible."""


class Plant:
    """One boat in one world. Not thread-safe; `close` when done, the force hook is process-wide.

    Equal `seed`, world and thrust give bit-equal states and measurements.
    """

    def __init__(self, world: World, config: PlantConfig, seed: int = 1) -> None:
        """Compile the world and put the boat at its start."""
        self._config = config
        self._world = world
        spec = build_spec(world)
        spec.option.timestep = config.step_s
        with passive.compiling():
            self._model = spec.compile()
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._data = mujoco.MjData(self._model)
        self._fans = Fans(0.0, 0.0)
        passive.install(self._model, self._apply_forces)

        boat = self._model.body("boat").id
        self._boat_geoms = frozenset(np.flatnonzero(self._model.geom_bodyid == boat).tolist())
        self._mocap = [(actor, self._model.body(actor.id).mocapid[0]) for actor in world.actors]
        self._actors_every = max(1, round(ACTORS_EVERY_S / config.step_s))

        biases, gps, imu = np.random.SeedSequence(seed).spawn(3)
        self._gps_rng, self._imu_rng = np.random.default_rng(gps), np.random.default_rng(imu)
        self._errors = initial_errors(config.sensors, np.random.default_rng(biases))

        self.steps = 0
        self.distance_m = 0.0
        self.collisions = 0
        self.in_contact = False
        self._last_contact_s = -math.inf
        mujoco.set_mju_user_warning(_keep_no_log_file)
        mujoco.mj_forward(self._model, self._data)

    def close(self) -> None:
        """Release the force hook; the plant steps no more."""
        passive.uninstall(self._model)

    @property
    def sim_us(self) -> int:
        """Simulated time [us]."""
        return round(self.steps * self._config.step_s * 1e6)

    @property
    def z_m(self) -> float:
        """Height of the body's origin above the water."""
        return float(self._data.qpos[2])

    @property
    def attitude(self) -> Attitude:
        """True roll, pitch, yaw."""
        return attitude(*self._data.qpos[3:7].tolist())

    @property
    def position_m(self) -> tuple[float, float]:
        """True position in the map frame."""
        return float(self._data.qpos[0]), float(self._data.qpos[1])

    @property
    def velocity(self) -> tuple[float, float, float]:
        """True surge [m/s], sway [m/s] and yaw rate [rad/s]."""
        state = self._hull_state()
        return (*body_velocity(state), state.yaw_rate_radps)

    def step(self, left_n: float, right_n: float) -> None:
        """Advance one step with these fan forces [N]. Raises PlantDiverged."""
        self._fans = Fans(left_n, right_n)
        if self.steps % self._actors_every == 0:
            self._move_actors()
        x_m, y_m = self.position_m
        mujoco.mj_step(self._model, self._data)
        self.steps += 1
        state = [*self._data.qpos.tolist(), *self._data.qvel.tolist()]
        if not all(map(math.isfinite, state)):
            raise PlantDiverged(f"plant: state is not finite after {self.steps} steps")
        self.distance_m += math.hypot(state[0] - x_m, state[1] - y_m)
        self._count_contacts()

    def read_gps(self) -> GpsReading:
        """One fix; to be read at `gps_rate_hz`, the wandering error advances by one period."""
        origin_deg = (self._world.origin_lat_deg, self._world.origin_lon_deg)
        self._errors, reading = measure_gps(
            self._errors, self._truth(), origin_deg, self._config.sensors, self._gps_rng
        )
        return reading

    def read_imu(self) -> ImuReading:
        """One IMU sample."""
        return measure_imu(self._errors, self._truth(), self._config.sensors, self._imu_rng)

    def state_hash(self) -> str:
        """SHA-256 of position and velocity, to compare runs bit by bit."""
        return hashlib.sha256(self._data.qpos.tobytes() + self._data.qvel.tobytes()).hexdigest()

    def place(self, x_m: float, y_m: float, yaw_rad: float, z_m: float | None = None) -> None:
        """Put the boat somewhere else, at rest. `z_m` None: floating."""
        height_m = self._config.dynamics.equilibrium_z_m if z_m is None else z_m
        half = 0.5 * yaw_rad
        self._data.qpos[:7] = [x_m, y_m, height_m, math.cos(half), 0.0, 0.0, math.sin(half)]
        self._data.qvel[:6] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def _apply_forces(self, data: mujoco.MjData) -> None:
        data.qfrc_passive[:6] = wrench(self._hull_state(), self._fans, self._config.dynamics)

    def _hull_state(self) -> HullState:
        pose, velocity = self._data.qpos.tolist(), self._data.qvel.tolist()
        return HullState(*pose[2:7], *velocity[:6])

    def _truth(self) -> Truth:
        pose, velocity = self._data.qpos.tolist(), self._data.qvel.tolist()
        angles = attitude(*pose[3:7])
        force = self._data.sensor("accelerometer").data.tolist()
        rates = self._data.sensor("gyro").data.tolist()
        return Truth(pose[0], pose[1], velocity[0], velocity[1], *angles, tuple(rates), tuple(force))

    def _move_actors(self) -> None:
        time_s = self.sim_us * 1e-6
        for actor, mocap in self._mocap:
            pose = actor_pose(actor, time_s)
            half = 0.5 * pose.yaw_rad
            self._data.mocap_pos[mocap, :2] = (pose.x_m, pose.y_m)
            self._data.mocap_quat[mocap] = (math.cos(half), 0.0, 0.0, math.sin(half))

    def _count_contacts(self) -> None:
        contacts = (self._data.contact[index] for index in range(self._data.ncon))
        self.in_contact = any(
            contact.dist <= 0.0 and not self._boat_geoms.isdisjoint(contact.geom.tolist()) for contact in contacts
        )
        if self.in_contact:
            now_s = self.sim_us * 1e-6
            if now_s - self._last_contact_s > COLLISION_GAP_S:
                self.collisions += 1
            self._last_contact_s = now_s


def _keep_no_log_file(_: str) -> None:
    """Without it MuJoCo writes its warnings to a file in the working folder; `step` raises anyway."""
