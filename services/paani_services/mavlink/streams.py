"""How often each message goes to one ground station. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from paani_services.mavlink.codec import HEARTBEAT, dialect
from paani_services.mavlink.telemetry import BUILDERS

MIN_INTERVAL_US = 20_000  # 50 Hz, the rate at which this process looks
DISABLED = -1
MISSION_CURRENT = dialect.MAVLINK_MSG_ID_MISSION_CURRENT

# 68 messages a second fill the telemetry of MAVSDK.
DEFAULT_INTERVALS_US: Mapping[int, int] = {
    HEARTBEAT: 1_000_000,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 1_000_000,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1_000_000,
    MISSION_CURRENT: 1_000_000,
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: 1_000_000,
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: 200_000,
    dialect.MAVLINK_MSG_ID_VFR_HUD: 200_000,
    dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 500_000,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 100_000,
    dialect.MAVLINK_MSG_ID_ATTITUDE: 100_000,
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 100_000,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 100_000,
    dialect.MAVLINK_MSG_ID_HOME_POSITION: 2_000_000,
    dialect.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: 1_000_000,
    dialect.MAVLINK_MSG_ID_COLLISION: 1_000_000,
}
STREAMED = frozenset(BUILDERS) | {MISSION_CURRENT}


class Schedule:
    """When each message is due. Late ones are not made up for."""

    def __init__(self) -> None:
        self._intervals_us = dict(DEFAULT_INTERVALS_US)
        self._due_us: dict[int, int] = {}

    def due(self, now_us: int) -> list[int]:
        """Messages to send now, by id."""
        found = []
        for message_id, interval_us in self._intervals_us.items():
            due_us = self._due_us.get(message_id, now_us)
            if now_us >= due_us:
                found.append(message_id)
                self._due_us[message_id] = max(due_us + interval_us, now_us)
            elif due_us - now_us > interval_us:  # the clock was set back
                self._due_us[message_id] = now_us + interval_us
        return found

    def interval_us(self, message_id: int) -> int:
        """As MESSAGE_INTERVAL says it: -1 for what is not sent by itself, 0 for what is not known."""
        return self._intervals_us.get(message_id, DISABLED) if message_id in STREAMED else 0

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Take what a station asks for: 0 is the default, below 0 none. False where it is refused.

        The heartbeat goes on in any case: by it a station knows that the boat is there.
        """
        if message_id not in STREAMED or not interval_us <= 1e9:
            return False
        if interval_us < 0:
            if message_id == HEARTBEAT:
                return False
            self._intervals_us.pop(message_id, None)
        elif interval_us == 0:
            self._intervals_us.pop(message_id, None)
            if message_id in DEFAULT_INTERVALS_US:
                self._intervals_us[message_id] = DEFAULT_INTERVALS_US[message_id]
        else:
            self._intervals_us[message_id] = max(MIN_INTERVAL_US, round(interval_us))
        self._due_us.pop(message_id, None)
        return True
