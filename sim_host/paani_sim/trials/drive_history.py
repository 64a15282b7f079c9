"""The history of a drive: samples, stops, advisories and changes of thrust, to be scored at its end."""

from __future__ import annotations

from typing import NamedTuple

from paani import messages as m
from paani.thrust_adapter import AppliedThrust
from paani_sim.plant.plant import Plant
from paani_sim.trials.autonomy_stack import AutonomyStack
from paani_sim.trials.route_progress import RouteProgress


class DriveSample(NamedTuple):
    """State of the boat, sampled ten times a second while it is armed."""

    t_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    surge_mps: float
    cross_track_m: float
    left_n: float
    right_n: float
    collisions: int
    in_contact: bool
    actors_along_m: tuple[float, ...]


class StopInterval(NamedTuple):
    """A time in which the navigator commanded a stop, and its reason: the advisory's, if that was the cause."""

    t_s: float
    reason: str
    ended_s: float | None = None


class ThrustChange(NamedTuple):
    """A change of the applied thrust: its time [us], whether to zero, and the stamp of the picture behind it [us]."""

    at_us: int
    is_zero: bool
    picture_us: int


class DriveHistory:
    """Collects the history while the drive runs."""

    def __init__(self) -> None:
        self.samples: list[DriveSample] = []
        self.stops: list[StopInterval] = []
        self.advisories: list[m.Advisory] = []
        self.thrust_changes: list[ThrustChange] = []
        self.unusable_frames: list[tuple[int, m.UnusableCause]] = []  # stamp of the picture [us], and cause
        self._in_force: m.Thrust | None = None
        self._was_zero = True

    def record_evidence(self, evidence: m.Evidence, now_us: int) -> None:
        """Record that one picture's evidence reached the board."""
        if not evidence.usable:
            self.unusable_frames.append((evidence.source_us, evidence.cause))

    def record_thrust(self, applied: AppliedThrust, in_force: m.Thrust | None, now_us: int) -> None:
        """Record the thrust applied in this step, and the command in force."""
        is_zero = applied.left_n == 0.0 and applied.right_n == 0.0
        picture_us = in_force.source_us if in_force is not None else 0
        before_us = self._in_force.source_us if self._in_force is not None else 0
        if is_zero is not self._was_zero or picture_us != before_us:
            self.thrust_changes.append(ThrustChange(now_us, is_zero, picture_us))
        self._in_force, self._was_zero = in_force, is_zero

    def record_sample(
        self, plant: Plant, progress: RouteProgress, autonomy: AutonomyStack, applied: AppliedThrust
    ) -> None:
        """Sample the boat, and note new advisories and stops."""
        t_s = plant.sim_us * 1e-6
        x_m, y_m = plant.position_m
        actors_along_m = plant.actors_along_m
        surge_mps = plant.velocity[0]
        self.samples.append(
            DriveSample(
                t_s, x_m, y_m, plant.attitude.yaw_rad, surge_mps, progress.cross_track_m,
                applied.left_n, applied.right_n, plant.collisions, plant.in_contact, actors_along_m,
            )
        )  # fmt: skip
        advisory, command = autonomy.advisory, autonomy.command
        if advisory is not None and (not self.advisories or advisory is not self.advisories[-1]):
            self.advisories.append(advisory)
        if command is not None:
            self.record_order(t_s, command, advisory)

    def record_order(self, t_s: float, command: m.NavCommand, advisory: m.Advisory | None) -> None:
        """Note where a stop begins, ends, or is for another reason; a boat that is kept on station is stopped."""
        is_stopped = bool(self.stops) and self.stops[-1].ended_s is None
        if not command.halt_reasons:
            if is_stopped:
                self.stops[-1] = self.stops[-1]._replace(ended_s=t_s)
            return
        first = command.halt_reasons[0]
        if first is m.Inhibit.NOT_ARMED:
            return
        reason = advisory.reason.value if first is m.Inhibit.ADVISED_STOP and advisory else first.value
        if is_stopped and self.stops[-1].reason == reason:
            return
        if is_stopped:
            self.stops[-1] = self.stops[-1]._replace(ended_s=t_s)
        self.stops.append(StopInterval(t_s, reason))
