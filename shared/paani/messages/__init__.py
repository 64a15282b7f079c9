"""Every message that crosses the bus.

Closed, frozen structs that encode to plain JSON. Angles are radians, counter-clockwise from east (ENU);
boxes are `(x1, y1, x2, y2)`, normalised to the picture, origin top left; stamps are integer microseconds.
A bounded field cannot carry NaN or infinity: JSON has neither, and the bounds reject the rest.
"""

from paani.messages.advisor import (
    INPUT_FAULTS,
    SIDE_OF,
    Advisory,
    ChangedBy,
    Counterfactual,
    Direction,
    Hazard,
    Lane,
    LaneRisk,
    Limit,
    MotionCause,
    MotionState,
    Purpose,
    Reason,
    Removal,
    RotationUse,
    Track,
    Tracks,
)
from paani.messages.camera import PictureHeader, TimeBase
from paani.messages.decision import InputMessage, OutputMessage, Step
from paani.messages.guidance import Arming, Inhibit, NavCommand, Odometry, Route, Thrust, Waypoint
from paani.messages.header import BoxXyxy, Count, Finite, Message, NonNegative, Signed, Stamp, Text, Unit
from paani.messages.health import DropCount, Health, InputHealth, Pulse
from paani.messages.microcontroller import BridgeState, McuState, McuVerdict, ResetCause
from paani.messages.mission import FenceArea, Keep, LegKind, Mission, MissionLeg
from paani.messages.operator import ArmRefusal, OperatorRequest, OperatorState, RequestAct
from paani.messages.perception import (
    Candidate,
    CandidateKind,
    Detection,
    Evidence,
    InferenceTiming,
    Label,
    LaneEvidence,
    SegmentationSource,
    UnusableCause,
)
from paani.messages.plant import GpsFix, ImuSample, SimTime, ThrustApplied, TruePose, ZeroCause
from paani.messages.prediction import MovingObstacle, Prediction
from paani.messages.recorder import RecordedTopic, RecorderState
from paani.messages.sensors import SensorDevice, SensorRole, SensorsState, SensorStatus
from paani.messages.thrusters import ReceiverState, ThrustersState, ThrustHold
from paani.messages.tuning import Change, Disagreement, Shadow, Tuning, TuningAct, TuningRefusal

__all__ = [
    "INPUT_FAULTS",
    "SIDE_OF",
    "Advisory",
    "ArmRefusal",
    "Arming",
    "BoxXyxy",
    "BridgeState",
    "Candidate",
    "CandidateKind",
    "Change",
    "ChangedBy",
    "Count",
    "Counterfactual",
    "Detection",
    "Direction",
    "Disagreement",
    "DropCount",
    "Evidence",
    "FenceArea",
    "Finite",
    "GpsFix",
    "Hazard",
    "Health",
    "ImuSample",
    "InferenceTiming",
    "Inhibit",
    "InputHealth",
    "InputMessage",
    "Keep",
    "Label",
    "Lane",
    "LaneEvidence",
    "LaneRisk",
    "LegKind",
    "Limit",
    "McuState",
    "McuVerdict",
    "Message",
    "Mission",
    "MissionLeg",
    "MotionCause",
    "MotionState",
    "MovingObstacle",
    "NavCommand",
    "NonNegative",
    "Odometry",
    "OperatorRequest",
    "OperatorState",
    "OutputMessage",
    "PictureHeader",
    "Prediction",
    "Pulse",
    "Purpose",
    "Reason",
    "ReceiverState",
    "RecordedTopic",
    "RecorderState",
    "Removal",
    "RequestAct",
    "ResetCause",
    "RotationUse",
    "Route",
    "SegmentationSource",
    "SensorDevice",
    "SensorRole",
    "SensorStatus",
    "SensorsState",
    "Shadow",
    "Signed",
    "SimTime",
    "Stamp",
    "Step",
    "Text",
    "Thrust",
    "ThrustApplied",
    "ThrustHold",
    "ThrustersState",
    "TimeBase",
    "Track",
    "Tracks",
    "TruePose",
    "Tuning",
    "TuningAct",
    "TuningRefusal",
    "Unit",
    "UnusableCause",
    "Waypoint",
    "ZeroCause",
]
