"""Which messages go out on which channels, and which never do."""

from __future__ import annotations

import collections

import cv2
import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani.config import Config, FoxgloveConfig, LocalizationConfig, load_config
from paani.errors import UserError
from paani.geometry import geodetic_from_enu
from paani.logs import protobuf as pb
from paani_services.foxglove.channels import CALIBRATION as LENS
from paani_services.foxglove.channels import CHART, CORRIDORS, DRAWN, MASK, SCENE, TRANSFORMS, channels
from paani_services.foxglove.parameters import parameters
from paani_services.foxglove.relay import Relay
from tests.unit.paani_services.foxglove.seen import (
    CALIBRATION,
    NOW_US,
    WAYPOINTS,
    advisory,
    as_json,
    decoded,
    header,
    odometry,
    track,
    tracks,
)

JPEG = b"\xff\xd8 bytes"


class Viewers:
    """What goes out, and what is counted, while these channels are watched (None: all)."""

    def __init__(self, watched: set[str] | None = None, config: Config | None = None) -> None:
        self.sent: list[tuple[str, bytes]] = []
        self.refused: collections.Counter[str] = collections.Counter()
        self.relay = Relay(
            config or Config(calibration=CALIBRATION),
            lambda name, data: self.sent.append((name, data)),
            lambda name: watched is None or name in watched,
            lambda cause: self.refused.update((cause,)),
        )

    def on(self, name: str) -> list[bytes]:
        return [data for channel, data in self.sent if channel == name]

    def names(self) -> list[str]:
        return [name for name, _ in self.sent]


def mask_of(frame_seq: int) -> Picture:
    grey = cv2.imencode(".png", np.zeros((4, 4), np.uint8))[1].tobytes()
    return Picture(header(frame_seq, source_us=NOW_US, media_type="image/png", width_px=4, height_px=4), grey)


def test_a_picture_goes_out_once_with_its_lens() -> None:
    viewers = Viewers()
    viewers.relay.take_picture(Picture(header(3), JPEG))
    viewers.relay.take_picture(Picture(header(3), JPEG))
    [sent] = viewers.on(keys.PICTURE.name)
    assert decoded(pb.COMPRESSED_IMAGE, sent).data == JPEG
    assert len(viewers.on(LENS)) == 1
    assert viewers.refused == {"picture_repeated": 1}


def test_nothing_is_drawn_over_another_frame() -> None:
    """The newest picture is of frame 4; evidence of 3 is dated as picture 3, and evidence of 5 waits for nobody."""
    viewers = Viewers()
    for number in (3, 4):
        viewers.relay.take_picture(Picture(header(number), JPEG))
    viewers.relay.take(keys.TRACKS, tracks(5, track()))
    viewers.relay.take(keys.ADVISORY, advisory(5))
    assert viewers.on("viewer/annotations") == viewers.on(CORRIDORS) == []
    for _ in range(2):
        viewers.relay.take(keys.TRACKS, tracks(3, track()))
        viewers.relay.take(keys.ADVISORY, advisory(3))
    [boxes], [corridors] = viewers.on("viewer/annotations"), viewers.on(CORRIDORS)
    for data in (boxes, corridors):
        found = decoded(pb.IMAGE_ANNOTATIONS, data)
        assert {each.timestamp.ToMicroseconds() for each in (*found.points, *found.texts)} == {header(3).source_us}


def test_a_mask_is_dated_as_its_picture() -> None:
    viewers = Viewers()
    viewers.relay.take_mask(mask_of(3))
    assert viewers.refused == {"mask_without_picture": 1}
    viewers.relay.take_picture(Picture(header(3), JPEG))
    viewers.relay.take_mask(mask_of(3))
    found = decoded(pb.COMPRESSED_IMAGE, viewers.on(MASK)[0])
    assert (found.timestamp.ToMicroseconds(), found.format) == (header(3).source_us, "png")
    viewers.relay.take_picture(Picture(header(4), JPEG))
    viewers.relay.take_mask(Picture(mask_of(4).header, JPEG))
    assert viewers.refused["mask_unreadable"] == 1


@pytest.mark.parametrize("local_first", [True, False])
def test_transforms_are_of_one_instant_whichever_estimate_comes_first(local_first: bool) -> None:
    viewers = Viewers()
    local, both = odometry(x_m=0.0), [(keys.ODOMETRY, odometry())]
    both.insert(0 if local_first else 1, (keys.LOCAL_ODOMETRY, local))
    viewers.relay.take(keys.LOCAL_ODOMETRY, odometry(source_us=NOW_US - 50_000))
    for topic, message in both:
        viewers.relay.take(topic, message)
    assert len(viewers.on(TRANSFORMS)) == 1


def test_a_message_goes_out_as_it_is_and_only_to_who_watches() -> None:
    viewers = Viewers(watched={keys.ODOMETRY.name})
    viewers.relay.take(keys.ODOMETRY, odometry())
    viewers.relay.take(keys.ROUTE, m.Route(source_us=NOW_US, name="r", waypoints=WAYPOINTS))
    viewers.relay.take_picture(Picture(header(3), JPEG))
    assert viewers.on(keys.ODOMETRY.name) == [msgspec.json.encode(odometry())]
    assert not {keys.PICTURE.name, keys.ROUTE.name, SCENE, CHART} & {*viewers.names()}


def test_the_chart_waits_for_an_origin() -> None:
    route, viewers = m.Route(source_us=NOW_US, name="r", waypoints=WAYPOINTS), Viewers()
    viewers.relay.take(keys.ROUTE, route)
    assert viewers.on(CHART) == []
    viewers.relay.take(keys.ODOMETRY, odometry())
    assert len(viewers.on(CHART)) == 1
    placed = Viewers(config=Config(localization=LocalizationConfig(origin_lat_lon_deg=(50.0, 8.0))))
    placed.relay.take(keys.ROUTE, route)
    [line] = as_json(decoded(pb.GEO_JSON, placed.on(CHART)[0]).geojson.encode())["features"]
    assert line["geometry"]["coordinates"][0] == [8.0, 50.0]


def test_a_chart_moves_with_the_map() -> None:
    """A boat that starts anew has its map elsewhere on Earth, and what it follows lies in that map."""
    viewers = Viewers()
    viewers.relay.take(keys.ROUTE, m.Route(source_us=NOW_US, name="r", waypoints=WAYPOINTS))
    for origin in ((52.0, 4.0), (52.0, 4.0), (52.1, 4.0)):
        latitude_deg, longitude_deg = geodetic_from_enu(12.0, -5.0, *origin)
        viewers.relay.take(keys.ODOMETRY, odometry(latitude_deg=latitude_deg, longitude_deg=longitude_deg))
        viewers.relay.take(
            keys.ODOMETRY, odometry(latitude_deg=latitude_deg, longitude_deg=longitude_deg + 1.0, healthy=False)
        )
    [before], [after] = (as_json(decoded(pb.GEO_JSON, data).geojson.encode())["features"] for data in viewers.on(CHART))
    for line, latitude_deg in ((before, 52.0), (after, 52.1)):
        first_deg = line["geometry"]["coordinates"][0]
        wanted = geodetic_from_enu(WAYPOINTS[0].x_m, WAYPOINTS[0].y_m, latitude_deg, 4.0)
        assert first_deg[::-1] == pytest.approx(wanted, abs=1e-6)


def test_nothing_is_said_between_messages() -> None:
    """What falls silent on the bus falls silent: everything that goes out comes of one message."""
    viewers = Viewers()
    viewers.relay.take(keys.ODOMETRY, odometry())
    count = len(viewers.sent)
    viewers.relay.take(keys.SIM_TIME, m.SimTime(source_us=NOW_US, sim_us=1, stamp_us=1))
    assert viewers.names()[count:] == [keys.SIM_TIME.name]


@pytest.mark.parametrize("graph", list(keys.Graph))
@pytest.mark.slow
def test_no_channel_tells_the_truth_of_the_simulator(graph: keys.Graph) -> None:
    offered = channels(graph)
    assert not any(name.startswith("@") or "/request/" in name or name.endswith("/step") for name in offered)
    assert {"camera/picture", "advisor/advisory", "health/foxglove", *DRAWN} <= set(offered)
    assert not any(name.startswith("pulse/") for name in offered)


def test_parameters_are_the_settings_without_the_places_of_keys() -> None:
    found = parameters(load_config(sets=("bus.runtime_dir=/secret/place", "navigator.cruise_mps=0.4")))
    assert found["navigator.cruise_mps"] == 0.4
    assert found["advisor.policy.center_block_risk"] == 0.48
    assert found["perception.corridors.center"] == [0.31, 0.69]
    assert found["bus.vessel"] == "otter"
    assert "/secret/place" not in str(found)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "boat.local"])
def test_an_address_that_others_reach_needs_a_certificate_or_leave(host: str) -> None:
    with pytest.raises(UserError, match=r"foxglove.*host .*: other machines reach it.*tls_pem"):
        load_config(sets=(f"foxglove.host={host}",))
    for leave in ("foxglove.tls_pem=a.pem", "foxglove.open_to_network=true"):
        assert load_config(sets=(leave, f"foxglove.host={host}")).foxglove.host == host


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.53", "::1", "localhost"])
def test_this_machine_needs_none(host: str) -> None:
    assert FoxgloveConfig(host=host).host == host
