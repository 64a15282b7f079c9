"""The state of the boat and the health of its processes as diagnostic_msgs, for rqt and robot_monitor. Pure."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

from paani import keys
from paani import messages as m
from paani_services.ros2 import topics
from paani_services.ros2.schemas import encode, make
from paani_services.ros2.translation import RosMessage, header_of

UNDUE = frozenset(topic.name for topic in keys.ASKED)


class Level(IntEnum):
    """Of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Status(NamedTuple):
    """One line of the monitor."""

    level: Level
    text: str
    values: dict[str, object]


class Diagnostics:
    """The newest word of each topic below, and when it came; what was never heard, or too long ago, is STALE."""

    def __init__(self, vessel: str, graph: keys.Graph) -> None:
        self._vessel = vessel
        self._processes = {keys.health(name).name: name for name in keys.services_in(graph)}
        self._fresh_s = {name: keys.health(process).fresh_s for name, process in self._processes.items()}
        states = (keys.THRUST_APPLIED, keys.OPERATOR_STATE, keys.COMMAND, keys.EVIDENCE, keys.ODOMETRY)
        self._fresh_s |= {topic.name: topic.fresh_s for topic in states}
        self._heard: dict[str, tuple[int, Any]] = {}

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the bus topics that `note` takes."""
        return tuple(self._fresh_s)

    def note(self, name: str, message: m.Message, received_us: int) -> None:
        """The newest message of a topic of the bus."""
        self._heard[name] = (received_us, message)

    def report(self, now_us: int) -> RosMessage:
        """Everything, as one DiagnosticArray. A process that never reported is left out: perhaps nobody started it."""
        statuses = {
            "motion": self._motion(now_us),
            "picture": self._picture(now_us),
            "position": self._position(now_us),
        }
        for name, process in self._processes.items():
            if name in self._heard:
                report = self._newest(name, now_us)
                statuses[f"process {process}"] = _process(report) if report else _stale()
        array = make(
            "diagnostic_msgs/DiagnosticArray",
            header=header_of(now_us, ""),
            status=[
                make(
                    "diagnostic_msgs/DiagnosticStatus",
                    level=int(status.level),
                    name=f"{self._vessel}: {name}",
                    message=status.text,
                    hardware_id=self._vessel,
                    values=[
                        make("diagnostic_msgs/KeyValue", key=key, value=_text(value))
                        for key, value in status.values.items()
                    ],
                )
                for name, status in statuses.items()
            ],
        )
        return RosMessage(topics.DIAGNOSTICS, now_us, encode(array))

    def _newest(self, name: str, now_us: int) -> Any | None:
        received_us, message = self._heard.get(name, (0, None))
        return message if message is not None and 0 <= now_us - received_us <= self._fresh_s[name] * 1e6 else None

    def _motion(self, now_us: int) -> Status:
        """Whether thrust is applied, and why not."""
        applied: m.ThrustApplied | None = self._newest(keys.THRUST_APPLIED.name, now_us)
        operator: m.OperatorState | None = self._newest(keys.OPERATOR_STATE.name, now_us)
        order: m.NavCommand | None = self._newest(keys.COMMAND.name, now_us)
        if applied is None:
            return _stale()
        values: dict[str, object] = {"zero_cause": applied.zero_cause, "left": applied.left, "right": applied.right}
        if operator is not None:
            values |= {"armed": operator.armed, "stopped": operator.stopped, "operator_by": operator.by}
            values |= {"mode": operator.mode, "wheel_by": operator.wheel_by, "mode_refusal": operator.mode_refusal}
        if order is not None:
            values |= {
                "direction": order.direction,
                "speed_mps": order.speed_mps,
                "inhibits": ", ".join(order.halt_reasons),
            }
        if applied.zero_cause is m.ZeroCause.NONE:
            return Status(Level.OK, "thrust applied", values)
        return Status(Level.WARN, f"no thrust: {applied.zero_cause}", values)

    def _picture(self, now_us: int) -> Status:
        evidence: m.Evidence | None = self._newest(keys.EVIDENCE.name, now_us)
        if evidence is None:
            return _stale()
        values: dict[str, object] = {"cause": evidence.cause, "detections": len(evidence.detections)}
        return Status(Level.OK, "usable", values) if evidence.usable else Status(Level.WARN, "unusable", values)

    def _position(self, now_us: int) -> Status:
        pose: m.Odometry | None = self._newest(keys.ODOMETRY.name, now_us)
        if pose is None:
            return _stale()
        values: dict[str, object] = {"position_std_m": pose.position_std_m, "yaw_std_rad": pose.yaw_std_rad}
        values["refused_fixes"] = pose.refused_fixes
        if pose.healthy:
            return Status(Level.OK, "healthy", values)
        return Status(Level.ERROR, "unhealthy: odometry and transforms are withheld", values)


def _process(report: m.Health) -> Status:
    late = [each.topic for each in report.inputs if each.received and not each.fresh and each.topic not in UNDUE]
    values: dict[str, object] = {
        "note": report.note, "uptime_s": report.uptime_s, "cpu_cores": report.cpu_cores, "rss_mib": report.rss_mib,
        **{f"{each.topic} rate_hz": each.rate_hz for each in report.inputs},
        **{f"refused {drop.cause}": drop.count for drop in report.drops},
    }  # fmt: skip
    if not report.ready:
        return Status(Level.WARN, "not ready", values)
    if late:
        return Status(Level.WARN, "hears no longer " + ", ".join(late), values)
    return Status(Level.OK, "ready", values)


def _stale() -> Status:
    return Status(Level.STALE, "not heard", {})


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
