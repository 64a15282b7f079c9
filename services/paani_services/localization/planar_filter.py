"""Planar extended Kalman filter of a boat with gyro, accelerometer, compass and GPS.

State x = [px, py, psi, u, v, b, gx, gy, c, wx, wy]: map position [m], yaw [rad], surge and sway through the water
[m/s], gyro bias [rad/s], slow error of the GPS position [m], compass bias [rad], drift of the water in the map [m/s].
The slow GPS error and the drift of the water are first-order Gauss-Markov processes, the biases random walks.
The update is filterpy's; this is the only file that imports filterpy, because the import takes seconds.
"""

import math
from typing import NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from paani.arrays import F64
from paani.geometry import wrap_rad

PX, PY, PSI, U, V, B, GX, GY, C, WX, WY = range(11)
SIZE = 11
_IDENTITY = np.eye(SIZE)
LOCAL_STATES_N = 6  # states of a filter without GPS and compass bias; the rest describe GPS, compass and water

# Standard deviations of the process noise, per square root second unless a time constant follows.
POSITION_STD_M = 0.01  # motion that the planar model leaves out
GYRO_STD_RADPS = 0.01  # noise of the yaw rate, integrated to yaw
ACCEL_STD_MPS2 = 0.05  # what the levelled accelerometer misses: 0.3 degrees of tilt
BIAS_STD_RADPS = 2e-4  # random walk of the gyro bias
COMPASS_STD_RAD = 2e-4  # random walk of the compass bias
DRIFT_STD_MPS = 0.3  # in the long run: currents of rivers, and the leeway that wind gives a small hull
DRIFT_TIME_S = 300.0  # time constant of that drift


class CorrectionResult(NamedTuple):
    """`nis`: normalised innovation squared. `is_accepted`: it lay within the validation gate."""

    is_accepted: bool
    nis: float


class PlanarFilter:
    """Predicts with gyro and accelerometer; corrects with the measurements that the caller has."""

    def __init__(self, x: F64, std: F64, gps_wander_s: float = 60.0) -> None:
        """Start at state `x` (11,) with standard deviations `std` (11,).

        The yaw at start came from the compass, so its error and the compass bias are correlated.
        Where `std` is zero from `LOCAL_STATES_N` on, there is no GPS to describe, and those states stay as they are.
        """
        self._ekf = ExtendedKalmanFilter(dim_x=SIZE, dim_z=2)
        self._ekf.x = np.array(x, dtype=np.float64)
        self._ekf.P = np.diag(np.square(std))
        self._ekf.P[PSI, PSI] += std[C] ** 2
        self._ekf.P[PSI, C] = self._ekf.P[C, PSI] = -(std[C] ** 2)
        self._gps_wander_s = gps_wander_s
        self._has_gps = bool(np.any(np.asarray(std[LOCAL_STATES_N:]) > 0.0))
        self._jacobian = np.eye(SIZE)
        self._process_noise_matrix = np.zeros((SIZE, SIZE))

    @property
    def x(self) -> F64:
        """State (11,)."""
        return np.asarray(self._ekf.x)

    @property
    def std(self) -> F64:
        """Standard deviation of each state (11,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def covariance(self) -> F64:
        """Covariance of the state (11, 11), symmetric."""
        return np.asarray(self._ekf.P)

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity over ground in the map frame [m/s]."""
        _, _, psi, u, v, *_, wx, wy = self._ekf.x.tolist()
        sin, cos = math.sin(psi), math.cos(psi)
        return u * cos - v * sin + wx, u * sin + v * cos + wy

    @property
    def predicted_fix(self) -> tuple[float, float, float]:
        """Predicted position of the next fix [m], and its standard deviation without the receiver's noise."""
        p = self._ekf.P
        variance = p[PX, PX] + p[PY, PY] + p[GX, GX] + p[GY, GY] + 2.0 * (p[PX, GX] + p[PY, GY])
        x = self._ekf.x.tolist()
        return x[PX] + x[GX], x[PY] + x[GY], math.sqrt(max(0.5 * float(variance), 0.0))

    def predict(
        self, yaw_rate_radps: float, ahead_mps2: float, left_mps2: float, step_s: float, gps_std_m: float = 0.0
    ) -> None:
        """Advance by `step_s` with the measured yaw rate and level acceleration along body axes.

        `gps_std_m`: standard deviation of the receiver's slow error in the long run.
        """
        px, py, psi, u, v, b, gx, gy, c, wx, wy = self._ekf.x.tolist()
        rate = yaw_rate_radps - b
        sin, cos = math.sin(psi), math.cos(psi)
        vx, vy = u * cos - v * sin, u * sin + v * cos
        gps_decay = math.exp(-step_s / self._gps_wander_s)
        drift_decay = math.exp(-step_s / DRIFT_TIME_S)
        self._ekf.x = np.array([
            px + (vx + wx) * step_s,
            py + (vy + wy) * step_s,
            wrap_rad(psi + rate * step_s),
            u + (ahead_mps2 + rate * v) * step_s,
            v + (left_mps2 - rate * u) * step_s,
            b,
            gx * gps_decay,
            gy * gps_decay,
            c,
            wx * drift_decay,
            wy * drift_decay,
        ])  # fmt: skip
        f = self._jacobian
        f[PX, PSI], f[PX, U], f[PX, V], f[PX, WX] = -vy * step_s, cos * step_s, -sin * step_s, step_s
        f[PY, PSI], f[PY, U], f[PY, V], f[PY, WY] = vx * step_s, sin * step_s, cos * step_s, step_s
        f[PSI, B] = -step_s
        f[U, V], f[U, B] = rate * step_s, -v * step_s
        f[V, U], f[V, B] = -rate * step_s, u * step_s
        f[GX, GX] = f[GY, GY] = gps_decay
        f[WX, WX] = f[WY, WY] = drift_decay
        self._ekf.P = f @ self._ekf.P @ f.T + self._process_noise(step_s, gps_std_m, gps_decay, drift_decay)

    def correct_position(self, x_m: float, y_m: float, std_m: float, gate2: float) -> CorrectionResult:
        """Correct with a GPS position: the sum of the boat's position and the receiver's slow error."""
        expected_x_m, expected_y_m, _ = self.predicted_fix
        jacobian = np.zeros((2, SIZE))
        jacobian[0, PX] = jacobian[0, GX] = jacobian[1, PY] = jacobian[1, GY] = 1.0
        return self._correct(np.array([x_m - expected_x_m, y_m - expected_y_m]), jacobian, std_m, gate2)

    def correct_velocity(
        self, vx_mps: float, vy_mps: float, std_mps: float, gate2: float, *, is_course_known: bool = True
    ) -> CorrectionResult:
        """Correct with a velocity over ground in the map frame. `is_course_known` false: it corrects no heading."""
        _, _, psi, u, v, *_ = self._ekf.x.tolist()
        sin, cos = math.sin(psi), math.cos(psi)
        predicted_x, predicted_y = self.velocity
        jacobian = np.zeros((2, SIZE))
        jacobian[0, U], jacobian[0, V], jacobian[0, WX] = cos, -sin, 1.0
        jacobian[1, U], jacobian[1, V], jacobian[1, WY] = sin, cos, 1.0
        if is_course_known:
            jacobian[0, PSI], jacobian[1, PSI] = -u * sin - v * cos, u * cos - v * sin
        return self._correct(np.array([vx_mps - predicted_x, vy_mps - predicted_y]), jacobian, std_mps, gate2)

    def correct_yaw(self, yaw_rad: float, std_rad: float, gate2: float) -> CorrectionResult:
        """Correct with a compass heading, compared around the circle."""
        x = self._ekf.x
        jacobian = np.zeros((1, SIZE))
        jacobian[0, PSI] = jacobian[0, C] = 1.0
        return self._correct(np.array([wrap_rad(yaw_rad - float(x[PSI] + x[C]))]), jacobian, std_rad, gate2)

    def correct_sideslip(self, sway_std_mps: float, surge_std_mps: float | None = None) -> None:
        """Correct with what is known of any hull: its sway is about zero.

        `surge_std_mps`: take the surge as about zero too, for want of a measurement of it.
        """
        known = [V] if surge_std_mps is None else [V, U]
        std = np.array([sway_std_mps, surge_std_mps or 0.0][: len(known)])
        self._correct(-self._ekf.x[known], _IDENTITY[known], std, math.inf)

    def reset_position(self, x_m: float, y_m: float, std_m: float, noise_m: float) -> None:
        """Start the position anew at a fix with slow error `std_m` and white noise `noise_m`; keep all other states."""
        reset = [PX, PY, GX, GY]
        self._ekf.x[reset] = (x_m, y_m, 0.0, 0.0)
        self._ekf.P[reset, :] = 0.0
        self._ekf.P[:, reset] = 0.0
        self._ekf.P[reset, reset] = std_m**2
        self._ekf.P[[PX, PY], [PX, PY]] += noise_m**2
        self._ekf.P[[PX, PY], [GX, GY]] = self._ekf.P[[GX, GY], [PX, PY]] = -(std_m**2)

    def inflate_covariance(self, std: F64) -> None:
        """Add `std` (11,) to the standard deviation of each state, in quadrature."""
        self._ekf.P = self._ekf.P + np.diag(np.square(std))

    def _process_noise(self, step_s: float, gps_std_m: float, gps_decay: float, drift_decay: float) -> F64:
        """Process noise of one step (11, 11)."""
        diagonal = [
            POSITION_STD_M**2 * step_s,
            POSITION_STD_M**2 * step_s,
            GYRO_STD_RADPS**2 * step_s,
            ACCEL_STD_MPS2**2 * step_s,
            ACCEL_STD_MPS2**2 * step_s,
            BIAS_STD_RADPS**2 * step_s,
        ]
        if self._has_gps:
            gps_m2 = gps_std_m**2 * (1.0 - gps_decay * gps_decay)
            water_m2ps2 = DRIFT_STD_MPS**2 * (1.0 - drift_decay * drift_decay)
            diagonal += [gps_m2, gps_m2, COMPASS_STD_RAD**2 * step_s, water_m2ps2, water_m2ps2]
        np.fill_diagonal(self._process_noise_matrix, diagonal + [0.0] * (SIZE - len(diagonal)))
        return self._process_noise_matrix

    def _correct(self, residual: F64, jacobian: F64, std: float | F64, gate2: float) -> CorrectionResult:
        """One update, unless the normalised innovation squared exceeds the validation gate `gate2`."""
        measurement_noise = _IDENTITY[: len(residual), : len(residual)] * std**2
        if math.isfinite(gate2):
            nis = float(residual @ np.linalg.solve(jacobian @ self._ekf.P @ jacobian.T + measurement_noise, residual))
            if not nis <= gate2:
                return CorrectionResult(False, nis)
        else:
            nis = 0.0
        self._ekf.dim_z = len(residual)
        self._ekf.update(
            residual,
            HJacobian=lambda _: jacobian,
            Hx=lambda _: 0.0,
            R=measurement_noise,
            residual=lambda measured, _: measured,
        )
        self._ekf.x[PSI] = wrap_rad(float(self._ekf.x[PSI]))
        self._ekf.P = 0.5 * (self._ekf.P + self._ekf.P.T)
        return CorrectionResult(True, nis)
