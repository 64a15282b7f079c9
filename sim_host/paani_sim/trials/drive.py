"""One drive: plant, sensors, estimator, evidence and autonomy stack in lockstep on a simulated clock.

The plant steps at its own rate, the estimator at `localization.rate_hz`, the source of evidence at the rate of
perception; evidence reaches the board `perception_latency_s` after its picture was taken, everything else at once.
"""

from __future__ import annotations

from typing import TypeVar

import cv2
import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.cores import load_estimator
from paani.motion_planning import MotionPlanner
from paani.thrust_adapter import AppliedThrust, InForce, ThrustAdapter, applied_message
from paani_sim.plant.plant import Plant, PlantDiverged
from paani_sim.plant.telemetry import (
    ais_message,
    depth_message,
    gps_message,
    imu_message,
    pose_message,
    scan_message,
)
from paani_sim.trials.autonomy_stack import AutonomyStack
from paani_sim.trials.drive_history import DriveHistory
from paani_sim.trials.drive_states import DriveOutcome, DrivePhase
from paani_sim.trials.evidence_source import EvidenceFrame, EvidenceSource
from paani_sim.trials.lockstep_bus import START_US, LockstepBus, MessageTap, PlantClock
from paani_sim.trials.policies import processed_frame_rate_hz, time_limit_factor
from paani_sim.trials.route_progress import RouteProgress
from paani_sim.worlds import Scenario
from paani_sim.worlds.faults import is_linked

T = TypeVar("T", bound=m.Message)
PERCEPTION_LATENCY_S = 0.10  # measured: capture_to_thrust of the live chain (`paani bench chain`), about 100 ms
MAX_READY_S = 20.0
MIN_READY_S = 2.0
STALL_TIME_S, STALL_PROGRESS_M = (
    120.0,
    0.5,
)  # longer than waiting for passing traffic or going round a barge takes
ARMING_HZ, PULSE_HZ, SAMPLE_HZ = 5.0, 10.0, 10.0
ROUTE_END_TOLERANCE_M = 4.0  # of an open route: acceptance radius of 1.5 m, plus the GPS error of a moment
REPORTED_END_TOLERANCE_M = 3.0  # farther, if the navigator reports the end: its position is off by the GPS error


def build_mission(scenario: Scenario) -> m.Mission:
    """Follow the world's route, once or without end, within the scenario's fence."""
    world = scenario.world
    leg = m.MissionLeg(
        kind=m.LegKind.FOLLOW_ROUTE,
        waypoints=tuple(m.Waypoint(x_m=x, y_m=y) for x, y in world.route_m.tolist()),
        repeat=world.route_closed,
        laps=0 if world.route_closed else 1,
    )
    return m.Mission(source_us=0, name=world.name, legs=(leg,), fence=scenario.fence)


class Drive:
    """Call `step` until `phase` is FINISHED; `outcome` then says how the drive ended. Call `close` when done."""

    def __init__(
        self,
        scenario: Scenario,
        config: Config,
        evidence_source: EvidenceSource | None,
        *,
        tap: MessageTap | None = None,
        perception_latency_s: float = PERCEPTION_LATENCY_S,
        planner: MotionPlanner | None = None,
    ) -> None:
        """evidence_source None: no advisor; the advice is always to go straight on. planner: see `AutonomyStack`."""
        world = scenario.world
        self.scenario, self.config = scenario, config
        self._evidence_source = evidence_source
        self.plant = Plant.from_scenario(scenario, config.plant)
        origin_deg = (world.origin_lat_deg, world.origin_lon_deg)
        self._estimator = load_estimator(msgspec.structs.replace(config.localization, origin_lat_lon_deg=origin_deg))
        self._clock = PlantClock(self.plant)
        self._bus = LockstepBus(self._clock, config.bus.domain, tap)
        self.autonomy = AutonomyStack(
            config, build_mission(scenario), self._bus, self._clock, blind=evidence_source is None, planner=planner
        )
        self.adapter = ThrustAdapter(config.plant.adapter, config.bus.domain)
        self.applied: AppliedThrust = self.adapter.decide(START_US)
        self.progress = RouteProgress(
            world.route_m, closed=world.route_closed, start_m=(world.start.x_m, world.start.y_m)
        )
        self.goal_m = self._compute_goal_m()
        self.time_limit_s = scenario.task.time_limit_s * time_limit_factor(config)
        self.history = DriveHistory()
        self.phase, self.outcome, self.error = DrivePhase.READY, DriveOutcome.NONE, ""
        self.armed_us = 0  # when the boat was armed; 0 before
        self._last_progress_s, self._last_progress_m = 0.0, 0.0  # when and where the last progress was made
        rate = 1.0 / config.plant.step_s
        sensors = config.plant.sensors
        self._steps_between = {
            what: max(1, round(rate / hz))
            for what, hz in {
                "imu": sensors.imu_rate_hz,
                "gps": sensors.gps_rate_hz,
                "ais": keys.AIS.rate_hz,
                "lidar": keys.SCAN.rate_hz,
                "depth": sensors.sonar_rate_hz,
                "estimate": config.localization.rate_hz,
                "report": config.plant.publish_rate_hz,
                "look": processed_frame_rate_hz(config),
                "arming": ARMING_HZ,
                "pulse": PULSE_HZ,
                "sample": SAMPLE_HZ,
            }.items()
        }
        self._evidence_delay_us = round(perception_latency_s * 1e6)
        self._imu_samples: list[m.ImuSample] = []
        self._gps_fix: m.GpsFix | None = None
        self._odometry: m.Odometry | None = None
        self._pending_evidence: list[tuple[int, m.Evidence]] = []
        self.frames = 0
        self._in_force = InForce()

    @property
    def now_us(self) -> int:
        """Time of the drive's clock, which stamps all its messages."""
        return self._clock.now_us()

    @property
    def elapsed_s(self) -> float:
        """Simulated time since the boat was armed."""
        return (self.now_us - self.armed_us) * 1e-6 if self.armed_us else 0.0

    def run(self) -> None:
        """Drive to the end."""
        while self.phase is not DrivePhase.FINISHED:
            self.step()

    def step(self) -> None:
        """One step of the plant, and of every process that is due after it. A diverging integration ends the drive."""
        self.applied = self.adapter.decide(self.now_us)
        try:
            self.plant.step(self.applied.left_n, self.applied.right_n)
        except PlantDiverged as error:
            self.error = str(error)
            self._finish(DriveOutcome.DIVERGED)
            return
        now_us = self.now_us
        linked = is_linked(self.scenario.faults, self.plant.sim_us * 1e-6)
        self._publish_measurements(now_us, linked=linked)
        self._update_estimate(now_us, linked=linked)
        self._update_evidence(now_us, linked=linked)
        self._publish_arming_and_pulses(now_us, linked=linked)
        thrust = self.autonomy.step()
        if thrust is not None and linked:
            self.adapter.offer(thrust, now_us)
        self._record_thrust_and_truth(now_us)
        self._update_phase(now_us)

    def close(self) -> None:
        """Release the plant and the source of evidence."""
        self.plant.close()
        if self._evidence_source is not None:
            self._evidence_source.close()

    def _compute_goal_m(self) -> float:
        length_m = self.progress.length_m
        rest_m = (
            length_m
            if self.scenario.world.route_closed
            else length_m - self.progress.start_arc_m - ROUTE_END_TOLERANCE_M
        )
        return min(self.scenario.task.distance_m or rest_m, rest_m)

    def _is_due(self, what: str) -> bool:
        return self.plant.steps % self._steps_between[what] == 0

    def _send(self, topic: keys.Topic[T], message: T, *, linked: bool) -> T:
        """Publish for the board, which hears it while its link holds; the message as sent."""
        sent = self._bus.put(topic, message)
        if linked:
            self.autonomy.deliver(topic, sent)
        return sent

    def _publish_measurements(self, now_us: int, *, linked: bool) -> None:
        if self._is_due("imu"):
            self._imu_samples.append(self._bus.put(keys.IMU, imu_message(self.plant, now_us)))
        if self._is_due("gps"):
            self._gps_fix = self._bus.put(keys.GPS, gps_message(self.plant, now_us))
        sensors = self.config.plant.sensors
        if sensors.ais and self._is_due("ais"):
            self._send(keys.AIS, ais_message(self.plant, now_us), linked=linked)
        if sensors.lidar and self._is_due("lidar"):
            self._send(keys.SCAN, scan_message(self.plant, now_us), linked=linked)
        if sensors.sonar and self._is_due("depth"):
            self._send(keys.DEPTH, depth_message(self.plant, now_us), linked=linked)

    def _update_estimate(self, now_us: int, *, linked: bool) -> None:
        if not self._is_due("estimate"):
            return
        local, odometry = self._estimator.step(self._imu_samples, self._gps_fix, now_us)
        self._imu_samples, self._gps_fix = [], None
        if self._bus.tap is not None:
            self._bus.put(keys.LOCAL_ODOMETRY, local)
        self._odometry = self._send(keys.ODOMETRY, odometry, linked=linked)

    def _update_evidence(self, now_us: int, *, linked: bool) -> None:
        if self._pending_evidence and now_us >= self._pending_evidence[0][0]:
            evidence = self._bus.put(keys.EVIDENCE, self._pending_evidence.pop(0)[1])
            self.history.record_evidence(evidence, now_us)
            self.autonomy.deliver(keys.EVIDENCE, evidence)
        if self._evidence_source is None or not linked or not self._is_due("look"):
            return
        header = m.PictureHeader(
            source_us=now_us,
            frame_seq=self.frames,
            frame_epoch=self._bus.epoch,
            width_px=self.config.eye.width_px,
            height_px=self.config.eye.height_px,
        )
        roll_rad = self._odometry.roll_rad if self._odometry is not None else 0.0
        frame = self._evidence_source.observe(pose_message(self.plant, now_us), header, roll_rad)
        if frame is None:
            return
        self.frames += 1
        self._pending_evidence.append((now_us + self._evidence_delay_us, frame.evidence))
        if self._bus.tap is not None:
            self._record_images(frame, header)

    def _record_images(self, frame: EvidenceFrame, header: m.PictureHeader) -> None:
        """Put picture and mask into the recording."""
        if frame.bgr is not None:
            quality = [cv2.IMWRITE_JPEG_QUALITY, self.config.camera.jpeg_quality]
            self._bus.put(keys.PICTURE, header, cv2.imencode(".jpg", frame.bgr, quality)[1].tobytes())
        if frame.mask is not None:
            height, width = frame.mask.shape
            mask_header = msgspec.structs.replace(header, width_px=width, height_px=height, media_type="image/png")
            self._bus.put(keys.MASK, mask_header, cv2.imencode(".png", frame.mask)[1].tobytes())

    def _publish_arming_and_pulses(self, now_us: int, *, linked: bool) -> None:
        """Publish arming, the pulses of the vital processes, and the plant's clock."""
        if self._is_due("arming"):
            arming = m.Arming(source_us=now_us, armed=self.phase is DrivePhase.RUNNING)
            self.adapter.receive_arming(self._send(keys.ARMING, arming, linked=linked), now_us)
        if self._is_due("pulse"):
            for service in self.config.plant.adapter.require_pulses:
                if linked or service not in keys.BOARD_SERVICES:
                    self.adapter.receive_pulse(service, now_us)
        if self._is_due("report"):
            clock = m.SimTime(source_us=now_us, sim_us=self.plant.sim_us, stamp_us=now_us)
            self._send(keys.SIM_TIME, clock, linked=linked)

    def _record_thrust_and_truth(self, now_us: int) -> None:
        """Record what the thrust adapter applies, and the true pose."""
        self._in_force.advance(self.applied, self.adapter.command, now_us)
        self.history.record_thrust(self.applied, self._in_force.command, now_us)
        if self._bus.tap is not None and self._is_due("report"):
            self._bus.put(keys.TRUE_POSE, pose_message(self.plant, now_us))
            applied = applied_message(self.adapter, self.applied, now_us, self._in_force)
            self._bus.put(keys.THRUST_APPLIED, applied)

    def _update_phase(self, now_us: int) -> None:
        """Advance the state machine of the drive, and take the samples that are scored."""
        if self._is_due("sample"):
            self.progress.update(self.plant.position_m)
            if self.phase is DrivePhase.RUNNING:
                self.history.record_sample(self.plant, self.progress, self.autonomy, self.applied)
        if self.phase is DrivePhase.READY:
            waited_s = self.plant.sim_us * 1e-6
            if waited_s >= MIN_READY_S and self._is_ready():
                self.phase, self.armed_us = DrivePhase.RUNNING, now_us
            elif waited_s >= MAX_READY_S:
                self._finish(DriveOutcome.NOT_READY)
        elif self.progress.best_progress_m >= self.goal_m - (
            REPORTED_END_TOLERANCE_M if self._is_route_finished() else 0.0
        ):
            self._finish(DriveOutcome.COMPLETED)
        elif self.elapsed_s >= self.time_limit_s:
            self._finish(DriveOutcome.TIME_LIMIT)
        elif self.progress.best_progress_m >= self._last_progress_m + STALL_PROGRESS_M:
            self._last_progress_s, self._last_progress_m = self.elapsed_s, self.progress.best_progress_m
        elif self.elapsed_s >= self._last_progress_s + STALL_TIME_S:
            self._finish(DriveOutcome.STALLED)

    def _is_ready(self) -> bool:
        """Whether nothing but arming or an advised stop keeps the boat from going."""
        command = self.autonomy.command
        waiting = {m.Inhibit.NOT_ARMED, m.Inhibit.ADVISED_STOP}
        return command is not None and bool(command.inhibits) and waiting.issuperset(command.inhibits)

    def _is_route_finished(self) -> bool:
        """Whether the navigator reports the end of the route."""
        command = self.autonomy.command
        done = {m.Inhibit.ROUTE_FINISHED, m.Inhibit.MISSION_DONE}
        return command is not None and not done.isdisjoint(command.inhibits)

    def _finish(self, outcome: DriveOutcome) -> None:
        self.phase, self.outcome = DrivePhase.FINISHED, outcome
