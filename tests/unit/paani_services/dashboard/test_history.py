"""The last ten minutes: bounded, whole at every moment, and never a picture beside the evidence of another."""

from __future__ import annotations

from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani_services.dashboard.frames import LENGTH, FrameHeader, decode_frame
from paani_services.dashboard.history import FreshInHub, History
from paani_services.dashboard.hub import Event, Hub
from paani_services.dashboard.time_series import Sample, columns_of, sample_of

START_US = 1_700_000_000_000_000
ADVISORY = m.Advisory(
    source_us=START_US, sent_us=START_US + 80_000, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK, frame_seq=7,
    frame_epoch=1, center=m.LaneRisk(risk=0.75),
)  # fmt: skip
ARMED = m.OperatorState(source_us=START_US, armed=True, stopped=False)


def unpack(packed: bytes) -> list[tuple[str, FrameHeader, bytes]]:
    found, at = [], 0
    while at < len(packed):
        end = at + LENGTH.size + LENGTH.unpack_from(packed, at)[0]
        found.append(decode_frame(packed[at + LENGTH.size : end]))
        at = end
    return found


def picture(seq: int) -> Picture:
    header = m.PictureHeader(source_us=START_US, frame_seq=seq, frame_epoch=1, width_px=4, height_px=4)
    return Picture(header, b"jpeg %d" % seq)


def put(hub: Hub, topic: keys.Topic[Any], value: m.Message | Picture, at_us: int = START_US) -> None:
    hub.put(topic.name, value, at_us, at_us)


def test_a_keyframe_has_the_picture_that_the_advice_was_made_from() -> None:
    hub, history = Hub(), History(())
    for seq in (6, 7, 8):
        put(hub, keys.PICTURE, picture(seq))
    put(hub, keys.ADVISORY, ADVISORY)
    history.take(hub, START_US + 300_000)
    frames = {key: (header, body) for key, header, body in unpack(history.window(0, START_US + 300_000))}
    assert frames[keys.PICTURE.name][1] == b"jpeg 7"
    header, body = frames[keys.ADVISORY.name]
    assert (header.age_ms, header.at_us) == (300, START_US + 300_000)
    assert b'"LEFT"' in body


def test_the_window_begins_with_the_moment_before_it() -> None:
    hub, history = Hub(), History(())
    put(hub, keys.OPERATOR_STATE, ARMED)
    for second in range(5):
        history.take(hub, START_US + second * 1_000_000)

    def moments(from_s: float, to_s: float) -> list[float]:
        packed = history.window(START_US + round(from_s * 1e6), START_US + round(to_s * 1e6))
        return [(header.at_us - START_US) * 1e-6 for _, header, _ in unpack(packed)]

    assert moments(1.5, 3.0) == [1.0, 2.0, 3.0]
    assert moments(2.5, 2.6) == [2.0]
    assert moments(9.0, 9.5) == [4.0]


@pytest.mark.parametrize(("span_us", "max_bytes"), [(3_000_000, 1 << 20), (600_000_000, 900)])
def test_the_oldest_moments_go_first(span_us: int, max_bytes: int) -> None:
    hub, history = Hub(), History((), span_us, max_bytes)
    put(hub, keys.OPERATOR_STATE, ARMED)
    for second in range(20):
        history.take(hub, START_US + second * 1_000_000)
    moments = {header.at_us for _, header, _ in unpack(history.window(0, START_US + 60_000_000))}
    assert max(moments) == START_US + 19_000_000
    assert 2 <= len(moments) <= 6


def test_a_sample_leaves_out_what_is_stale() -> None:
    hub, now_us = Hub(), START_US + 1_000_000
    put(hub, keys.ADVISORY, ADVISORY, now_us)
    put(hub, keys.OPERATOR_STATE, ARMED, START_US - 10_000_000)
    report = m.Health(source_us=1, service="advisor", ready=True, uptime_s=1.0, cpu_cores=0.25, rss_mib=9.0)
    put(hub, keys.health("advisor"), report, now_us)
    sample = sample_of(FreshInHub(hub, now_us), ("advisor", "camera"), now_us)
    assert sample == Sample(
        at_us=now_us, advice="LEFT", risk_left=1.0, risk_center=0.75, risk_right=1.0, cpu_cores=0.25, latency_ms=80.0
    )
    put(hub, keys.OPERATOR_STATE, ARMED, now_us)
    assert sample_of(FreshInHub(hub, now_us), (), now_us).mode == "ROUTE"


def test_columns_are_the_samples_by_field() -> None:
    columns = columns_of([Sample(at_us=1, advice="LEFT"), Sample(at_us=2, speed_mps=0.5)])
    by_name = dict(zip(columns.names, columns.values, strict=True))
    assert by_name["at_us"] == (1, 2)
    assert by_name["speed_mps"] == (None, 0.5)
    assert columns_of([]).values == ((),) * len(columns.names)


def test_events_outlive_those_kept_for_new_pages() -> None:
    hub = Hub()
    for number in range(60):
        hub.publish_event(Event(number, "info", str(number)))
    assert [event.at_us for event in hub.events] == list(range(60))
    assert len(hub.add_client(60).queue) == 24, "a page that joins is sent the last ones alone"
