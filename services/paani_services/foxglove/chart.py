"""Route, mission, fence, land and rally points as GeoJSON, for the viewer's map. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from paani import messages as m
from paani.geometry import geodetic_from_enu
from paani.logs import protobuf as pb

LatLon = tuple[float, float]
ROUTE_COLOUR, HOLD_COLOUR = "#59a8f2", "#9e87ed"
KEEP_COLOURS = {m.Keep.IN: "#57d69b", m.Keep.OUT: "#f25c5c"}
Feature = dict[str, object]


def chart(route: m.Route | None, mission: m.Mission | None, origin: LatLon) -> bytes:
    """A foxglove.GeoJSON of what is known of both."""
    features: list[Feature] = []
    if route is not None and len(route.waypoints) > 1:
        features.append(_line(route.waypoints, origin, ROUTE_COLOUR, route.name, closed=route.repeat))
    if mission is not None:
        for area in mission.bounds:
            name = area.name or f"keep {area.keep}"
            features.append(_line(area.corners, origin, KEEP_COLOURS[area.keep], name, closed=True))
        for number, leg in enumerate(mission.legs, 1):
            if leg.kind is m.LegKind.HOLD_STATION and leg.waypoints:
                features.append(_point(leg.waypoints[0], origin, f"leg {number}: hold station"))
        features += [_point(point, origin, f"rally point {number}") for number, point in enumerate(mission.rally, 1)]
    collection = {"type": "FeatureCollection", "features": features}
    return pb.encode(pb.GEO_JSON, {"geojson": msgspec.json.encode(collection).decode()})


def _line(points: Sequence[m.Waypoint], origin: LatLon, colour: str, name: str, *, closed: bool) -> Feature:
    corners = [*points, points[0]] if closed else points
    style = {"color": colour, "weight": 3, "opacity": 0.9}
    geometry = {"type": "LineString", "coordinates": _coordinates(corners, origin)}
    return {"type": "Feature", "properties": {"name": name, "style": style}, "geometry": geometry}


def _point(point: m.Waypoint, origin: LatLon, name: str) -> Feature:
    geometry = {"type": "Point", "coordinates": _coordinates([point], origin)[0]}
    return {"type": "Feature", "properties": {"name": name, "style": {"color": HOLD_COLOUR}}, "geometry": geometry}


def _coordinates(points: Iterable[m.Waypoint], origin: LatLon) -> list[tuple[float, float]]:
    """Longitude before latitude (RFC 7946, 3.1.1)."""
    found = (geodetic_from_enu(p.x_m, p.y_m, *origin) for p in points)
    return [(longitude_deg, latitude_deg) for latitude_deg, longitude_deg in found]
