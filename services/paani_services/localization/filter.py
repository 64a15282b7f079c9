"""A planar extended Kalman filter. The only file that imports filterpy, which takes seconds.

State x = [px, py, psi, u, v, b]: map position [m], yaw [rad], surge and sway [m/s], gyro bias [rad/s].
"""

import math

import numpy as np
import numpy.typing as npt
from filterpy.kalman import ExtendedKalmanFilter

from paani.geometry import wrap_rad

Array = npt.NDArray[np.float64]

PX, PY, PSI, U, V, B = range(6)
ACCEL_STD_MPS2 = 0.08  # what the averaged, levelled accelerometer misses, per square root second
GYRO_STD_RADPS = 0.01
BIAS_STD_RADPS = 2e-4
POSITION_STD_M = 0.02


class PlanarFilter:
    """Predicts with gyro and accelerometer; corrects with whatever the caller has."""

    def __init__(self, x: Array, std: Array) -> None:
        """Start at state `x` (6,) with standard deviations `std` (6,)."""
        self._ekf = ExtendedKalmanFilter(dim_x=6, dim_z=2)
        self._ekf.x = np.array(x, dtype=np.float64)
        self._ekf.P = np.diag(np.square(std))

    @property
    def x(self) -> Array:
        """State (6,)."""
        return np.asarray(self._ekf.x)

    @property
    def std(self) -> Array:
        """Standard deviation of each state (6,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def covariance(self) -> Array:
        """Covariance of the state (6, 6)."""
        return np.asarray(self._ekf.P)

    def predict(self, yaw_rate_radps: float, ahead_mps2: float, left_mps2: float, step_s: float) -> None:
        """Advance by `step_s` with the measured yaw rate and level acceleration along body axes."""
        px, py, psi, u, v, b = self._ekf.x.tolist()
        rate = yaw_rate_radps - b
        sin, cos = math.sin(psi), math.cos(psi)
        self._ekf.x = np.array(
            [
                px + (u * cos - v * sin) * step_s,
                py + (u * sin + v * cos) * step_s,
                wrap_rad(psi + rate * step_s),
                u + (ahead_mps2 + rate * v) * step_s,
                v + (left_mps2 - rate * u) * step_s,
                b,
            ]
        )
        jacobian = np.eye(6)
        jacobian[PX, PSI], jacobian[PX, U], jacobian[PX, V] = (
            -(u * sin + v * cos) * step_s,
            cos * step_s,
            -sin * step_s,
        )
        jacobian[PY, PSI], jacobian[PY, U], jacobian[PY, V] = (
            (u * cos - v * sin) * step_s,
            sin * step_s,
            cos * step_s,
        )
        jacobian[PSI, B] = -step_s
        jacobian[U, V], jacobian[U, B] = rate * step_s, -v * step_s
        jacobian[V, U], jacobian[V, B] = -rate * step_s, u * step_s
        noise_std = [
            POSITION_STD_M,
            POSITION_STD_M,
            GYRO_STD_RADPS,
            ACCEL_STD_MPS2,
            ACCEL_STD_MPS2,
            BIAS_STD_RADPS,
        ]
        noise = np.diag(np.square(noise_std) * step_s)
        self._ekf.P = jacobian @ self._ekf.P @ jacobian.T + noise

    def correct_position(self, x_m: float, y_m: float, std_m: float, gate2: float) -> bool:
        """GPS position; False if it lies outside the gate and was refused."""
        jacobian = np.zeros((2, 6))
        jacobian[0, PX] = jacobian[1, PY] = 1.0
        predicted = self._ekf.x[:2]
        return self._correct(np.array([x_m, y_m]), predicted, jacobian, std_m, gate2)

    def correct_velocity(self, vx_mps: float, vy_mps: float, std_mps: float, gate2: float) -> bool:
        """GPS velocity in the map frame; False if refused."""
        _, _, psi, u, v, _ = self._ekf.x.tolist()
        sin, cos = math.sin(psi), math.cos(psi)
        predicted = np.array([u * cos - v * sin, u * sin + v * cos])
        jacobian = np.zeros((2, 6))
        jacobian[0, PSI], jacobian[0, U], jacobian[0, V] = -predicted[1], cos, -sin
        jacobian[1, PSI], jacobian[1, U], jacobian[1, V] = predicted[0], sin, cos
        return self._correct(np.array([vx_mps, vy_mps]), predicted, jacobian, std_mps, gate2)

    def correct_yaw(self, yaw_rad: float, std_rad: float, gate2: float) -> bool:
        """Compass heading, compared around the circle; False if refused."""
        return self._correct_state(PSI, yaw_rad, std_rad, gate2)

    def correct_surge(self, surge_mps: float, std_mps: float) -> None:
        """A belief about the speed ahead, for want of a measurement."""
        self._correct_state(U, surge_mps, std_mps, math.inf)

    def correct_sway(self, sway_mps: float, std_mps: float) -> None:
        """A hull goes where it points: sway is about zero."""
        self._correct_state(V, sway_mps, std_mps, math.inf)

    def _correct_state(self, index: int, value: float, std: float, gate2: float) -> bool:
        jacobian = np.zeros((1, 6))
        jacobian[0, index] = 1.0
        return self._correct(
            np.array([value]),
            self._ekf.x[index : index + 1],
            jacobian,
            std,
            gate2,
            circular=index == PSI,
        )

    def _correct(
        self,
        z: Array,
        predicted: Array,
        jacobian: Array,
        std: float,
        gate2: float,
        *,
        circular: bool = False,
    ) -> bool:
        """One update unless the squared Mahalanobis distance of the innovation exceeds `gate2`."""
        residual = z - predicted
        if circular:
            residual = np.array([wrap_rad(float(residual[0]))])
        covariance = jacobian @ self._ekf.P @ jacobian.T + np.eye(len(z)) * std**2
        if float(residual @ np.linalg.solve(covariance, residual)) > gate2:
            return False
        self._ekf.dim_z = len(z)
        self._ekf.update(
            z,
            HJacobian=lambda _: jacobian,
            Hx=lambda _: predicted,
            R=std**2,
            residual=lambda *_: residual,
        )
        self._ekf.x[PSI] = wrap_rad(float(self._ekf.x[PSI]))
        return True
