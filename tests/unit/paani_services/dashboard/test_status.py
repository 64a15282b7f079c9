"""The status that programs poll: what the hub holds, and how old it is."""

from __future__ import annotations

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.page_state import ServiceLiveness
from paani_services.dashboard.status import board_status

EVIDENCE = m.Evidence(source_us=1, frame_seq=3, frame_epoch=1, width_px=320, height_px=240, usable=True)
ADVISORY = m.Advisory(source_us=1, direction=m.Direction.LEFT, reason=m.Reason.CENTER_RISK)
PICTURE = Picture(m.PictureHeader(source_us=1, frame_seq=4, frame_epoch=1, width_px=320, height_px=240), b"jpeg")


def test_an_empty_hub_has_a_status_too() -> None:
    status = board_status(Hub(), "paper", 7)
    assert (status.now_us, status.profile, status.processes) == (7, "paper", ())
    assert (status.evidence, status.advisory, status.picture) == (None, None, None)


def test_the_status_is_the_newest_of_each_kind_with_its_age() -> None:
    hub, liveness = Hub(), ServiceLiveness()
    hub.put(keys.EVIDENCE.name, EVIDENCE, 1_000_000, 1_000_000)
    hub.put(keys.ADVISORY.name, ADVISORY, 1_200_000, 1_200_000)
    hub.put(keys.PICTURE.name, PICTURE, 1_300_000, 1_300_000)
    for epoch in (1, 2):
        liveness.report("camera", epoch)
    hub.put("dashboard/services", liveness.update("camera", alive=True), 0, 0)
    drops = (m.DropCount(cause="old", count=2), m.DropCount(cause="future", count=3))
    health = m.Health(
        source_us=1, service="camera", ready=True, uptime_s=1.0, cpu_cores=0.25, rss_mib=30.0, drops=drops
    )
    hub.put(keys.health("camera").name, health, 0, 0)
    status = board_status(hub, "paani", 1_500_000)
    assert (status.evidence, status.advisory, status.picture) == (EVIDENCE, ADVISORY, PICTURE.header)
    assert (status.evidence_age_s, status.advisory_age_s) == (0.5, 0.3)
    (camera,) = [process for process in status.processes if process.service == "camera"]
    assert (camera.alive, camera.starts, camera.cpu_cores, camera.rss_mib, camera.drops) == (True, 2, 0.25, 30.0, 5)
