"""Names that topics had, so that recordings from before still replay."""

from __future__ import annotations

from paani import keys

RENAMED_TOPICS = {"plant/gps": keys.GPS.name, "plant/imu": keys.IMU.name}  # earlier names, and their present ones


def present_name(name: str) -> str:
    """The present name of a topic, or of a channel below it, that may carry an earlier one."""
    for earlier, present in RENAMED_TOPICS.items():
        if name == earlier or name.startswith(f"{earlier}/"):
            return present + name.removeprefix(earlier)
    return name
