"""Messages of the plant: measurements and truth. `source_us` dates the step."""

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.config import PlantConfig
from paani.messages.ais import MAX_VESSELS
from paani_sim.plant import lidar
from paani_sim.plant.plant import Plant


def gps_message(plant: Plant, source_us: int) -> m.GpsFix:
    """Read the GPS."""
    return m.GpsFix(source_us=source_us, **plant.read_gps()._asdict())


def imu_message(plant: Plant, source_us: int) -> m.ImuSample:
    """Read the IMU."""
    reading = plant.read_imu()
    gyro, accel = reading.rates_radps, reading.specific_force_mps2
    return m.ImuSample(
        source_us=source_us,
        gyro_x_radps=gyro[0],
        gyro_y_radps=gyro[1],
        gyro_z_radps=gyro[2],
        accel_x_mps2=accel[0],
        accel_y_mps2=accel[1],
        accel_z_mps2=accel[2],
        orientation_available=True,
        roll_rad=reading.roll_rad,
        pitch_rad=reading.pitch_rad,
        yaw_rad=reading.yaw_rad,
    )


def ais_message(plant: Plant, source_us: int) -> m.AisVessels:
    """Read the AIS receiver."""
    return m.AisVessels(source_us=source_us, vessels=plant.read_ais(source_us)[:MAX_VESSELS])


def scan_message(plant: Plant, source_us: int) -> m.RangeScan:
    """Read the range scanner."""
    return m.RangeScan(
        source_us=source_us,
        ranges_m=plant.read_lidar(),
        first_bearing_rad=lidar.FIRST_BEARING_RAD,
        step_rad=lidar.STEP_RAD,
        max_range_m=lidar.MAX_RANGE_M,
        forward_m=lidar.FORWARD_M,
    )


def depth_message(plant: Plant, source_us: int) -> m.Depth:
    """Read the echo sounder."""
    depth_m = plant.read_sonar()
    return m.Depth(source_us=source_us, depth_m=depth_m or 0.0, available=depth_m is not None)


def pose_message(plant: Plant, source_us: int) -> m.TruePose:
    """Simulator truth."""
    (x_m, y_m), angles, (surge_mps, sway_mps, yaw_rate) = plant.position_m, plant.attitude, plant.velocity
    return m.TruePose(
        source_us=source_us,
        sim_us=plant.sim_us,
        x_m=x_m,
        y_m=y_m,
        z_m=plant.z_m,
        roll_rad=angles.roll_rad,
        pitch_rad=angles.pitch_rad,
        yaw_rad=angles.yaw_rad,
        surge_mps=surge_mps,
        sway_mps=sway_mps,
        yaw_rate_radps=yaw_rate,
        distance_m=plant.distance_m,
        collisions=plant.collisions,
        in_contact=plant.in_contact,
        actors_along_m=plant.actors_along_m,
    )


def report_every(config: PlantConfig) -> int:
    """Steps between two reports of clock, pose and thrust."""
    return max(1, round(1.0 / config.step_s / config.publish_rate_hz))


class Measurements:
    """Publishes fixes, IMU samples and the true pose, each at its rate."""

    def __init__(self, bus: Bus, config: PlantConfig) -> None:
        self._gps, self._imu = bus.publisher(keys.GPS), bus.publisher(keys.IMU)
        self._ais, self._pose = bus.publisher(keys.AIS), bus.publisher(keys.TRUE_POSE)
        self._scan, self._depth = bus.publisher(keys.SCAN), bus.publisher(keys.DEPTH)
        rate_hz = 1.0 / config.step_s
        self._gps_every = max(1, round(rate_hz / config.sensors.gps_rate_hz))
        self._imu_every = max(1, round(rate_hz / config.sensors.imu_rate_hz))
        self._ais_every = max(1, round(rate_hz / keys.AIS.rate_hz)) if config.sensors.ais else 0
        self._scan_every = max(1, round(rate_hz / keys.SCAN.rate_hz)) if config.sensors.lidar else 0
        self._depth_every = max(1, round(rate_hz / config.sensors.sonar_rate_hz)) if config.sensors.sonar else 0
        self._pose_every = report_every(config)

    def publish(self, plant: Plant, source_us: int) -> None:
        """`source_us` dates the step that was just made."""
        if plant.steps % self._imu_every == 0:
            self._imu.put(imu_message(plant, source_us))
        if plant.steps % self._gps_every == 0:
            self._gps.put(gps_message(plant, source_us))
        if self._ais_every and plant.steps % self._ais_every == 0:
            self._ais.put(ais_message(plant, source_us))
        if self._scan_every and plant.steps % self._scan_every == 0:
            self._scan.put(scan_message(plant, source_us))
        if self._depth_every and plant.steps % self._depth_every == 0:
            self._depth.put(depth_message(plant, source_us))
        if plant.steps % self._pose_every == 0:
            self._pose.put(pose_message(plant, source_us))
