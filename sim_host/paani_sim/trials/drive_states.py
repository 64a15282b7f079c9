"""The states of a drive."""

from enum import StrEnum


class DrivePhase(StrEnum):
    """READY waits, disarmed, until the boat could go; RUNNING is armed."""

    READY = "ready"
    RUNNING = "running"
    FINISHED = "finished"


class DriveOutcome(StrEnum):
    """How a drive ended. Only COMPLETED is a success; touching something does not end a drive.

    STALLED: two minutes without progress along the route.
    """

    NONE = "none"
    COMPLETED = "completed"
    TIME_LIMIT = "time_limit"
    STALLED = "stalled"
    DIVERGED = "diverged"
    NOT_READY = "not_ready"
