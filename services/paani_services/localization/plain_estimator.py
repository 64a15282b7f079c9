"""The paper's estimates, for comparison: a local filter with the IMU, a global one with GPS position and IMU heading.

The global filter takes the velocity over ground as constant but for noise (L1, L3). It believes its sensors: it refuses
no fix, estimates neither the receiver's slow error nor the compass's, and measures no speed, so that a boat at rest
seems to move as its receiver's error does (L5).
"""

import math
from collections import Counter
from collections.abc import Sequence

import msgspec
import numpy as np

from paani.config import LocalizationConfig
from paani.geometry import enu_from_geodetic, geodetic_from_enu
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.levelling import mean_level_motion
from paani_services.localization.odometry_message import StoppedFlag, is_fresh, odometry_of, unknown_odometry
from paani_services.localization.planar_filter import PSI, PX, PY, SIZE, PlanarFilter, U, V
from paani_services.localization.sensor_checks import check_fix, take_samples

YAW_STD_RAD = 0.02  # of the compass
ACCEL_STD_MPS2 = 0.1  # change of the velocity that is taken as constant, per root second: a small boat under way
START_SPEED_STD_MPS = 1.0
LOCAL_SWAY_STD_MPS, LOCAL_SURGE_STD_MPS = 0.15, 2.0  # let the local filter's speed fade, which nothing measures
NO_GATE = 1e12  # squared sigmas: refuses nothing but what is not a number
CONVERGED_FIXES = 5  # before the position may be believed
COMPASS_AGE_S = 3.0  # without a heading for longer, the estimate is unhealthy


class PlainEstimator:
    """Estimates pose and velocity; `step` is to be called at `rate_hz`."""

    def __init__(self, config: LocalizationConfig) -> None:
        self._config = config
        self._origin_deg = config.origin_lat_lon_deg
        self.drops = Counter[str]()
        """Messages refused since the process began, by cause."""
        self._reset()

    def _reset(self) -> None:
        self._local: PlanarFilter | None = None
        self._global: PlanarFilter | None = None
        self._last_imu: ImuSample | None = None
        self._last_heading: ImuSample | None = None
        self._last_fix: GpsFix | None = None
        self._fixes = 0
        self._nis = 0.0
        self._stopped = StoppedFlag(self._config)

    def step(self, samples: Sequence[ImuSample], fix: GpsFix | None, now_us: int) -> tuple[Odometry, Odometry]:
        """Local and global odometry after these IMU samples, oldest first, and perhaps a new fix.

        Healthy while IMU, heading and GPS are fresh and no standard deviation is too large. What is dropped and what
        starts everything anew is as in `Estimator.step`.
        """
        samples, begins_anew = take_samples(samples, self._last_imu, now_us, self.drops)
        if begins_anew:
            self._reset()
        if samples:
            self._predict_motion(samples)
        usable = None if fix is None else check_fix(fix, self._last_fix, now_us, self.drops)
        if usable is not None and self._last_imu is not None:
            self._use_fix(usable, self._last_imu)
        self._stopped.note_speed(self._global, now_us)
        return self._local_odometry(now_us), self._global_odometry(now_us)

    def _predict_motion(self, samples: Sequence[ImuSample]) -> None:
        newest, before = samples[-1], self._last_imu
        self._last_imu = newest
        if newest.orientation_available:
            self._last_heading = newest
        if before is None or self._local is None:
            self._local = _start(0.0, 0.0, newest, 0.0)
            return
        step_s = (newest.source_us - before.source_us) * 1e-6
        ahead_mps2, left_mps2, yaw_rate_radps = mean_level_motion(samples)
        self._local.predict(yaw_rate_radps, ahead_mps2, left_mps2, step_s)
        self._local.correct_sideslip(LOCAL_SWAY_STD_MPS, LOCAL_SURGE_STD_MPS)
        filters = [self._local]
        if self._global is not None:
            self._global.predict(yaw_rate_radps, 0.0, 0.0, step_s)
            noise = np.zeros(SIZE)
            noise[[U, V]] = ACCEL_STD_MPS2 * math.sqrt(step_s)
            self._global.inflate_covariance(noise)
            filters.append(self._global)
        if newest.orientation_available:
            for each in filters:
                each.correct_yaw(newest.yaw_rad, YAW_STD_RAD, NO_GATE)

    def _use_fix(self, fix: GpsFix, newest: ImuSample) -> None:
        """Start the global filter at the first fix; correct its position by later ones."""
        self._origin_deg = self._origin_deg or (fix.latitude_deg, fix.longitude_deg)
        x_m, y_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *self._origin_deg)
        if not is_fresh(self._last_fix, self._config.max_gps_age_s, fix.source_us):
            self._fixes = 0
        self._last_fix = fix
        self._fixes += 1
        if self._global is None:
            self._global = _start(x_m, y_m, newest, fix.position_std_m)
            return
        self._nis = min(self._global.correct_position(x_m, y_m, fix.position_std_m, NO_GATE).nis, NO_GATE)

    def _local_odometry(self, now_us: int) -> Odometry:
        if self._local is None:
            return unknown_odometry(now_us)
        return odometry_of(
            self._local,
            self._last_imu,
            now_us,
            healthy=is_fresh(self._last_imu, self._config.max_imu_age_s, now_us),
            stopped=self._stopped.is_set(now_us),
        )

    def _global_odometry(self, now_us: int) -> Odometry:
        if self._global is None or self._origin_deg is None:
            return unknown_odometry(now_us)
        config = self._config
        healthy = (
            is_fresh(self._last_imu, config.max_imu_age_s, now_us)
            and is_fresh(self._last_heading, COMPASS_AGE_S, now_us)
            and is_fresh(self._last_fix, config.max_gps_age_s, now_us)
            and self._fixes >= CONVERGED_FIXES
        )
        stopped = self._stopped.is_set(now_us)
        odometry = odometry_of(self._global, self._last_imu, now_us, healthy=healthy, stopped=stopped)
        is_sure = (
            odometry.position_std_m <= config.max_position_std_m and odometry.yaw_std_rad <= config.max_yaw_std_rad
        )
        latitude_deg, longitude_deg = geodetic_from_enu(odometry.x_m, odometry.y_m, *self._origin_deg)
        return msgspec.structs.replace(
            odometry,
            healthy=odometry.healthy and is_sure,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            nis=self._nis,
        )


def _start(x_m: float, y_m: float, newest: ImuSample, position_std_m: float) -> PlanarFilter:
    """A filter at rest at this place, with the heading of the IMU, unknown where it has none."""
    x, std = np.zeros(SIZE), np.zeros(SIZE)
    x[[PX, PY, PSI]] = x_m, y_m, newest.yaw_rad
    std[[PX, PY, U, V]] = position_std_m, position_std_m, START_SPEED_STD_MPS, START_SPEED_STD_MPS
    std[PSI] = YAW_STD_RAD if newest.orientation_available else math.pi
    return PlanarFilter(x, std)
