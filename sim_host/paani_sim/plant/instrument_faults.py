"""Effects of a scenario's faults on sensors and fans. Pure; the sensors' noise is the same with and without."""

from paani.geometry import wrap_rad
from paani_sim.plant.dynamics import Fans
from paani_sim.plant.sensors import GpsReading, ImuReading, Truth
from paani_sim.worlds.faults import Fault, FaultKind, find_active_fault

Faults = tuple[Fault, ...]


def apply_gps_jump(truth: Truth, faults: Faults, t_s: float) -> Truth:
    """Shift the true position by a GPS jump."""
    jump = find_active_fault(faults, FaultKind.GPS_JUMP, t_s)
    return truth._replace(x_m=truth.x_m + jump.amount) if jump else truth


def apply_gps_outage(reading: GpsReading, last: GpsReading, faults: Faults, t_s: float) -> GpsReading:
    """During an outage: no fix, no speed, and the `last` position."""
    if find_active_fault(faults, FaultKind.GPS_OUTAGE, t_s) is None:
        return reading
    return last._replace(sog_mps=0.0, cog_rad=0.0, fix=False)


def apply_imu_bias(reading: ImuReading, faults: Faults, t_s: float) -> ImuReading:
    """Add the biases of compass and gyro faults."""
    compass = find_active_fault(faults, FaultKind.COMPASS_BIAS, t_s)
    gyro = find_active_fault(faults, FaultKind.GYRO_BIAS, t_s)
    if compass:
        reading = reading._replace(yaw_rad=wrap_rad(reading.yaw_rad + compass.amount))
    if gyro:
        roll, pitch, yaw = reading.rates_radps
        reading = reading._replace(rates_radps=(roll, pitch, yaw + gyro.amount))
    return reading


def apply_thruster_loss(fans: Fans, faults: Faults, t_s: float) -> Fans:
    """Reduce the force of a thruster that has failed in part."""
    loss = find_active_fault(faults, FaultKind.THRUSTER_LOSS, t_s)
    if loss is None:
        return fans
    left, right = max(loss.amount, 0.0), max(-loss.amount, 0.0)
    return Fans((1.0 - min(left, 1.0)) * fans.left_n, (1.0 - min(right, 1.0)) * fans.right_n)
