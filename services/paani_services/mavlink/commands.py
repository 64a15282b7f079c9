"""What a command of a ground station asks, and whether it may. Pure.

The answer is a result of the protocol and, where it is a refusal, a text that says why. Nothing here arms: what is to
be done is asked of the operator's process, which judges it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from paani import messages as m
from paani.mission_client import MISSION_REFUSALS, MissionAnswer
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import integer
from paani_services.mavlink.health_bits import prearm_faults
from paani_services.mavlink.rover_modes import DRIVE_MODES, Mode
from paani_services.mavlink.snapshot import Snapshot

ACCEPTED, LATER = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
DENIED, UNSUPPORTED = dialect.MAV_RESULT_DENIED, dialect.MAV_RESULT_UNSUPPORTED
FAILED, IN_PROGRESS = dialect.MAV_RESULT_FAILED, dialect.MAV_RESULT_IN_PROGRESS

MISSION_ERROR = dialect.MAV_MISSION_ERROR
CUSTOM_MODE = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
TERMINATE = dialect.MAV_CMD_DO_FLIGHTTERMINATION
SET_MODE = dialect.MAV_CMD_DO_SET_MODE
JUMP = dialect.MAV_CMD_DO_SET_MISSION_CURRENT
# Commands that would change where the boat goes otherwise than by its mode: the bus has no request for any of them.
GUIDING = frozenset(
    {
        dialect.MAV_CMD_DO_REPOSITION,
        dialect.MAV_CMD_DO_CHANGE_SPEED,
        dialect.MAV_CMD_DO_SET_HOME,
        dialect.MAV_CMD_DO_SET_REVERSE,
        JUMP,
        dialect.MAV_CMD_DO_FENCE_ENABLE,
        dialect.MAV_CMD_NAV_WAYPOINT,
    }
)
# What a command that stands for a mode would switch to.
MODE_COMMANDS = {
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: Mode.RTL,
    dialect.MAV_CMD_NAV_LOITER_UNLIM: Mode.LOITER,
    dialect.MAV_CMD_MISSION_START: Mode.AUTO,
}
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
NO_JUMP = "mission: no jumping; the boat goes on with its leg"
NOT_TRUSTED = "refused: unsigned commands only on this machine"


class Act(Enum):
    """What is asked of the operator's process."""

    ARM = "arm"
    STOP = "stop"
    MODE = "mode"
    WHEEL = "wheel"


class Verdict(NamedTuple):
    """`result` is final unless there is an act, whose outcome it then is. mode: of an act that asks for one."""

    result: int
    text: str = ""
    act: Act | None = None
    mode: m.DriveMode = m.DriveMode.IDLE


def judge_command(command: int, parameters: Sequence[float], snapshot: Snapshot, *, is_trusted: bool) -> Verdict:
    """Judge a command that concerns the boat. parameters: of the message, any of which may be NaN.

    is_trusted: the frame was signed, or came from this machine where nothing is signed.
    """
    first, second = integer(parameters[0]), integer(parameters[1])
    if command == TERMINATE and first == 1:
        return _trusted(Verdict(ACCEPTED, act=Act.STOP), is_trusted)
    if command == ARM_DISARM:
        return _trusted(_judge_arming(first, second, snapshot), is_trusted)
    if command == SET_MODE:
        return _trusted(judge_mode(first, second), is_trusted)
    if command in MODE_COMMANDS:
        return _trusted(judge_mode(CUSTOM_MODE, MODE_COMMANDS[command]), is_trusted)
    if command == PAUSE and first in {0, 1}:
        return _trusted(judge_mode(CUSTOM_MODE, Mode.AUTO if first else Mode.LOITER), is_trusted)
    if command in GUIDING:
        text = NO_JUMP if command == JUMP else "refused: the boat follows its own mission"
        return _trusted(Verdict(DENIED, text), is_trusted)
    return Verdict(UNSUPPORTED)


def judge_mode(base_mode: int | None, number: int | None) -> Verdict:
    """A mode is asked of the operator's process, whatever the base mode says beside it: no mode arms.

    The number means one only where the base mode says so.
    """
    if base_mode is None or not base_mode & CUSTOM_MODE or number is None or number not in DRIVE_MODES:
        return Verdict(DENIED, "refused: no such mode on this boat")
    return Verdict(ACCEPTED, act=Act.MODE, mode=DRIVE_MODES[Mode(number)])


def mode_result(refusal: m.ModeRefusal | None) -> tuple[int, str]:
    """Result and text of an answer of the operator's process to a mode or the wheel; None: it gave none."""
    match refusal:
        case m.ModeRefusal.NONE:
            return ACCEPTED, ""
        case None:
            return FAILED, "mode: the operator process does not answer"
        case m.ModeRefusal.NOT_HOLDER:
            return DENIED, "mode: another hand holds the wheel"
        case m.ModeRefusal.NOT_ARMED:
            return DENIED, "mode: arm first"
        case _:
            return DENIED, f"mode: {refusal.replace('_', ' ').lower()}"


def arm_result(refusal: m.ArmRefusal | None) -> tuple[int, str]:
    """Result and text of an answer of the operator's process; None: it gave none."""
    match refusal:
        case m.ArmRefusal.NONE:
            return ACCEPTED, ""
        case None:
            return FAILED, "arm: the operator process does not answer"
        case m.ArmRefusal.LATCHED:
            return DENIED, "arm: a STOP holds; release it on the page"
        case m.ArmRefusal.STOPPED:
            return DENIED, "arm: a STOP came meanwhile"
        case m.ArmRefusal.NO_STATION:
            return DENIED, "arm: the page process is not there"
        case m.ArmRefusal.NOT_WRITTEN:
            return FAILED, "arm: the STOP latch cannot be written"
        case _:
            return LATER, f"arm: hold was {refusal.replace('_', ' ').lower()}; try again"


def stop_result(state: m.OperatorState | None) -> tuple[int, str]:
    """Result and text of a STOP."""
    if state is None:
        return FAILED, "STOP: the operator process does not answer"
    return ACCEPTED, ""


def _judge_arming(first: int | None, second: int | None, snapshot: Snapshot) -> Verdict:
    """Disarming is a STOP, forced or not. No number forces the arming of a boat that is not in order."""
    if first == 0:
        return Verdict(ACCEPTED, act=Act.STOP)
    if first != 1:
        return Verdict(DENIED, "arm: parameter 1 is neither 0 nor 1")
    if second not in {0, None}:
        return Verdict(DENIED, "arm: cannot be forced")
    if snapshot.is_armed:
        return Verdict(ACCEPTED)
    if faults := prearm_faults(snapshot):
        return Verdict(FAILED, f"arm: {faults[0].replace('_', ' ').lower()}")
    return Verdict(ACCEPTED, act=Act.ARM)


def _trusted(verdict: Verdict, is_trusted: bool) -> Verdict:
    return verdict if is_trusted else Verdict(DENIED, NOT_TRUSTED)


def mission_result(answer: MissionAnswer | None) -> tuple[int, str]:
    """The result of a mission for MISSION_ACK, and why where it is not in force."""
    if answer is None:
        return MISSION_ERROR, "mission: the operator's process is silent"
    if answer.refusal is m.MissionRefusal.NONE:
        return dialect.MAV_MISSION_ACCEPTED, ""
    is_invalid = answer.refusal is m.MissionRefusal.INVALID
    result = dialect.MAV_MISSION_INVALID if is_invalid else dialect.MAV_MISSION_DENIED
    return result, answer.fault or MISSION_REFUSALS[answer.refusal]
