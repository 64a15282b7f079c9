"""GPS, IMU and compass with their errors (K9). Pure: state, truth and generator in.

A GPS error wanders (first-order Gauss-Markov) instead of being drawn anew for each fix, as a real
receiver's does; gyro and compass carry one unknown bias for the whole run.
"""

import math
from typing import NamedTuple

import numpy as np

from paani.config import SensorsConfig
from paani.geometry import geodetic_from_enu, wrap_rad

Vector3 = tuple[float, float, float]


class Truth(NamedTuple):
    """The true state that the sensors measure: map position and velocity, body rates and specific force."""

    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    rates_radps: Vector3
    specific_force_mps2: Vector3


class SensorErrors(NamedTuple):
    """The errors that persist between measurements."""

    gps_x_m: float
    gps_y_m: float
    gyro_radps: Vector3
    compass_rad: float


class GpsReading(NamedTuple):
    """Geodetic position and the velocity over ground; the course is counter-clockwise from east."""

    latitude_deg: float
    longitude_deg: float
    sog_mps: float
    cog_rad: float
    position_std_m: float
    fix: bool = True


class ImuReading(NamedTuple):
    """Body rates, specific force, attitude."""

    rates_radps: Vector3
    specific_force_mps2: Vector3
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


def initial_errors(config: SensorsConfig, rng: np.random.Generator) -> SensorErrors:
    """Draw the biases of one run from their stationary distributions."""
    draw = rng.standard_normal(6).tolist()
    gyro = config.gyro_bias_std_radps
    return SensorErrors(
        gps_x_m=config.gps_bias_std_m * draw[0],
        gps_y_m=config.gps_bias_std_m * draw[1],
        gyro_radps=(gyro * draw[2], gyro * draw[3], gyro * draw[4]),
        compass_rad=config.compass_bias_std_rad * draw[5],
    )


def measure_gps(
    errors: SensorErrors,
    truth: Truth,
    origin_deg: tuple[float, float],
    config: SensorsConfig,
    rng: np.random.Generator,
) -> tuple[SensorErrors, GpsReading]:
    """One fix, `1 / gps_rate_hz` after the last one. `origin_deg` is the map's latitude, longitude."""
    draw = rng.standard_normal(6).tolist()
    keep = math.exp(-1.0 / (config.gps_rate_hz * config.gps_bias_time_s))
    renew_m = config.gps_bias_std_m * math.sqrt(1.0 - keep * keep)
    bias_x_m = keep * errors.gps_x_m + renew_m * draw[0]
    bias_y_m = keep * errors.gps_y_m + renew_m * draw[1]
    latitude_deg, longitude_deg = geodetic_from_enu(
        truth.x_m + bias_x_m + config.gps_white_std_m * draw[2],
        truth.y_m + bias_y_m + config.gps_white_std_m * draw[3],
        *origin_deg,
    )
    vx_mps = truth.vx_mps + config.gps_speed_std_mps * draw[4]
    vy_mps = truth.vy_mps + config.gps_speed_std_mps * draw[5]
    reading = GpsReading(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        sog_mps=math.hypot(vx_mps, vy_mps),
        cog_rad=math.atan2(vy_mps, vx_mps),
        position_std_m=math.hypot(config.gps_bias_std_m, config.gps_white_std_m),
    )
    return errors._replace(gps_x_m=bias_x_m, gps_y_m=bias_y_m), reading


def measure_imu(errors: SensorErrors, truth: Truth, config: SensorsConfig, rng: np.random.Generator) -> ImuReading:
    """One sample: rates with bias and noise, specific force with noise, attitude with noise and compass bias.

    Roll and pitch come from gravity: what disturbs the force along an axis of the hull tilts the boat about the other.
    """
    draw = rng.standard_normal(7).tolist()
    gyro, accel = config.gyro_noise_radps, config.accel_noise_mps2
    rates, force, bias = truth.rates_radps, truth.specific_force_mps2, errors.gyro_radps
    return ImuReading(
        rates_radps=(
            rates[0] + bias[0] + gyro * draw[0],
            rates[1] + bias[1] + gyro * draw[1],
            rates[2] + bias[2] + gyro * draw[2],
        ),
        specific_force_mps2=(
            force[0] + accel * draw[3],
            force[1] + accel * draw[4],
            force[2] + accel * draw[5],
        ),
        roll_rad=truth.roll_rad + config.tilt_noise_rad * draw[4],
        pitch_rad=truth.pitch_rad + config.tilt_noise_rad * draw[3],
        yaw_rad=wrap_rad(truth.yaw_rad + errors.compass_rad + config.compass_noise_rad * draw[6]),
    )
