"""Topics whose names changed: a recording made before is read under the present ones."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.config import load_config
from paani.logs.reader import open_log
from paani.logs.writer import LogWriter
from paani.topic_names import present_name
from paani_tools.logs.info import info_of
from paani_tools.replay.republish import RepublishOptions, topics_of
from tests.unit.paani.logs.small_logs import NAME, START_US, about, put


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """A recording with fixes under `plant/gps`, and one that could not be read."""
    gps = msgspec.structs.replace(keys.GPS, name="plant/gps")
    log = LogWriter(tmp_path / NAME, about(), (gps, keys.ODOMETRY), START_US)
    for number in range(3):
        fix = m.GpsFix(
            source_us=START_US + number, seq=number, sent_us=START_US + number, producer="plant",
            latitude_deg=52.0, longitude_deg=4.0, sog_mps=0.0, cog_rad=0.0, position_std_m=1.0,
        )  # fmt: skip
        put(log, gps, fix)
    log.write(gps, START_US + 4, None, b"{", b"")
    log.finish({"plant/gps": "written=3 dropped=2 missing=1 unreadable=1"})
    return log.path


def test_an_earlier_recording_is_read_under_present_names(earlier: Path) -> None:
    log = open_log(earlier)
    assert log.topics == {"sensors/gps": 3, "sensors/gps/unreadable": 1}
    assert [record.topic for record in log.records([keys.GPS.name])] == ["sensors/gps"] * 3
    (row,) = [topic for topic in info_of(log).topics if topic.topic == "sensors/gps"]
    assert (row.messages, row.dropped, row.missing) == (3, 2, 1)


def test_an_earlier_recording_is_republished_under_present_names(earlier: Path) -> None:
    for only in (None, ("plant/gps",), ("sensors/gps",)):
        (topic,) = topics_of(open_log(earlier), RepublishOptions(only=only), keys.Graph.SIMULATION)
        assert (topic.name, topic.producer) == ("sensors/gps", "plant")


def test_what_was_left_out_by_its_earlier_name_is_still_known() -> None:
    assert load_config(sets=['recorder.leave_out=["plant/imu"]']).recorder.leave_out == ("plant/imu",)
    assert present_name("plant/imu") == "sensors/imu"
    assert present_name("plant/imu_raw") == "plant/imu_raw"
