"""Channel coordinates: `along_m` down a centre line, `left_m` to its left."""

import numpy as np
import numpy.typing as npt

from paani.arrays import F64
from paani_sim.worlds.curves import normals_left
from paani_sim.worlds.world import Pose2


class Channel:
    """A centre line `centre_m` `(n, 2)` and half the width there `(n,)`, both at `along_m` `(n,)`, rising."""

    def __init__(self, along_m: npt.NDArray[np.float64], centre_m: F64, half_width_m: npt.NDArray[np.float64]) -> None:
        self._along_m = along_m
        self._half_width_m = half_width_m
        self._left = normals_left(centre_m, closed=False)
        self.centre_m = centre_m

    def half_width_m(self, along_m: float) -> float:
        """Half of the channel's width there."""
        return float(np.interp(along_m, self._along_m, self._half_width_m))

    def pose_at(self, along_m: float, left_m: float, turn_rad: float = 0.0) -> Pose2:
        """Pose in the map, heading down the channel plus `turn_rad`."""
        centre = [np.interp(along_m, self._along_m, self.centre_m[:, k]) for k in (0, 1)]
        left = np.array([np.interp(along_m, self._along_m, self._left[:, k]) for k in (0, 1)])
        left /= np.hypot(*left)
        x_m, y_m = centre + left_m * left
        yaw_rad = float(np.arctan2(-left[0], left[1])) + turn_rad
        return Pose2(float(x_m), float(y_m), yaw_rad)

    def bank(self, along_m: float, side: float, out_m: float, turn_rad: float = 0.0) -> Pose2:
        """`out_m` beyond the water's edge on the `side` (+1 left, -1 right; negative: afloat)."""
        return self.pose_at(along_m, side * (self.half_width_m(along_m) + out_m), turn_rad)

    def shore_m(self) -> F64:
        """The water's edge as one closed polygon, counter-clockwise, every third sample."""
        pick = np.arange(0, len(self._along_m), 3)
        offset = self._left[pick] * self._half_width_m[pick, None]
        right, left = self.centre_m[pick] - offset, self.centre_m[pick] + offset
        return np.vstack([right, left[::-1]])

    def lane_m(self, first_m: float, last_m: float, lane_frac: float) -> F64:
        """A line down (or up) the channel at `lane_frac` of its width left of the centre."""
        step = 1.0 if last_m > first_m else -1.0
        return np.array(
            [
                self.pose_at(along_m, 2.0 * lane_frac * self.half_width_m(along_m))[:2]
                for along_m in np.arange(first_m, last_m + 0.5 * step, step)
            ]
        )

    def loop_m(self, first_m: float, last_m: float, lane_frac: float) -> F64:
        """Down the channel on the starboard side and back on the other, with round ends."""
        turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)[1:-1]

        def half_turn(along_m: float, toward: float) -> F64:
            reach_m = 2.0 * lane_frac * self.half_width_m(along_m)
            return np.array(
                [
                    self.pose_at(along_m + toward * 0.8 * reach_m * np.cos(a), toward * reach_m * np.sin(a))[:2]
                    for a in turn
                ]
            )

        return np.vstack(
            [
                self.lane_m(first_m, last_m, -lane_frac),
                half_turn(last_m, 1.0),
                self.lane_m(last_m, first_m, lane_frac),
                half_turn(first_m, -1.0),
            ]
        )
