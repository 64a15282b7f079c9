"""Messages of the plant: measurements and truth. `source_us` dates the step."""

from collections.abc import Callable
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.config import PlantConfig
from paani.messages.ais import MAX_VESSELS
from paani_sim.plant import lidar
from paani_sim.plant.plant import Plant

Reading = Callable[[Plant, int], m.Message]


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
    """Publishes what the sensors that the boat carries measure, and the true pose, each at its rate."""

    def __init__(self, bus: Bus, config: PlantConfig) -> None:
        sensors, rate_hz = config.sensors, 1.0 / config.step_s
        wanted: list[tuple[keys.Topic[Any], float, Reading]] = [
            (keys.IMU, sensors.imu_rate_hz, imu_message),
            (keys.GPS, sensors.gps_rate_hz, gps_message),
            (keys.AIS, keys.AIS.rate_hz if sensors.ais else 0.0, ais_message),
            (keys.SCAN, keys.SCAN.rate_hz if sensors.lidar else 0.0, scan_message),
            (keys.DEPTH, sensors.sonar_rate_hz if sensors.sonar else 0.0, depth_message),
            (keys.TRUE_POSE, rate_hz / report_every(config), pose_message),
        ]
        self._carried = [
            (max(1, round(rate_hz / hz)), bus.publisher(topic), read) for topic, hz, read in wanted if hz > 0.0
        ]

    def publish(self, plant: Plant, source_us: int) -> None:
        """`source_us` dates the step that was just made."""
        for every, publisher, read in self._carried:
            if plant.steps % every == 0:
                publisher.put(read(plant, source_us))
