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
DETECTOR_AP50 = 0.743199  # V1
DETECTOR_OTHERS = (
    ("V2", "AP50 / AP50-95, mean, test", "0.738781 / 0.457888"),
    ("V3", "AP50 / AP50-95, mean, ONNX", "0.736668 / 0.456929"),
    ("V4", "AP50-95, person, test / ONNX", "0.365398 / 0.359960"),
    ("V5", "AP50-95, vessel, test / ONNX", "0.609214 / 0.599580"),
    ("V6", "AP50-95, pier, test / ONNX", "0.412297 / 0.418510"),
    ("V7", "AP50-95, buoy, test / ONNX", "0.444641 / 0.449664"),
)
# Statements of parameters and file, parameters, decimal MB, largest difference of the export (T2).
DETECTOR_NETWORK = (("C12", "C13"), 2_582_932, 10.472507, "7.63e-4")
SEGMENTER_NETWORK = (("D9", "D10"), 1_082_467, 4.344661, "4.12e-4")
DETECTOR_CLASSES = ("person", "vessel", "pier", "buoy")
DETECTOR_STATEMENTS = {"mean": "V1", "person": "V4", "vessel": "V5", "pier": "V6", "buoy": "V7"}  # mAP50-95
SEGMENTER = {
    "miou": 0.975038,
    "iou_water": 0.991244,
    "iou_obstacle": 0.938622,
    "iou_sky": 0.995249,
    "edge_f1": 0.876991,
}
SEGMENTER_ONNX = {
    "miou": 0.975037,
    "iou_water": 0.991245,
    "iou_obstacle": 0.938620,
    "iou_sky": 0.995246,
    "edge_f1": 0.876919,
}  # V9
SEGMENTER_WORDS = {
    "miou": "mean IoU",
    "iou_water": "IoU of water",
    "iou_obstacle": "IoU of obstacles",
    "iou_sky": "IoU of sky",
    "edge_f1": "F1 of edges",
}
ARTIFACTS = {"V8": "PyTorch", "V9": "ONNX"}
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
