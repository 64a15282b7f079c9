"""Camera and serial lines. A line is not opened: that resets some microcontrollers, and takes it from who has it."""

from __future__ import annotations

import contextlib
import os
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

from paani.config import Config
from paani.config.sensors import recording_of
from paani.errors import UserError
from paani.port_address import is_router, parse_address
from paani_services.camera.picture_sources import Webcam, parse_webcam_index, read_frames
from paani_tools.doctor.finding import Verdict, failed, passed

REACH_S = 2.0


def check_camera(config: Config) -> Iterator[Verdict]:
    """The first picture of the source."""
    camera = config.camera
    if "camera" not in config.services:
        yield passed("not on this machine")
    elif camera.source == "sim":
        yield passed("simulated")
    elif (index := parse_webcam_index(camera.source)) is not None:
        yield _webcam(config, index)
    else:
        frame = next(read_frames(Path(camera.source), camera), None)
        if frame is None:
            yield failed(f"camera.source {camera.source}: holds no picture")
        else:
            yield passed(f"{camera.source}: gives pictures")


def _webcam(config: Config, index: int) -> Verdict:
    device = Path(f"/dev/video{index}")
    if device.exists() and not os.access(device, os.R_OK | os.W_OK):
        return failed(f"camera.source webcam:{index}: may not use {device}", _group_remedy(device))
    try:
        Webcam(index, config.camera.width_px, config.camera.height_px).close()
    except UserError as error:
        there = ", ".join(str(path) for path in sorted(Path("/dev").glob("video*")))
        wanted = f"cameras here: {there}" if there else "plug it in; no camera is here"
        return failed(str(error), wanted if not device.exists() else "stop what else uses it, or plug it in again")
    return passed(f"{device}: gives pictures")


def check_serial(config: Config) -> Iterator[Verdict]:
    """Every line that is set: there, and ours to read and write."""
    lines = {
        "bridge.line": config.bridge.line,
        "thrusters.line": config.thrusters.line,
        "thrusters.autopilot.line": config.thrusters.autopilot.line,
        "plant.pwm_line": config.plant.pwm_line,
        **{f"sensors.{role}.line": line for role, line in config.sensors.lines.items()},
    }
    if not any(lines.values()):
        yield passed("no line is set")
    for setting, line in lines.items():
        if line:
            yield _line(setting, line)


def _line(setting: str, line: str) -> Verdict:
    if line.startswith("file:"):
        path = Path(recording_of(line)[0])
        return passed(f"{setting} {path}: is there") if path.is_file() else failed(f"{setting} {path}: no such file")
    if is_router(line):
        return _device(setting, Path(line.partition(":")[2]), stat.S_ISSOCK, "start the board's router")
    device, baud = parse_address(line)
    if baud:
        there = ", ".join(str(path) for kind in ("ttyACM*", "ttyUSB*") for path in sorted(Path("/dev").glob(kind)))
        return _device(setting, Path(device), stat.S_ISCHR, f"serial devices here: {there or 'none; plug it in'}")
    host, _, port = device.rpartition(":")
    with contextlib.suppress(OSError), socket.create_connection((host.strip("[]"), int(port)), REACH_S):
        return passed(f"{setting} {line}: answers")
    return failed(f"{setting} {line}: does not answer", "start what is to listen there")


def _device(setting: str, device: Path, is_kind: Callable[[int], bool], absent_remedy: str) -> Verdict:
    if not device.exists():
        return failed(f"{setting} {device}: not there", absent_remedy)
    if not is_kind(device.stat().st_mode):
        return failed(f"{setting} {device}: is no device", absent_remedy)
    if not os.access(device, os.R_OK | os.W_OK):
        return failed(f"{setting} {device}: may not be used", _group_remedy(device))
    return passed(f"{setting} {device}: there")


def _group_remedy(device: Path) -> str:
    with contextlib.suppress(KeyError, OSError):
        return f"sudo usermod -aG {device.group()} $USER, then log in again"
    return "ask this machine's administrator for the device"
