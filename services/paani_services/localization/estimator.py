"""Two filters side by side (L1, L3): local from the IMU alone, global from GPS and IMU heading.

Values in, values out; time comes with the samples. An estimate is never simulator truth (L4).
"""

import math
import statistics
from collections.abc import Sequence

import numpy as np

from paani.config import LocalizationConfig
from paani.geometry import enu_from_geodetic, geodetic_from_enu
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.calibration import gyro_bias
from paani_services.localization.filter import PSI, PX, PY, PlanarFilter, U, V

GRAVITY_MPS2 = 9.81
MAX_SAMPLE_GAP_S = 0.1  # the boat is not predicted across a longer gap between IMU samples
NOMINAL_GAP_S = 0.01
YAW_STD_RAD = 0.03  # compass noise of one averaged step; its bias is floored below
YAW_FLOOR_RAD = 0.02  # an unknown constant compass bias
GPS_SPEED_STD_MPS = 0.07
SWAY_STD_MPS = 0.15
LOCAL_SPEED_STD_MPS = 2.0  # the local filter's surge fades towards zero instead of running away
CONVERGED_FIXES = 5
DOUBTFUL_FIXES = 3  # refused in a row: one of the two is wrong
REFUSED_FIXES = 10  # refused in a row: the filter is wrong, not the receiver


class Estimator:
    """Estimates pose and velocity. `step` it at `rate_hz`."""

    def __init__(self, config: LocalizationConfig) -> None:
        self._config = config
        self._origin_deg = config.origin_lat_lon_deg
        self._reset()

    def _reset(self) -> None:
        """Know nothing; also when the IMU began again, for the boat may have been moved."""
        self._calibration: list[ImuSample] = []
        self._local: PlanarFilter | None = None
        self._global: PlanarFilter | None = None
        self._last_imu: ImuSample | None = None
        self._last_fix: GpsFix | None = None
        self._bias = gyro_bias(())
        self._accepted = 0
        self._refused = 0
        self._slow_since_us: int | None = None

    def step(self, samples: Sequence[ImuSample], fix: GpsFix | None, now_us: int) -> tuple[Odometry, Odometry]:
        """Local and global odometry after these IMU samples, oldest first, and perhaps a new fix.

        Both are unhealthy until the gyro is calibrated and, for the global one, the position has
        converged; and again whenever GPS or IMU is older than its limit or the spread is too large.
        A new epoch of the IMU starts everything anew.
        """
        if samples:
            if self._last_imu is not None and samples[-1].epoch != self._last_imu.epoch:
                self._reset()
            self._move(samples)
        if fix is not None and fix.fix:
            self._take_fix(fix)
        self._watch_speed(now_us)
        imu_fresh = self._is_fresh(self._last_imu, self._config.max_imu_age_s, now_us)
        return self._local_odometry(now_us, imu_fresh), self._global_odometry(now_us, imu_fresh)

    def _move(self, samples: Sequence[ImuSample]) -> None:
        newest = samples[-1]
        if self._local is None:
            self._calibrate(samples)
            self._last_imu = newest
            return
        before_us = self._last_imu.source_us if self._last_imu else 0
        step_s = (newest.source_us - before_us) * 1e-6
        if not 0.0 < step_s <= MAX_SAMPLE_GAP_S * len(samples):
            step_s = NOMINAL_GAP_S * len(samples)
        self._last_imu = newest
        yaw_rate = statistics.fmean(sample.gyro_z_radps for sample in samples)
        ahead = statistics.fmean(sample.accel_x_mps2 + GRAVITY_MPS2 * math.sin(sample.pitch_rad) for sample in samples)
        left = statistics.fmean(
            sample.accel_y_mps2 - GRAVITY_MPS2 * math.sin(sample.roll_rad) * math.cos(sample.pitch_rad)
            for sample in samples
        )
        for each in (self._local, self._global):
            if each is None:
                continue
            each.predict(yaw_rate, ahead, left, step_s)
            if newest.orientation_available:
                each.correct_yaw(newest.yaw_rad, YAW_STD_RAD, math.inf)
            each.correct_sway(0.0, SWAY_STD_MPS)
        self._local.correct_surge(0.0, LOCAL_SPEED_STD_MPS)

    def _calibrate(self, samples: Sequence[ImuSample]) -> None:
        self._calibration += samples
        first, newest = self._calibration[0], self._calibration[-1]
        if (newest.source_us - first.source_us) * 1e-6 < self._config.calibration_s:
            return
        self._bias = gyro_bias(self._calibration)
        self._calibration.clear()
        self._local = PlanarFilter(
            np.array([0.0, 0.0, newest.yaw_rad, 0.0, 0.0, self._bias.radps]),
            np.array([0.01, 0.01, self._initial_yaw_std_rad(newest), 0.2, 0.1, self._bias.std_radps]),
        )

    def _take_fix(self, fix: GpsFix) -> None:
        if self._local is None or self._last_imu is None:
            return
        if self._origin_deg is None:
            self._origin_deg = (fix.latitude_deg, fix.longitude_deg)
        self._last_fix = fix
        x_m, y_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *self._origin_deg)
        if self._global is None or self._refused >= REFUSED_FIXES:
            self._start_global(x_m, y_m, fix)
            return
        gate2 = self._config.gate_mahalanobis2
        if self._global.correct_position(x_m, y_m, fix.position_std_m, gate2):
            self._accepted, self._refused = self._accepted + 1, 0
        else:
            self._refused += 1
        vx_mps, vy_mps = fix.sog_mps * math.cos(fix.cog_rad), fix.sog_mps * math.sin(fix.cog_rad)
        self._global.correct_velocity(vx_mps, vy_mps, GPS_SPEED_STD_MPS, gate2)

    def _start_global(self, x_m: float, y_m: float, fix: GpsFix) -> None:
        assert self._local is not None
        assert self._last_imu is not None
        yaw_rad = float(self._local.x[PSI])
        surge_mps = fix.sog_mps * math.cos(fix.cog_rad - yaw_rad)
        self._global = PlanarFilter(
            np.array([x_m, y_m, yaw_rad, surge_mps, 0.0, self._bias.radps]),
            np.array(
                [
                    fix.position_std_m,
                    fix.position_std_m,
                    self._initial_yaw_std_rad(self._last_imu),
                    0.2,
                    0.1,
                    self._bias.std_radps,
                ]
            ),
        )
        self._accepted = self._refused = 0

    def _watch_speed(self, now_us: int) -> None:
        if self._global is None or float(np.hypot(self._global.x[U], self._global.x[V])) > (
            self._config.stopped_speed_mps
        ):
            self._slow_since_us = None
        elif self._slow_since_us is None:
            self._slow_since_us = now_us

    def _is_stopped(self, now_us: int) -> bool:
        since_us = self._slow_since_us
        return since_us is not None and (now_us - since_us) * 1e-6 >= self._config.stopped_after_s

    def _local_odometry(self, now_us: int, imu_fresh: bool) -> Odometry:
        if self._local is None:
            return self._nothing(now_us)
        return self._odometry(self._local, now_us, healthy=imu_fresh)

    def _global_odometry(self, now_us: int, imu_fresh: bool) -> Odometry:
        if self._global is None or self._last_fix is None or self._origin_deg is None:
            return self._nothing(now_us)
        floor_m = self._last_fix.position_std_m
        odometry = self._odometry(self._global, now_us, healthy=False, floor_m=floor_m)
        healthy = (
            imu_fresh
            and self._is_fresh(self._last_fix, self._config.max_gps_age_s, now_us)
            and self._accepted >= CONVERGED_FIXES
            and self._refused < DOUBTFUL_FIXES
            and odometry.position_std_m <= self._config.max_position_std_m
            and odometry.yaw_std_rad <= self._config.max_yaw_std_rad
        )
        return self._odometry(self._global, now_us, healthy=healthy, floor_m=floor_m)

    def _odometry(self, source: PlanarFilter, now_us: int, *, healthy: bool, floor_m: float = 0.0) -> Odometry:
        x, std = source.x.tolist(), source.std.tolist()
        latitude_deg, longitude_deg = 0.0, 0.0
        if source is self._global and self._origin_deg is not None:
            latitude_deg, longitude_deg = geodetic_from_enu(x[PX], x[PY], *self._origin_deg)
        last = self._last_imu
        return Odometry(
            source_us=last.source_us if last else now_us,
            x_m=x[PX],
            y_m=x[PY],
            yaw_rad=x[PSI],
            surge_mps=x[U],
            sway_mps=x[V],
            yaw_rate_radps=last.gyro_z_radps - x[-1] if last else 0.0,
            position_std_m=max(math.hypot(std[PX], std[PY]) / math.sqrt(2.0), floor_m),
            yaw_std_rad=max(std[PSI], YAW_FLOOR_RAD),
            healthy=healthy and all(map(math.isfinite, x + std)),
            stopped=self._is_stopped(now_us),
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            roll_rad=last.roll_rad if last and last.orientation_available else 0.0,
            pitch_rad=last.pitch_rad if last and last.orientation_available else 0.0,
        )

    @staticmethod
    def _nothing(now_us: int) -> Odometry:
        return Odometry(source_us=now_us, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0)

    @staticmethod
    def _initial_yaw_std_rad(sample: ImuSample) -> float:
        return YAW_STD_RAD if sample.orientation_available else math.pi

    @staticmethod
    def _is_fresh(message: ImuSample | GpsFix | None, limit_s: float, now_us: int) -> bool:
        return message is not None and (now_us - message.source_us) * 1e-6 <= limit_s
