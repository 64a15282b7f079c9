"""A simulated boat on a plane with its sensors, and the estimator at 20 Hz."""

import math
from collections.abc import Callable

import msgspec
import numpy as np

from paani.config import LocalizationConfig
from paani.geometry import geodetic_from_enu
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.choice import create_estimator

ORIGIN_DEG = (50.0, 8.0)
CONFIG = LocalizationConfig(origin_lat_lon_deg=ORIGIN_DEG)
START_US = 5_000_000
BIAS_RADPS = 0.004  # of the gyro
MAX_ACCEL_MPS2 = 0.5


def unchanged(samples: list[ImuSample]) -> list[ImuSample]:
    return samples


class EstimatedBoat:
    """`wander_m`: standard deviation of the slow GPS error; `fix_noise_m`: of the error that is new with each fix."""

    def __init__(
        self,
        config: LocalizationConfig = CONFIG,
        seed: int = 1,
        *,
        wander_m: float = 0.0,
        fix_noise_m: float = 0.3,
        fix_speed_noise_mps: float = 0.05,
        fix_std_m: float = 0.8,
        steps_per_fix: int = 4,
    ) -> None:
        self.estimator = create_estimator(config)
        self.rng = np.random.default_rng(seed)
        self.now_us = START_US
        self.x_m, self.y_m, self.yaw_rad, self.surge_mps = 20.0, -10.0, 0.5, 0.0
        self.gps = self.imu = True
        self.fix_offset_m = self.compass_bias_rad = self.gyro_fault_radps = 0.0
        self.epoch = 0
        self.local_estimate = self.global_estimate = Odometry(source_us=0, x_m=0, y_m=0, yaw_rad=0, surge_mps=0)
        self.change_samples: Callable[[list[ImuSample]], list[ImuSample]] = (
            unchanged  # a fault on the way to the estimator
        )
        self.change_fix: Callable[[GpsFix], GpsFix] = lambda fix: fix
        self._wander_std_m, self._wander_m = wander_m, wander_m * self.rng.standard_normal(2)
        self._fix_noise_m, self._fix_speed_noise_mps, self._fix_std_m = fix_noise_m, fix_speed_noise_mps, fix_std_m
        self._steps_per_fix = steps_per_fix

    def sail(self, seconds: float, surge_mps: float = 0.0, yaw_rate_radps: float = 0.0) -> list[Odometry]:
        """Advance by `seconds`, accelerating to this speed; returns the global estimates."""
        estimates = []
        for step in range(round(seconds * 20)):
            samples = self.change_samples([self.sample(surge_mps, yaw_rate_radps) for _ in range(5)])
            fix = self.change_fix(self.fix()) if step % self._steps_per_fix == 0 and self.gps else None
            self.local_estimate, self.global_estimate = self.estimator.step(
                samples if self.imu else [], fix, self.now_us
            )
            estimates.append(self.global_estimate)
        return estimates

    def error_m(self) -> float:
        """Distance of the global estimate from the true position."""
        return math.hypot(self.global_estimate.x_m - self.x_m, self.global_estimate.y_m - self.y_m)

    def sample(self, surge_mps: float, yaw_rate_radps: float) -> ImuSample:
        """Advance the boat by 10 ms, accelerating to that speed; returns the IMU sample."""
        self.now_us += 10_000
        change = MAX_ACCEL_MPS2 * 0.01
        gained_mps = min(max(surge_mps - self.surge_mps, -change), change)
        self.surge_mps += gained_mps
        self.yaw_rad += yaw_rate_radps * 0.01
        self.x_m += self.surge_mps * math.cos(self.yaw_rad) * 0.01
        self.y_m += self.surge_mps * math.sin(self.yaw_rad) * 0.01
        noise = self.rng.standard_normal(4).tolist()
        return ImuSample(
            source_us=self.now_us,
            epoch=self.epoch,
            gyro_x_radps=0.0,
            gyro_y_radps=0.0,
            gyro_z_radps=yaw_rate_radps + BIAS_RADPS + self.gyro_fault_radps + 0.002 * noise[0],
            accel_x_mps2=gained_mps / 0.01 + 0.03 * noise[1],
            accel_y_mps2=self.surge_mps * yaw_rate_radps + 0.03 * noise[2],
            accel_z_mps2=9.81,
            orientation_available=True,
            yaw_rad=self.yaw_rad + self.compass_bias_rad + 0.01 * noise[3],
        )

    def fix(self) -> GpsFix:
        """The fix that the receiver gives now."""
        keep = math.exp(-self._steps_per_fix / 20.0 / 60.0)
        renew_m = self._wander_std_m * math.sqrt(1.0 - keep * keep)
        self._wander_m = keep * self._wander_m + renew_m * self.rng.standard_normal(2)
        noise = self.rng.standard_normal(4).tolist()
        latitude_deg, longitude_deg = geodetic_from_enu(
            self.x_m + self.fix_offset_m + float(self._wander_m[0]) + self._fix_noise_m * noise[0],
            self.y_m + float(self._wander_m[1]) + self._fix_noise_m * noise[1],
            *ORIGIN_DEG,
        )
        vx = self.surge_mps * math.cos(self.yaw_rad) + self._fix_speed_noise_mps * noise[2]
        vy = self.surge_mps * math.sin(self.yaw_rad) + self._fix_speed_noise_mps * noise[3]
        return GpsFix(
            source_us=self.now_us,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            sog_mps=math.hypot(vx, vy),
            cog_rad=math.atan2(vy, vx),
            position_std_m=self._fix_std_m,
        )


def wandering(seed: int = 1, config: LocalizationConfig = CONFIG) -> EstimatedBoat:
    """A boat with the simulator's receiver: 0.8 m of slow error, 0.05 m of noise."""
    return EstimatedBoat(config, seed, wander_m=0.8, fix_noise_m=0.05)


def shifted(sample: ImuSample, by_us: int) -> ImuSample:
    """The same sample with another stamp."""
    return msgspec.structs.replace(sample, source_us=sample.source_us + by_us)
