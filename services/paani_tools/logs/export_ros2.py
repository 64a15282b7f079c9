"""A recording as a bag of ROS 2, with the messages that the ROS 2 port sends live."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from paani import keys
from paani.config.ros2 import require_ros_name
from paani.errors import UserError
from paani.extras import require_modules
from paani.logs.pictures import HEADER, paired_pictures
from paani.logs.reader import Log, Record
from paani.logs.ros_bag import RosBag
from paani.version import version_text
from paani.whole_file import replacement_file

OPTION = "--ros2"
PICTURES = (keys.PICTURE.name, keys.PICTURE.name + HEADER)


def export_ros2(log: Log, path: Path, seen: Callable[[Record], None]) -> str:
    """Returns a line that says what was written.

    Raises UserError where the file cannot be written, where rosbags is not installed, and where the recording has no
    settings, a vessel that ROS cannot name, or nothing that the port sends.
    """
    require_modules(f"paani logs export {OPTION}", "rosbags")
    from paani_services.ros2.recorded import RecordedDrive  # noqa: PLC0415  # only this export needs rosbags
    from paani_services.ros2.schemas import definition  # noqa: PLC0415

    config = log.config()
    try:
        require_ros_name(config.bus.vessel)
    except ValueError as error:
        raise UserError(f"{log.path}: {error}") from error
    drive, written = RecordedDrive(config), 0
    records = _with_progress(log.records((*drive.sources, *PICTURES)), seen)
    with replacement_file(path, OPTION) as beside, RosBag(beside, version_text()) as bag:
        for log_us, message in drive.messages(paired_pictures(records, [keys.PICTURE.name])):
            name, kind = message.topic.full_name(config.bus.vessel), message.topic.type
            if not bag.has_topic(name):
                bag.add_topic(name, kind.replace("/", "/msg/"), definition(kind))
            bag.write(name, log_us, message.source_us, message.data)
            written += 1
        if not written:
            raise UserError(f"{log.path}: nothing in it that ROS 2 has a message for")
    lost = f"; {drive.left_out} messages left out, which cannot be read" if drive.left_out else ""
    return f"{path}: {bag.topics} topics, {written} messages{lost}"


def _with_progress(records: Iterator[Record], seen: Callable[[Record], None]) -> Iterator[Record]:
    for record in records:
        seen(record)
        yield record
