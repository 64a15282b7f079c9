"""Route and fence on a map of the earth."""

from __future__ import annotations

from typing import Any

import pytest

from paani import messages as m
from paani.geometry import enu_from_geodetic
from paani.logs import protobuf as pb
from paani_services.foxglove.chart import chart
from tests.unit.paani_services.foxglove.seen import NOW_US, WAYPOINTS, as_json, decoded

ORIGIN = (52.0, 4.0)


def features(data: bytes) -> list[Any]:
    found = as_json(decoded(pb.GEO_JSON, data).geojson.encode())
    assert found["type"] == "FeatureCollection"
    return list(found["features"])


def test_waypoints_lie_where_they_are() -> None:
    [line] = features(chart(m.Route(source_us=NOW_US, name="r", waypoints=WAYPOINTS), None, ORIGIN))
    places = [enu_from_geodetic(lat, lon, *ORIGIN) for lon, lat in line["geometry"]["coordinates"]]
    wanted = [(w.x_m, w.y_m) for w in (*WAYPOINTS, WAYPOINTS[0])]
    assert places == [pytest.approx(place, abs=1e-6) for place in wanted]


def test_fence_and_stations() -> None:
    area = m.FenceArea(keep=m.Keep.OUT, corners=WAYPOINTS, name="weir")
    leg = m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=(WAYPOINTS[0],))
    fence, station = features(chart(None, m.Mission(source_us=NOW_US, name="x", legs=(leg,), fence=(area,)), ORIGIN))
    assert fence["properties"]["name"] == "weir"
    assert fence["geometry"]["coordinates"][0] == fence["geometry"]["coordinates"][-1]
    assert station["geometry"] == {"type": "Point", "coordinates": [4.0, 52.0]}
