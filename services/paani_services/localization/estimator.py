"""Two extended Kalman filters side by side (L1, L3): local from the IMU alone, global with GPS and compass as well.

The local estimate never jumps; only the global one may guide the boat. Both say whether they may be believed.
Time comes with the samples. An estimate is never simulator truth (L4).
"""

import itertools
import math
from collections import Counter
from collections.abc import Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from paani.config import LocalizationConfig
from paani.geometry import clip, enu_from_geodetic, geodetic_from_enu, wrap_rad
from paani.messages import GpsFix, ImuSample, Odometry
from paani_services.localization.gyro_bias import estimate_gyro_bias
from paani_services.localization.levelling import mean_level_motion
from paani_services.localization.odometry_message import (
    StoppedFlag,
    is_fresh,
    odometry_of,
    unknown_odometry,
    with_position_std,
)
from paani_services.localization.planar_filter import PSI, PX, PY, SIZE, WX, WY, B, C, PlanarFilter, U, V
from paani_services.localization.rest_detection import MapFix, MotionEvidence, RestDetector
from paani_services.localization.sensor_checks import check_fix, take_samples

MAX_SAMPLE_GAP_S = 0.1  # gap between IMU samples beyond which the boat is not predicted across it
NOMINAL_GAP_S = 0.01  # between IMU samples at 100 Hz
UNSEEN_SPEED_MPS, UNSEEN_TURN_RADPS = 0.5, 0.3  # what the boat may have done during a gap of the IMU
YAW_STD_RAD = 0.02  # compass noise of one step
YAW_GATE2 = 9.0  # validation gate of the compass, squared sigmas: at 20 Hz a refusal costs little
COMPASS_BIAS_STD_RAD = 0.05  # at start, 3 degrees: an adjusted small compass on a small boat
COMPASS_DOUBT_S, COMPASS_DOUBT_RAD = 1.0, 0.1  # refused for so long, compass or gyro has changed by about so much
HEADING_DOUBT_S = 1.1  # of refusals, less what was accepted: more than a step of the compass takes to be followed
MAX_COMPASS_BIAS_RAD = 0.35  # 20 degrees; what seems to be farther off is a gyro or a compass that is broken
COMPASS_AGE_S = 3.0  # without a compass for longer, the heading is a guess, even if the course makes it look sure (A12)
COURSE_MPS = 0.3  # at a lower speed the course over ground says nothing of the heading
# The part of a fix's standard deviation that is noise from fix to fix is estimated; the rest wanders slowly.
GPS_NOISE_FRAC, MIN_GPS_NOISE_FRAC = 1.0 / 4.0, 1.0 / 32.0  # that part at first, and at least
FIRST_NOISE_FIXES, MAX_NOISE_FIXES = 10, 300  # fixes over which it is averaged, at first and at most
GPS_SPEED_PER_S = 1.0 / 16.0  # standard deviation of the speed over that of the position: 0.05 m/s for 0.8 m
MIN_GPS_SPEED_STD_MPS = 0.05  # no less for a better position, because receivers measure speed by other means
SWAY_STD_MPS = 1.4  # of one step of "sway is about zero"; at 20 Hz worth as much as 0.1 m/s held for 5 s
STRAIGHT_RADPS = 0.03  # at a higher yaw rate the hull slides outwards, so that its sway is not about zero
LOCAL_SWAY_STD_MPS = 0.15  # the same for the local filter, which has nothing else
LOCAL_SURGE_STD_MPS = 2.0  # lets the local filter's surge fade towards zero instead of running away
REST_STD_MPS = 0.03  # of the speed while the boat is found to lie still, over ground or in the water
SPEED_DOUBT_MPS = 0.3  # added to the standard deviation of the speed when fixes keep contradicting it
CONVERGED_FIXES = 5  # accepted before the position may be believed
REGAINED_FIXES = 3  # accepted after an outage before the position may be believed again
DOUBTFUL_FIXES = 3  # refused in a row: either the filter or the receiver is wrong
REFUSED_FIXES = 10  # refused in a row, and agreeing with the next: the filter is wrong, not the receiver
MAX_LAG_S = 1.0  # of a fix behind or ahead of the IMU
MAX_RANGE_M = 50_000.0  # from the origin; further away a plane is no map


class Estimator:
    """Estimates pose and velocity; `step` is to be called at `rate_hz`."""

    def __init__(self, config: LocalizationConfig) -> None:
        self._config = config
        self._origin_deg = config.origin_lat_lon_deg
        self.drops = Counter[str]()
        """Messages refused since the process began, by cause."""
        self._reset()

    def _reset(self, *, has_moved: bool = False) -> None:
        """Forget all estimates: at start, and when the IMU restarts, because the boat may have been moved meanwhile.

        has_moved: what is known of the boat from before.
        """
        self._calibration: list[ImuSample] = []
        self._local: PlanarFilter | None = None
        self._global: PlanarFilter | None = None
        self._last_imu: ImuSample | None = None
        self._last_heading: ImuSample | None = None
        self._last_fix: GpsFix | None = None
        self._gyro_bias = estimate_gyro_bias(())
        self._rest = RestDetector(has_moved=has_moved)
        self._accepted_fixes = 0
        self._refused_fixes = 0
        self._agreeing_refusals_m: list[tuple[float, float]] = []  # the latest refused fixes, as long as they agree
        self._refused_total = 0
        self._refused_speeds = 0
        self._compass_refused_s = self._disagreement_s = 0.0
        self._is_heading_doubted = False
        self._noise_frac2 = GPS_NOISE_FRAC**2
        self._noise_fixes = FIRST_NOISE_FIXES
        self._position_doubt_m = 0.0  # length of the last jump to the receiver's position; fades
        self._nis = 0.0
        self._stopped = StoppedFlag(self._config)

    def step(self, samples: Sequence[ImuSample], fix: GpsFix | None, now_us: int) -> tuple[Odometry, Odometry]:
        """Local and global odometry after these IMU samples, oldest first, and perhaps a new fix.

        Both are unhealthy until the gyro is calibrated and, for the global one, the position has converged; and again
        whenever GPS or IMU is older than its limit or a standard deviation is too large.
        Messages that are not finite, late, repeated or from the future are dropped and counted in `drops`.
        A new epoch of the IMU, or a clock that is set back, starts everything anew.
        """
        samples, begins_anew = take_samples(samples, self._last_imu, now_us, self.drops)
        if begins_anew:
            self._reset(has_moved=self._rest.has_moved)
        if samples:
            self._predict_motion(samples)
        usable = None if fix is None else check_fix(fix, self._last_fix, now_us, self.drops)
        if usable is not None:
            self._use_fix(usable)
        self._stopped.note_speed(self._global, now_us)
        imu_fresh = is_fresh(self._last_imu, self._config.max_imu_age_s, now_us)
        return self._local_odometry(now_us, imu_fresh), self._global_odometry(now_us, imu_fresh)

    def _predict_motion(self, samples: Sequence[ImuSample]) -> None:
        """Calibrate the gyro first; then predict both filters by these samples and correct them by compass and hull."""
        newest = samples[-1]
        if self._local is None:
            self._calibrate(samples)
            self._last_imu = newest
            return
        before_us = self._last_imu.source_us if self._last_imu else 0
        step_s = (newest.source_us - before_us) * 1e-6
        if _longest_gap_s(samples, before_us) > MAX_SAMPLE_GAP_S:
            self._bridge_imu_gap(step_s)
            step_s = NOMINAL_GAP_S * len(samples)
        self._last_imu = newest
        if newest.orientation_available:
            self._last_heading = newest
        ahead, left, yaw_rate = mean_level_motion(samples)
        self._rest.add_motion(MotionEvidence(newest.source_us, ahead, left, yaw_rate - float(self._local.x[B])))
        self._local.predict(yaw_rate, ahead, left, step_s)
        if newest.orientation_available:
            self._local.correct_yaw(newest.yaw_rad, YAW_STD_RAD, math.inf)
        self._local.correct_sideslip(LOCAL_SWAY_STD_MPS, LOCAL_SURGE_STD_MPS)
        if self._global is None or self._last_fix is None:
            return
        self._global.predict(yaw_rate, ahead, left, step_s, self._last_fix.position_std_m)
        if newest.orientation_available:
            self._correct_heading(self._global, newest.yaw_rad, step_s)
        if abs(yaw_rate - float(self._global.x[B])) < STRAIGHT_RADPS:
            self._global.correct_sideslip(SWAY_STD_MPS)
        if self._rest.is_moored:
            self._global.correct_velocity(0.0, 0.0, REST_STD_MPS, math.inf, is_course_known=False)
        elif self._rest.at_rest:
            self._global.correct_sideslip(REST_STD_MPS, REST_STD_MPS)

    def _correct_heading(self, global_filter: PlanarFilter, yaw_rad: float, step_s: float) -> None:
        """Correct with the compass; where it is refused for long, doubt heading and compass: the course decides.

        Where that does not reconcile them, which of the two is wrong is not known, nor is the heading, until it is
        accepted for as long as it was refused.
        """
        is_accepted = global_filter.correct_yaw(yaw_rad, YAW_STD_RAD, YAW_GATE2).is_accepted
        self._disagreement_s = clip(self._disagreement_s + (-step_s if is_accepted else step_s), 0.0, HEADING_DOUBT_S)
        if self._disagreement_s in {0.0, HEADING_DOUBT_S}:
            self._is_heading_doubted = self._disagreement_s > 0.0
        if is_accepted:
            self._compass_refused_s = 0.0
            return
        self._compass_refused_s += step_s
        if self._compass_refused_s >= COMPASS_DOUBT_S:
            global_filter.inflate_covariance(_std(psi=COMPASS_DOUBT_RAD, c=COMPASS_DOUBT_RAD))
            self._compass_refused_s = 0.0

    def _bridge_imu_gap(self, gap_s: float) -> None:
        """Widen both filters by what the boat may have done in a gap of the IMU."""
        speed_mps, turn_rad = UNSEEN_SPEED_MPS, min(UNSEEN_TURN_RADPS * gap_s, math.pi)
        for each in (self._local, self._global):
            if each is not None:
                each.inflate_covariance(_std(p=speed_mps * gap_s, psi=turn_rad, speed=speed_mps))
        self._rest = RestDetector(has_moved=self._rest.has_moved)
        self._accepted_fixes = min(self._accepted_fixes, CONVERGED_FIXES - REGAINED_FIXES)

    def _calibrate(self, samples: Sequence[ImuSample]) -> None:
        """Collect samples for `calibration_s`, then estimate the gyro's bias and start the local filter."""
        self._calibration += samples
        first, newest = self._calibration[0], self._calibration[-1]
        if (newest.source_us - first.source_us) * 1e-6 < self._config.calibration_s:
            return
        self._gyro_bias = estimate_gyro_bias(self._calibration)
        self._calibration.clear()
        x = np.zeros(SIZE)
        x[[PSI, B]] = newest.yaw_rad, self._gyro_bias.radps
        std = _std(p=0.01, psi=_initial_yaw_std_rad(newest), speed=0.2, b=self._gyro_bias.std_radps)
        self._local = PlanarFilter(x, std)

    def _use_fix(self, fix: GpsFix) -> None:
        """Start the global filter at the first fix; correct it by the position and speed of later ones."""
        if self._local is None or self._last_imu is None:
            return
        origin_deg = self._origin_deg or (fix.latitude_deg, fix.longitude_deg)
        x_m, y_m = enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *origin_deg)
        lag_s = (self._last_imu.source_us - fix.source_us) * 1e-6
        if math.hypot(x_m, y_m) > MAX_RANGE_M:
            self.drops["gps_far"] += 1
            return
        if abs(lag_s) > MAX_LAG_S:
            self.drops["gps_out_of_step"] += 1
            return
        self._origin_deg = origin_deg
        since_s = (fix.source_us - self._last_fix.source_us) * 1e-6 if self._last_fix else 0.0
        if since_s > self._config.max_gps_age_s:
            self._accepted_fixes = min(self._accepted_fixes, CONVERGED_FIXES - REGAINED_FIXES)
        self._position_doubt_m *= math.exp(-max(since_s, 0.0) / self._config.gps_wander_s)
        self._last_fix = fix
        vx_mps, vy_mps = fix.sog_mps * math.cos(fix.cog_rad), fix.sog_mps * math.sin(fix.cog_rad)
        std_m, std_mps = fix.position_std_m, max(fix.position_std_m * GPS_SPEED_PER_S, MIN_GPS_SPEED_STD_MPS)
        self._rest.add_fix(MapFix(fix.source_us, x_m, y_m, vx_mps, vy_mps, std_m, std_mps))
        if self._global is None:
            self._global = self._start_global(vx_mps, vy_mps, std_mps)
            self._restart_position(self._global, x_m, y_m, fix)
            return
        vx_now, vy_now = self._global.velocity
        x_m, y_m = x_m + vx_now * lag_s, y_m + vy_now * lag_s
        self._correct_position(self._global, x_m, y_m, fix)
        if not self._rest.is_moored:
            self._correct_speed(self._global, vx_mps, vy_mps, std_mps)

    def _correct_position(self, global_filter: PlanarFilter, x_m: float, y_m: float, fix: GpsFix) -> None:
        """Correct with a fix, or follow the receiver once enough refused fixes in a row agree with each other."""
        noise_m = fix.position_std_m * math.sqrt(self._noise_frac2)
        expected_x_m, expected_y_m, expected_std_m = global_filter.predicted_fix
        is_accepted, nis = global_filter.correct_position(x_m, y_m, noise_m, self._config.gate_mahalanobis2)
        self._nis = min(nis, 1e9)
        if is_accepted:
            off2_m2 = 0.5 * ((x_m - expected_x_m) ** 2 + (y_m - expected_y_m) ** 2)
            self._update_noise_frac((off2_m2 - expected_std_m**2) / fix.position_std_m**2)
            self._accepted_fixes, self._refused_fixes = self._accepted_fixes + 1, 0
            self._agreeing_refusals_m.clear()
            return
        self._refused_fixes += 1
        self._refused_total += 1
        refusals_m = self._agreeing_refusals_m
        if refusals_m and math.dist(refusals_m[-1], (x_m, y_m)) > 2.0 * fix.position_std_m + fix.sog_mps:
            refusals_m.clear()
        refusals_m.append((x_m, y_m))
        if len(refusals_m) > REFUSED_FIXES:
            self._position_doubt_m = max(self._position_doubt_m, math.hypot(x_m - expected_x_m, y_m - expected_y_m))
            self._restart_position(global_filter, x_m, y_m, fix)

    def _update_noise_frac(self, frac2: float) -> None:
        """Average in one fix's share of noise in the receiver's variance."""
        noise_frac2 = self._noise_frac2 + (frac2 - self._noise_frac2) / self._noise_fixes
        self._noise_frac2 = clip(noise_frac2, MIN_GPS_NOISE_FRAC**2, 1.0)
        self._noise_fixes = min(self._noise_fixes + 1, MAX_NOISE_FIXES)

    def _correct_speed(self, global_filter: PlanarFilter, vx_mps: float, vy_mps: float, std_mps: float) -> None:
        """Correct with the speed of a fix; where several in a row are refused, doubt the speed."""
        is_course_known = math.hypot(*global_filter.velocity) >= COURSE_MPS
        gate2 = self._config.gate_mahalanobis2
        result = global_filter.correct_velocity(vx_mps, vy_mps, std_mps, gate2, is_course_known=is_course_known)
        if result.is_accepted:
            self._refused_speeds = 0
            return
        self._refused_speeds += 1
        if self._refused_speeds >= DOUBTFUL_FIXES:
            global_filter.inflate_covariance(_std(speed=SPEED_DOUBT_MPS))
            self._refused_speeds = 0

    def _start_global(self, vx_mps: float, vy_mps: float, std_mps: float) -> PlanarFilter:
        assert self._local is not None
        assert self._last_imu is not None
        yaw_rad = float(self._local.x[PSI])
        x = np.zeros(SIZE)
        x[[PSI, B]] = yaw_rad, self._gyro_bias.radps
        x[U] = vx_mps * math.cos(yaw_rad) + vy_mps * math.sin(yaw_rad)
        std = _std(psi=_initial_yaw_std_rad(self._last_imu), speed=0.2 + std_mps, b=self._gyro_bias.std_radps)
        std[[C, WX, WY]] = COMPASS_BIAS_STD_RAD, 0.3, 0.3
        return PlanarFilter(x, std, self._config.gps_wander_s)

    def _restart_position(self, global_filter: PlanarFilter, x_m: float, y_m: float, fix: GpsFix) -> None:
        """Start the position anew at this fix; it is not healthy before more fixes agree."""
        global_filter.reset_position(x_m, y_m, fix.position_std_m, fix.position_std_m * math.sqrt(self._noise_frac2))
        self._agreeing_refusals_m.clear()
        self._accepted_fixes = self._refused_fixes = 0

    def _local_odometry(self, now_us: int, imu_fresh: bool) -> Odometry:
        if self._local is None:
            return unknown_odometry(now_us)
        return self._odometry(self._local, now_us, healthy=imu_fresh)

    def _global_odometry(self, now_us: int, imu_fresh: bool) -> Odometry:
        if self._global is None or self._last_fix is None or self._origin_deg is None:
            return unknown_odometry(now_us)
        odometry = self._odometry(self._global, now_us, healthy=imu_fresh)
        spread_m = max(odometry.position_std_m, self._last_fix.position_std_m)
        position_std_m = math.hypot(spread_m, self._position_doubt_m / math.sqrt(2.0))
        healthy = (
            odometry.healthy
            and is_fresh(self._last_heading, COMPASS_AGE_S, now_us)
            and not self._is_heading_doubted
            and abs(wrap_rad(float(self._global.x[C]))) <= MAX_COMPASS_BIAS_RAD
            and is_fresh(self._last_fix, self._config.max_gps_age_s, now_us)
            and self._accepted_fixes >= CONVERGED_FIXES
            and self._refused_fixes < DOUBTFUL_FIXES
            and position_std_m <= self._config.max_position_std_m
            and odometry.yaw_std_rad <= self._config.max_yaw_std_rad
        )
        latitude_deg, longitude_deg = geodetic_from_enu(odometry.x_m, odometry.y_m, *self._origin_deg)
        return msgspec.structs.replace(
            with_position_std(odometry, position_std_m),
            healthy=healthy,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            nis=self._nis,
            refused_fixes=self._refused_total,
        )

    def _odometry(self, source: PlanarFilter, now_us: int, *, healthy: bool) -> Odometry:
        return odometry_of(source, self._last_imu, now_us, healthy=healthy, stopped=self._stopped.is_set(now_us))


def _longest_gap_s(samples: Sequence[ImuSample], before_us: int) -> float:
    """The longest time between two samples in a row, the one before them included."""
    times_us = (before_us, *(each.source_us for each in samples))
    return max(later - earlier for earlier, later in itertools.pairwise(times_us)) * 1e-6


def _initial_yaw_std_rad(sample: ImuSample) -> float:
    return YAW_STD_RAD if sample.orientation_available else math.pi


def _std(
    p: float = 0.0, psi: float = 0.0, speed: float = 0.0, b: float = 0.0, c: float = 0.0
) -> npt.NDArray[np.float64]:
    """Standard deviations of a state (11,): position, yaw, surge and sway alike, gyro bias, compass bias."""
    std = np.zeros(SIZE)
    std[[PX, PY, PSI, U, V, B, C]] = p, p, psi, speed, speed, b, c
    return std
