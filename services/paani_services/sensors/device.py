"""What is known of one device: its bytes, frames, rate and age, and the status that follows. Pure."""

import math
from collections import Counter, deque

from paani.messages import SensorDevice, SensorRole, SensorStatus

RATE_WINDOW_S = 5.0  # over which the rate of data is counted
SHORTEST_SPAN_S = 0.5  # data that come in one piece show no rate
# Without a byte: every device speaks once a second at least, but a receiver that no vessel is near.
SILENT_S = {
    SensorRole.GPS: 2.0,
    SensorRole.IMU: 2.0,
    SensorRole.HEADING: 2.0,
    SensorRole.AIS: math.inf,
    SensorRole.LIDAR: 2.0,
    SensorRole.SONAR: 3.0,
}
UNREADABLE_S = 2.0  # with bytes, and without an intact frame
# Without usable data; the estimate gives up no later (`LocalizationConfig.max_gps_age_s` and its kind).
LATE_S = {
    SensorRole.GPS: 3.0,
    SensorRole.IMU: 0.5,
    SensorRole.HEADING: 3.0,
    SensorRole.AIS: math.inf,
    SensorRole.LIDAR: 1.0,
    SensorRole.SONAR: 3.0,
}
NEVER_AGE_S = 1e6  # of data that never came, as in the health reports
KINDS_SHOWN = 12
NEEDED = {
    SensorRole.GPS: "no position (RMC, or GLL with VTG, or UBX NAV-PVT)",
    SensorRole.IMU: "no sample (PQTMIMU or VNYMR)",
    SensorRole.HEADING: "no heading (HDT, THS, HDG or HDM)",
    SensorRole.AIS: "no position report (VDM)",
    SensorRole.LIDAR: "no whole turn: does it turn freely?",
    SensorRole.SONAR: "no sounding (DPT or DBT)",
}


class Line:
    """Bytes and frames of one line; devices that share the line share these counts."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.problem = "not opened yet"  # why it is not open; "" while it is
        self.bytes = self.frames = self.checksum_failures = self.damaged = 0
        self.openings = 0
        self.kinds = Counter[str]()
        self.foreign = ""  # protocol of intact frames that the settings exclude
        self.last_byte_us = self.last_frame_us = 0

    def opened(self, now_us: int) -> None:
        """It is open; ages count from now."""
        self.problem, self.foreign = "", ""
        self.openings += 1
        self.last_byte_us = self.last_frame_us = now_us
        self.kinds.clear()

    def lost(self, problem: str) -> None:
        """It cannot be opened, or is gone."""
        self.problem = problem


class Device:
    """One role on a line: counts its usable data, and says what is wrong."""

    def __init__(self, role: SensorRole, line: Line | None) -> None:
        self.role, self.line = role, line
        self.frozen_cause = self.implausible_cause = ""
        self.problem = ""  # why the newest data were not usable
        self.has_fix = True
        self.withheld = 0
        self._times_us = deque[int]()

    def reset(self) -> None:
        """Its line was opened anew: what was wrong before may be over."""
        self.frozen_cause = self.implausible_cause = self.problem = ""
        self.has_fix = True
        self._times_us.clear()

    def count_data(self, now_us: int) -> None:
        """Something usable was published."""
        self.problem = ""
        self._times_us.append(now_us)
        while now_us - self._times_us[0] > RATE_WINDOW_S * 1e6:
            self._times_us.popleft()

    def report(self, now_us: int) -> SensorDevice:
        """The device as `sensors/state` shows it."""
        line = self.line
        if line is None:
            return SensorDevice(role=self.role, line="", status=SensorStatus.OFF, age_s=NEVER_AGE_S)
        status, note = self._status(line, now_us)
        return SensorDevice(
            role=self.role,
            line=line.address,
            status=status,
            note=note,
            rate_hz=self._rate_hz(now_us),
            age_s=self._age_s(now_us),
            bytes=line.bytes,
            frames=line.frames,
            heard=" ".join(sorted(line.kinds)[:KINDS_SHOWN])[:400],
            checksum_failures=line.checksum_failures,
            damaged=line.damaged,
            withheld=self.withheld,
            reconnections=max(line.openings - 1, 0),
        )

    def _status(self, line: Line, now_us: int) -> tuple[SensorStatus, str]:
        silent_s, unread_s = (now_us - line.last_byte_us) * 1e-6, (line.last_byte_us - line.last_frame_us) * 1e-6
        if line.problem:
            return SensorStatus.ABSENT, line.problem
        if silent_s > SILENT_S[self.role]:
            return SensorStatus.SILENT, f"open, but no byte for {silent_s:.0f} s: check power and wiring"
        if unread_s > UNREADABLE_S:
            if line.foreign:
                return SensorStatus.UNREADABLE, f"speaks {line.foreign}, which sensors.gps.protocol leaves out"
            wanted = "no LDROBOT packets" if self.role is SensorRole.LIDAR else "neither NMEA nor UBX"
            return SensorStatus.UNREADABLE, f"bytes that are {wanted}: another baud rate or protocol?"
        if self.frozen_cause:
            return SensorStatus.FROZEN, self.frozen_cause
        if self.implausible_cause:
            return SensorStatus.IMPLAUSIBLE, self.implausible_cause
        if self._age_s(now_us) > LATE_S[self.role]:
            return SensorStatus.INCOMPLETE, self.problem or NEEDED[self.role]
        if not self.has_fix:
            return SensorStatus.NO_FIX, "the receiver has no position"
        return SensorStatus.OK, ""

    def _rate_hz(self, now_us: int) -> float:
        """Data a second, by the time between the first and the last of the window."""
        recent_us = [each_us for each_us in self._times_us if now_us - each_us <= RATE_WINDOW_S * 1e6]
        if len(recent_us) < 2:
            return len(recent_us) / RATE_WINDOW_S
        return (len(recent_us) - 1) / max((recent_us[-1] - recent_us[0]) * 1e-6, SHORTEST_SPAN_S)

    def _age_s(self, now_us: int) -> float:
        return max((now_us - self._times_us[-1]) * 1e-6, 0.0) if self._times_us else NEVER_AGE_S
