"""The states of a drive."""

from enum import StrEnum


class DrivePhase(StrEnum):
    """READY: disarmed, until nothing but arming keeps the boat from going. RUNNING: armed."""

    READY = "ready"
    RUNNING = "running"
    FINISHED = "finished"


class DriveOutcome(StrEnum):
    """How a drive ended. Only COMPLETED is a success; touching something does not end a drive.

    STALLED: two minutes without progress along the route. NOT_READY: the boat was never ready to be armed.
    """

    NONE = "none"
    COMPLETED = "completed"
    TIME_LIMIT = "time_limit"
    STALLED = "stalled"
    DIVERGED = "diverged"
    NOT_READY = "not_ready"
