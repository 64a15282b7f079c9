"""All devices of a hull together: bytes of their lines in, fixes and samples out. Pure.

`now_us`, and so every stamp that comes out, is by a clock that is never set; `Reading.dated` makes stamps of the wall
clock. Data that cannot be believed are withheld, so that who needs them finds them stale and stops the boat.
"""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import msgspec

from paani.config import SensorDevicesConfig
from paani.messages import AisVessel, Depth, GpsFix, ImuSample, Message, RangeScan, SensorDevice, SensorRole
from paani_services.sensors.ais_reports import SENTENCE, AisReports
from paani_services.sensors.depth_sentences import DEPTH_SENTENCES, DepthDecoder
from paani_services.sensors.device import Device, Line
from paani_services.sensors.fixes import FixDecoder
from paani_services.sensors.framing import Frame, Framer, Protocol
from paani_services.sensors.freezing import (
    REPEATED_TIMES,
    GravityWatch,
    HeadingWatch,
    PositionWatch,
    SampleWatch,
    TurnWatch,
)
from paani_services.sensors.heading import SourceChoice, YawKeeper, read_heading, true_yaw_rad
from paani_services.sensors.inertial import InertialSample, Mounting, imu_message, read_sample
from paani_services.sensors.lidar_packets import TurnAssembler, scan_message
from paani_services.sensors.receipt_clock import ReceiptClock
from paani_services.sensors.sentences import ChecksumError, Sentence, read_sentence

FIX_SENTENCES = frozenset({"RMC", "GGA", "GLL", "VTG", "GST"})
HEADING_SENTENCES = frozenset({"HDT", "THS", "HDG", "HDM"})
SAMPLE_SENTENCES = frozenset({"PQTMIMU", "VNYMR"})
PACKET = "LDROBOT"
MAX_KINDS, MAX_KIND = 64, 12  # kinds of frames remembered, and characters of one: a line may say anything
NO_GRAVITY = "its acceleration is not that of gravity: does it write m/s^2, and is it upright? Its data are withheld"
LATE = "its data come over a second late: they are withheld"
MAX_SPACING_US = 200_000  # between samples that come in one piece: no inertial unit is slower than 5 Hz

M = TypeVar("M", bound=Message)


class Reading(NamedTuple):
    """What to publish."""

    fixes: tuple[GpsFix, ...] = ()
    samples: tuple[ImuSample, ...] = ()
    scans: tuple[RangeScan, ...] = ()
    depths: tuple[Depth, ...] = ()

    def dated(self, offset_us: int) -> "Reading":
        """The same by a clock that is so much ahead."""
        return Reading(
            tuple(_dated(each, offset_us) for each in self.fixes),
            tuple(_dated(each, offset_us) for each in self.samples),
            tuple(_dated(each, offset_us) for each in self.scans),
            tuple(_dated(each, offset_us) for each in self.depths),
        )


def _dated(message: M, offset_us: int) -> M:
    return msgspec.structs.replace(message, source_us=max(message.source_us + offset_us, 0))


class SensorSuite:
    """The devices that the settings name. `lines` are the addresses to open, each once."""

    def __init__(self, config: SensorDevicesConfig) -> None:
        self._config = config
        self.drops = Counter[str]()
        """What was refused since the process began, by cause."""
        named = {SensorRole(role): line for role, line in config.lines.items()}
        self._lines = {address: Line(address) for address in named.values() if address}
        self._framers = {address: Framer() for address in self._lines}
        self._turns, self._turn_watch = TurnAssembler(config.lidar), TurnWatch()
        self._devices = {role: Device(role, self._lines.get(address)) for role, address in named.items()}
        self._fixes, self._position_watch = FixDecoder(self.drops), PositionWatch()
        self._fix_clock, self._fix_us = ReceiptClock(), 0
        imu = config.imu
        self._mounting = Mounting(imu.mount_roll_deg, imu.mount_pitch_deg, imu.mount_yaw_deg)
        self._sample_watch, self._gravity_watch, self._sample_us = SampleWatch(), GravityWatch(), 0
        self._sample_clock, self._device_ms = ReceiptClock(), 0
        self._heading_watch, self._yaw = HeadingWatch(), YawKeeper(config.heading.max_age_s)
        self._heading_choice = SourceChoice(config.heading.max_age_s)
        self._ais = AisReports(self.drops, config.ais.own_mmsi)
        self._depths = DepthDecoder(self.drops, config.sonar.transducer_m)

    @property
    def lines(self) -> Mapping[str, Line]:
        """Every line by its address."""
        return self._lines

    def opened(self, address: str, now_us: int) -> None:
        """A line was opened: begin with its devices anew."""
        self._lines[address].opened(now_us)
        self._framers[address] = Framer()
        for device in self._on(address):
            device.reset()
            match device.role:
                case SensorRole.GPS:
                    self._fixes, self._position_watch = FixDecoder(self.drops), PositionWatch()
                    self._fix_clock = ReceiptClock()
                case SensorRole.IMU:
                    self._sample_watch, self._gravity_watch = SampleWatch(), GravityWatch()
                    self._sample_clock, self._device_ms = ReceiptClock(), 0
                case SensorRole.LIDAR:
                    self._turns, self._turn_watch = TurnAssembler(self._config.lidar), TurnWatch()
                case SensorRole.HEADING:
                    self._heading_watch = HeadingWatch()
                    self._heading_choice = SourceChoice(self._config.heading.max_age_s)
                    self._yaw.forget()
                case SensorRole.SONAR:
                    self._depths = DepthDecoder(self.drops, self._config.sonar.transducer_m)

    def lost(self, address: str, problem: str) -> None:
        """A line cannot be opened, or is gone."""
        self._lines[address].lost(problem)

    def take(self, address: str, data: bytes, now_us: int) -> Reading:
        """What the bytes of a line say that have just come."""
        line, framer = self._lines[address], self._framers[address]
        line.bytes += len(data)
        line.last_byte_us = now_us
        lidar = self._devices[SensorRole.LIDAR]
        if lidar.line is line:
            return self._take_turns(lidar, line, data, now_us)
        before = framer.cut_sentences, framer.ubx_failures
        fixes, samples, depths = list[GpsFix](), list[InertialSample](), list[Depth]()
        for frame in framer.feed(data):
            try:
                self._take_frame(line, frame, now_us, fixes, samples, depths)
            except ChecksumError:
                line.checksum_failures += 1
                self.drops["nmea_checksum"] += 1
            except ValueError:
                line.damaged += 1
                self.drops[f"{frame.protocol.lower()}_damaged"] += 1
        cut, failed = framer.cut_sentences - before[0], framer.ubx_failures - before[1]
        line.damaged, line.checksum_failures = line.damaged + cut, line.checksum_failures + failed
        self.drops += Counter(nmea_damaged=cut, ubx_checksum=failed)
        return Reading(tuple(fixes), self._stamped(samples, now_us), depths=tuple(depths))

    def _take_turns(self, device: Device, line: Line, data: bytes, now_us: int) -> Reading:
        """The scans that the bytes of the range scanner's own line complete."""
        packets, failures = self._turns.packets, self._turns.checksum_failures
        turns = self._turns.feed(data)
        for _ in range(self._turns.packets - packets):
            _count_frame(line, PACKET, now_us)
        line.checksum_failures += self._turns.checksum_failures - failures
        self.drops += Counter(lidar_checksum=self._turns.checksum_failures - failures)
        scans = []
        for turn in turns:
            is_frozen = self._turn_watch.take(turn.ranges_m)
            device.frozen_cause = "the scanner repeats one turn: its data are withheld" if is_frozen else ""
            if is_frozen:
                device.withheld += 1
                self.drops["lidar_frozen"] += 1
            else:
                device.count_data(now_us)
                scans.append(scan_message(turn, self._config.lidar, now_us))
        return Reading(scans=tuple(scans))

    def vessels(self, now_us: int) -> tuple[AisVessel, ...] | None:
        """Those that the AIS receiver has heard; None while there is no receiver."""
        line = self._devices[SensorRole.AIS].line
        return None if line is None or line.problem else self._ais.vessels(now_us)

    def report(self, now_us: int) -> tuple[SensorDevice, ...]:
        """Every device, whether it is set or not."""
        return tuple(device.report(now_us) for device in self._devices.values())

    def _on(self, address: str) -> list[Device]:
        return [each for each in self._devices.values() if each.line is self._lines[address]]

    def _take_frame(
        self,
        line: Line,
        frame: Frame,
        now_us: int,
        fixes: list[GpsFix],
        samples: list[InertialSample],
        depths: list[Depth],
    ) -> None:
        roles = (SensorRole.GPS, SensorRole.IMU, SensorRole.HEADING, SensorRole.AIS, SensorRole.SONAR)
        gps, imu, heading, ais, sonar = (self._devices[role] for role in roles)
        is_gps = gps.line is line
        protocol = self._config.gps.protocol if is_gps else "auto"
        if protocol not in {"auto", frame.protocol.lower()}:
            line.foreign = frame.protocol
            return
        if frame.protocol is Protocol.UBX:
            _count_frame(line, f"UBX-{frame.data[2]:02X}-{frame.data[3]:02X}", now_us)
            if is_gps:
                fixes += self._use_fix(gps, self._fixes.take_ubx(frame.data), now_us)
            return
        kind, sentence = read_sentence(frame.data)
        _count_frame(line, kind, now_us)
        if ais.line is line and kind == SENTENCE and self._ais.take_sentence(frame.data, now_us):
            ais.count_data(now_us)
        if sentence is None:
            return
        if is_gps and kind in FIX_SENTENCES:
            fixes += self._use_fix(gps, self._fixes.take_sentence(sentence), now_us)
        elif imu.line is line and kind in SAMPLE_SENTENCES:
            samples.append(self._mounting.turn(read_sample(sentence)))
        elif heading.line is line and kind in HEADING_SENTENCES:
            self._use_heading(heading, sentence, now_us)
        elif sonar.line is line and kind in DEPTH_SENTENCES:
            sounding = self._depths.take_sentence(sentence, now_us)
            if sounding is not None:
                sonar.count_data(now_us)
                depths.append(sounding)

    def _use_fix(self, gps: Device, fix: GpsFix | None, now_us: int) -> list[GpsFix]:
        if fix is None:
            if self._fixes.repeats >= REPEATED_TIMES:
                gps.frozen_cause = "the receiver repeats one time: its data are withheld"
                gps.withheld += 1
            return []
        gps.frozen_cause = ""
        if self._position_watch.take(fix):
            gps.frozen_cause = "the position stands although the speed says that it moves: its data are withheld"
            gps.withheld += 1
            self.drops["gps_frozen"] += 1
            return []
        if self._fixes.was_set:
            self._fix_clock = ReceiptClock()
        at_us: int | None = now_us  # a receiver without a position may have no time either
        if fix.fix:
            self._fix_clock.observe(fix.source_us, now_us)
            at_us = self._fix_clock.date(fix.source_us)
        if at_us is None:
            gps.withheld += 1
            gps.problem = LATE
            self.drops["gps_old"] += 1
            return []
        gps.has_fix = fix.fix
        gps.count_data(now_us)
        self._fix_us = max(at_us - round(self._config.gps.latency_s * 1e6), self._fix_us + 1, 0)
        return [msgspec.structs.replace(fix, source_us=self._fix_us)]

    def _use_heading(self, device: Device, sentence: Sentence, now_us: int) -> None:
        config = self._config
        yaw_rad, problem = read_heading(sentence, config.variation_deg, config.heading.offset_deg)
        if yaw_rad is None:
            device.problem = problem
            return
        if not self._heading_choice.takes(sentence, now_us):
            return
        self._heading_watch.take_heading(yaw_rad)
        self._yaw.take_heading(yaw_rad, now_us)
        if device.frozen_cause:
            device.withheld += 1
        else:
            device.count_data(now_us)

    def _stamped(self, samples: list[InertialSample], now_us: int) -> tuple[ImuSample, ...]:
        """The samples of one piece, each at its time."""
        imu, heading = self._devices[SensorRole.IMU], self._devices[SensorRole.HEADING]
        messages = []
        for sample, measured_us in zip(samples, self._times_us(samples, now_us), strict=True):
            if measured_us is None:
                imu.withheld += 1
                imu.problem = LATE
                self.drops["imu_old"] += 1
                continue
            at_us = self._sample_us = max(measured_us, self._sample_us + 1)
            is_frozen = self._sample_watch.take(sample, at_us)
            is_implausible = self._gravity_watch.take(sample)
            imu.frozen_cause = "the unit repeats one sample: its data are withheld" if is_frozen else ""
            imu.implausible_cause = NO_GRAVITY if is_implausible else ""
            yaw_rad = self._yaw_at(heading, sample, at_us)
            if is_frozen or is_implausible:
                imu.withheld += 1
                self.drops["imu_frozen" if is_frozen else "imu_implausible"] += 1
                continue
            imu.count_data(now_us)
            messages.append(imu_message(sample, at_us, yaw_rad))
        return tuple(messages)

    def _times_us(self, samples: list[InertialSample], now_us: int) -> list[int | None]:
        """When the samples of one piece were measured: by the unit's clock, or else evenly since the piece before."""
        if not samples:
            return []
        times_ms = [sample.device_ms for sample in samples if sample.device_ms is not None]
        if len(times_ms) < len(samples):
            spacing_us = min((now_us - self._sample_us) // len(samples), MAX_SPACING_US)
            return [now_us - number * spacing_us for number in reversed(range(len(samples)))]
        if times_ms != sorted(times_ms) or times_ms[0] < self._device_ms:
            self._sample_clock = ReceiptClock()  # the unit began anew
        self._device_ms = times_ms[-1]
        self._sample_clock.observe(max(times_ms) * 1000, now_us)
        return [self._sample_clock.date(time_ms * 1000) for time_ms in times_ms]

    def _yaw_at(self, heading: Device, sample: InertialSample, at_us: int) -> float | None:
        """Yaw of the boat at a sample; None while nothing tells it."""
        if heading.line is None:
            yaw_rad = sample.attitude_rad[2] if sample.attitude_rad else None
            return None if yaw_rad is None else true_yaw_rad(yaw_rad, self._config.imu.yaw, self._config.variation_deg)
        if self._heading_watch.take_sample(sample.gyro_radps[2], at_us):
            heading.frozen_cause = "the heading stands although the gyro turns: it is withheld"
            self._yaw.forget()
        else:
            heading.frozen_cause = ""
        return self._yaw.take_sample(sample.gyro_radps[2], at_us)


def _count_frame(line: Line, kind: str, now_us: int) -> None:
    line.frames += 1
    if kind in line.kinds or len(line.kinds) < MAX_KINDS:
        line.kinds[kind[:MAX_KIND]] += 1
    line.last_frame_us = now_us
