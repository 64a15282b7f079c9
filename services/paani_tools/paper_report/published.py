"""The figures of the paper's tables of results (its statements V1 to V24), as printed there."""

from __future__ import annotations

import msgspec

from paani import messages as m

D, R = m.Direction, m.Reason


class PublishedStill(msgspec.Struct, frozen=True, kw_only=True):
    """A row of the table of single pictures: risks left, center, right, the advice, and a box where one is stated.

    Where the paper states no box, but its advice needs one (V14's occupied side), the box is ours.
    """

    statement: str
    picture: str
    risks: tuple[float, float, float]
    direction: m.Direction
    reason: m.Reason
    detection: m.Detection | None = None


DETECTOR_VALIDATION = {"mean": 0.463867, "person": 0.366075, "vessel": 0.609288, "pier": 0.421294, "buoy": 0.458810}
DETECTOR_CLASSES = ("person", "vessel", "pier", "buoy")
DETECTOR_STATEMENTS = {"mean": "V1", "person": "V4", "vessel": "V5", "pier": "V6", "buoy": "V7"}  # mAP50-95
SEGMENTER = {
    "miou": 0.975038,
    "iou_water": 0.991244,
    "iou_obstacle": 0.938622,
    "iou_sky": 0.995249,
    "edge_f1": 0.876991,
}
INT8 = {"miou": 0.730281, "edge_f1": 0.231788}  # V10
LAKE = "lake"  # the world that has the extents and the route of the paper's
LAKE_X_M, LAKE_Y_M = 208.699, 126.0  # K1
ROUTE_WAYPOINTS, ROUTE_M = 59, 465.443  # K2
STALE_AGE_S, STALE_PROBES = 9.3, 5  # V16

STILLS = (
    PublishedStill(
        statement="V11", picture="47266", risks=(0.3413, 0.2941, 0.1611), direction=D.STRAIGHT, reason=R.CENTER_CLEAR
    ),
    PublishedStill(
        statement="V12", picture="01703", risks=(0.4976, 0.5114, 0.4573), direction=D.RIGHT, reason=R.CENTER_RISK,
        detection=m.Detection(label=m.Label.VESSEL, confidence=0.85723, box_xyxy=(0.0, 0.38, 0.30, 0.56)),
    ),
    PublishedStill(
        statement="V13", picture="27011", risks=(0.3367, 0.4716, 0.6280), direction=D.STRAIGHT, reason=R.CENTER_CLEAR
    ),
    PublishedStill(
        statement="V14", picture="47357", risks=(0.6615, 0.6025, 0.4489), direction=D.STOP, reason=R.NO_SIDE_UNOCCUPIED,
        detection=m.Detection(label=m.Label.BUOY, confidence=0.45, box_xyxy=(0.70, 0.56, 0.95, 0.66)),
    ),
    PublishedStill(
        statement="V15", picture="black", risks=(0.0288, 0.0004, 0.0029), direction=D.STRAIGHT, reason=R.CENTER_CLEAR
    ),
)  # fmt: skip
