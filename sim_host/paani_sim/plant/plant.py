"""The boat in its world: owns the MuJoCo model, advances it step by step, measures it."""

import hashlib
import math
from typing import NamedTuple, Self

import msgspec
import mujoco
import numpy as np

from paani.config import PlantConfig
from paani.messages import AisVessel
from paani_sim.plant import passive
from paani_sim.plant.actors import Actors
from paani_sim.plant.ais import AisReceiver
from paani_sim.plant.dynamics import Attitude, Fans, HullState, apply_fan_lag, attitude, body_velocity, compute_wrench
from paani_sim.plant.instrument_faults import apply_gps_jump, apply_gps_outage, apply_imu_bias, apply_thruster_loss
from paani_sim.plant.lidar import RangeScanner
from paani_sim.plant.sensors import (
    GpsReading,
    ImuReading,
    Truth,
    initial_errors,
    measure_gps,
    measure_imu,
)
from paani_sim.plant.sonar import Sonar
from paani_sim.vessels import Vessel, load_vessel
from paani_sim.water.surroundings import CALM, Surroundings
from paani_sim.water.wakes import WakeSource
from paani_sim.water.water import Water
from paani_sim.worlds import Fault, Scenario, World
from paani_sim.worlds.bathymetry import depth_at_m
from paani_sim.worlds.sizes import makes_waves
from paani_sim.worlds.spec import build_spec

COLLISION_GAP_S = 1.0  # a new contact within this time belongs to the same collision
ACTORS_EVERY_S = 0.05


class PlantDiverged(Exception):
    """The integration left the finite numbers: forces or settings are impossible."""


class Touch(NamedTuple):
    """The boat touched the geom of this name: an obstacle's or actor's id, `bank_<n>`, or `shoal_<n>`."""

    name: str
    began_s: float
    ended_s: float


class Plant:
    """One boat in one world. Not thread-safe; `close` when done, the force hook is process-wide.

    Equal `seed`, world, vessel, faults and thrust give bit-equal states and measurements.
    """

    def __init__(self, world: World, config: PlantConfig, seed: int = 1, faults: tuple[Fault, ...] = ()) -> None:
        """Compile the world and put the boat at its start. Raises UserError for the vessel.

        Of the faults it acts on those of GPS, compass, gyro, sonar and thrusters.
        """
        self._config, self._world, self._faults = config, world, faults
        self._vessel = load_vessel(config.vessel or Scenario.vessel)
        spec = build_spec(world, self._vessel)
        spec.option.timestep = config.step_s
        with passive.compiling():
            self._model = spec.compile()
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        hull, added = self._vessel.hull, self._vessel.added_mass
        self._model.dof_armature[2:6] = (
            added.heave_ratio * hull.mass_kg,
            added.roll_ratio * hull.roll_inertia_kgm2,
            added.pitch_ratio * hull.pitch_inertia_kgm2,
            added.yaw_ratio * hull.yaw_inertia_kgm2,
        )
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))  # the inertia that MuJoCo keeps of a free body
        self._data = mujoco.MjData(self._model)
        self._qpos, self._qvel = self._data.qpos, self._data.qvel
        self._accelerometer = self._data.sensor("accelerometer").data
        self._gyro = self._data.sensor("gyro").data
        self._fans = Fans(0.0, 0.0)
        self._surroundings = CALM
        passive.install(self._model, self._apply_forces)

        boat = self._model.body("boat").id
        self._boat_geoms = frozenset(np.flatnonzero(self._model.geom_bodyid == boat).tolist())
        self._geom_names = [self._model.geom(geom).name for geom in range(self._model.ngeom)]
        self._actors_every = max(1, round(ACTORS_EVERY_S / config.step_s))
        self._actors = Actors(world.actors, self._actors_every * config.step_s, 0.5 * hull.length_m)
        self._mocap = [self._model.body(actor.id).mocapid[0] for actor in world.actors]
        self._vessels = [index for index, actor in enumerate(world.actors) if makes_waves(actor)]

        biases, gps, imu, water, ais, lidar, sonar = np.random.SeedSequence(seed).spawn(7)
        self._gps_rng, self._imu_rng = np.random.default_rng(gps), np.random.default_rng(imu)
        self._errors = initial_errors(config.sensors, np.random.default_rng(biases))
        self._water = Water(world, self._vessel, len(self._vessels), water)
        origin_deg = (world.origin_lat_deg, world.origin_lon_deg)
        self._ais = AisReceiver(world.actors, origin_deg, np.random.default_rng(ais))
        self._scanner = RangeScanner(
            self._model, boat, self._vessel.buoyancy.equilibrium_z_m, np.random.default_rng(lidar)
        )
        self._sonar = Sonar(config.sensors, self._vessel.draught_m, np.random.default_rng(sonar))
        self._last_fix = GpsReading(world.origin_lat_deg, world.origin_lon_deg, 0.0, 0.0, 0.0, fix=False)

        self.steps = 0
        self.distance_m = 0.0
        self.energy_j = 0.0
        self.collisions = 0
        self.in_contact = False
        self.touches: list[Touch] = []
        self._last_contact_s = -math.inf
        self._last_touch_of: dict[str, int] = {}  # index in `touches`
        mujoco.set_mju_user_warning(_keep_no_log_file)
        mujoco.mj_forward(self._model, self._data)

    @classmethod
    def from_scenario(cls, scenario: Scenario, config: PlantConfig) -> Self:
        """The plant of a scenario; a vessel in the settings overrides the scenario's."""
        vessel = config.vessel or scenario.vessel
        return cls(scenario.world, msgspec.structs.replace(config, vessel=vessel), scenario.seed, scenario.faults)

    @property
    def vessel(self) -> Vessel:
        """Coefficients of the hull."""
        return self._vessel

    def close(self) -> None:
        """Release the force hook; the plant steps no more."""
        passive.uninstall(self._model)

    @property
    def sim_us(self) -> int:
        """Simulated time [us]."""
        return round(self.steps * self._config.step_s * 1e6)

    @property
    def z_m(self) -> float:
        """Height of the body's origin above the water at rest."""
        return float(self._qpos[2])

    @property
    def attitude(self) -> Attitude:
        """True roll, pitch, yaw."""
        return attitude(*self._qpos[3:7].tolist())

    @property
    def position_m(self) -> tuple[float, float]:
        """True position in the map frame."""
        return float(self._qpos[0]), float(self._qpos[1])

    @property
    def velocity(self) -> tuple[float, float, float]:
        """True surge [m/s], sway [m/s] over ground and yaw rate [rad/s]."""
        state = self._hull_state()
        return (*body_velocity(state), state.yaw_rate_radps)

    @property
    def actors_along_m(self) -> tuple[float, ...]:
        """How far down its path each actor is, in the world's order."""
        return self._actors.along_m

    @property
    def surroundings(self) -> Surroundings:
        """Water and air about the hull in the last step."""
        return self._surroundings

    def step(self, left_n: float, right_n: float) -> None:
        """Advance one step with these fan forces [N] ordered. Raises PlantDiverged."""
        step_s = self._config.step_s
        x_m, y_m, _, qw, qx, qy, qz = self._qpos.tolist()
        now_s = self.steps * step_s
        if self.steps % self._actors_every == 0:
            self._move_actors(now_s, (x_m, y_m))
        yaw_rad = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        self._surroundings = self._water.surroundings_at(x_m, y_m, yaw_rad, now_s)
        order = (
            apply_thruster_loss(Fans(left_n, right_n), self._faults, now_s) if self._faults else Fans(left_n, right_n)
        )
        self._fans = apply_fan_lag(self._fans, order, self._vessel.fans.lag_s, step_s)
        mujoco.mj_step(self._model, self._data)
        self.steps += 1
        pose, velocity = self._qpos.tolist(), self._qvel.tolist()
        if not math.isfinite(sum(pose) + sum(velocity)):
            raise PlantDiverged(f"plant: state is not finite after {self.steps} steps")
        self.distance_m += math.hypot(pose[0] - x_m, pose[1] - y_m)
        self.energy_j += self._power_w(math.cos(yaw_rad), math.sin(yaw_rad), velocity) * step_s
        self._count_contacts()

    def read_gps(self) -> GpsReading:
        """One fix; to be read at `gps_rate_hz`, the wandering error advances by one period."""
        origin_deg = (self._world.origin_lat_deg, self._world.origin_lon_deg)
        now_s = self.sim_us * 1e-6
        truth = apply_gps_jump(self._truth(), self._faults, now_s)
        self._errors, reading = measure_gps(self._errors, truth, origin_deg, self._config.sensors, self._gps_rng)
        reading = apply_gps_outage(reading, self._last_fix, self._faults, now_s)
        self._last_fix = reading
        return reading

    def read_imu(self) -> ImuReading:
        """One IMU sample."""
        reading = measure_imu(self._errors, self._truth(), self._config.sensors, self._imu_rng)
        return apply_imu_bias(reading, self._faults, self.sim_us * 1e-6) if self._faults else reading

    def read_ais(self, now_us: int) -> tuple[AisVessel, ...]:
        """The vessels that an AIS receiver has heard, dated by `now_us`; to be read once a second."""
        return self._ais.hear(self._actors.poses, self._actors.speeds_mps, self.sim_us * 1e-6, now_us)

    def read_lidar(self) -> tuple[float, ...]:
        """The ranges of one turn of the scanner [m], 0 where nothing was met; see `RangeScanner`."""
        return self._scanner.scan(self._data)

    def read_sonar(self) -> float | None:
        """One sounding [m]; None without an echo. To be read at `sonar_rate_hz`."""
        depth_m = depth_at_m(self._world, *self.position_m)
        heave_m = self.z_m - self._vessel.buoyancy.equilibrium_z_m
        return self._sonar.measure(depth_m, heave_m, self._faults, self.sim_us * 1e-6)

    def state_hash(self) -> str:
        """SHA-256 of position and velocity, to compare runs bit by bit."""
        return hashlib.sha256(self._qpos.tobytes() + self._qvel.tobytes()).hexdigest()

    def place(self, x_m: float, y_m: float, yaw_rad: float, z_m: float | None = None) -> None:
        """Put the boat somewhere else, at rest. `z_m` None: floating."""
        height_m = self._vessel.buoyancy.equilibrium_z_m if z_m is None else z_m
        half = 0.5 * yaw_rad
        self._qpos[:7] = [x_m, y_m, height_m, math.cos(half), 0.0, 0.0, math.sin(half)]
        self._qvel[:6] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def _apply_forces(self, data: mujoco.MjData) -> None:
        data.qfrc_passive[:6] = compute_wrench(self._hull_state(), self._fans, self._vessel, self._surroundings)

    def _hull_state(self) -> HullState:
        return HullState(*self._qpos.tolist()[2:], *self._qvel.tolist())

    def _truth(self) -> Truth:
        pose, velocity = self._qpos.tolist(), self._qvel.tolist()
        angles = attitude(*pose[3:])
        rates, force = self._gyro.tolist(), self._accelerometer.tolist()
        return Truth(pose[0], pose[1], velocity[0], velocity[1], *angles, tuple(rates), tuple(force))

    def _power_w(self, cos: float, sin: float, velocity: list[float]) -> float:
        """Work of the fans on the hull as it goes through the water: each one's force times its speed ahead."""
        surroundings, yaw_rate = self._surroundings, velocity[5]
        ahead_mps = cos * (velocity[0] - surroundings.current_x_mps) + sin * (velocity[1] - surroundings.current_y_mps)
        turn_mps = 0.5 * self._vessel.fans.spacing_m * yaw_rate
        left_w, right_w = self._fans.left_n * (ahead_mps - turn_mps), self._fans.right_n * (ahead_mps + turn_mps)
        return abs(left_w) + abs(right_w)

    def _move_actors(self, now_s: float, boat_xy_m: tuple[float, float]) -> None:
        if not self._mocap:
            return
        self._actors.advance(now_s, boat_xy_m)
        poses = self._actors.poses
        self._data.mocap_pos[self._mocap, :2] = [pose[:2] for pose in poses]
        halves = [0.5 * pose.yaw_rad for pose in poses]
        self._data.mocap_quat[self._mocap] = [(math.cos(half), 0.0, 0.0, math.sin(half)) for half in halves]
        actors, speeds = self._world.actors, self._actors.speeds_mps
        self._water.update_vessels([WakeSource(*poses[i], speeds[i], actors[i].width_m) for i in self._vessels], now_s)

    def _count_contacts(self) -> None:
        self.in_contact = False
        if self._data.ncon == 0:
            return
        now_s = self.sim_us * 1e-6
        contacts = self._data.contact
        for pair, gap_m in zip(contacts.geom.tolist(), contacts.dist.tolist(), strict=True):
            if gap_m <= 0.0:
                self.in_contact = True
                self._record_contact(
                    next(self._geom_names[geom] for geom in pair if geom not in self._boat_geoms), now_s
                )
        if self.in_contact:
            if now_s - self._last_contact_s > COLLISION_GAP_S:
                self.collisions += 1
            self._last_contact_s = now_s

    def _record_contact(self, name: str, now_s: float) -> None:
        last = self._last_touch_of.get(name)
        if last is not None and now_s - self.touches[last].ended_s <= COLLISION_GAP_S:
            self.touches[last] = self.touches[last]._replace(ended_s=now_s)
            return
        self._last_touch_of[name] = len(self.touches)
        self.touches.append(Touch(name, now_s, now_s))


def _keep_no_log_file(_: str) -> None:
    """Without it MuJoCo writes its warnings to a file in the working folder; `step` raises anyway."""
