"""What one start runs, with which settings."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from paani.bus.routing import require_addresses, require_free
from paani.certificates import page_server_tls
from paani.config import CameraConfig, Config, calibration_of
from paani.errors import UserError
from paani.extras import require_modules
from paani.keys import Graph
from paani.page_address import is_page_exposed
from paani.runtime import require_unowned_runtime_dir, runtime_dir
from paani_services.camera.picture_sources import read_frames
from paani_services.navigator.files.mission_file import load_route_and_mission

EXPORT_ROUTE = "paani_sim.worlds.export_route"  # run as a module: the contract imports no simulator
EYE = "eye"
# Modules of extras, by service.
NEEDED = {
    "plant": ("mujoco",),
    EYE: ("OpenGL",),
    "localization": ("filterpy",),
    "mavlink": ("pymavlink",),
    "foxglove": ("foxglove",),
    "ros2": ("rosbags",),
}


class Plan(NamedTuple):
    """Services in the order they start, and the settings all of them are handed."""

    services: tuple[str, ...]
    config: Config


class _Course(NamedTuple):
    """Files of route and fence ("": none), and where the map's (0, 0) lies [deg]; None: at the first fix."""

    route: str
    fence: str
    origin_lat_lon_deg: tuple[float, float] | None


async def make_plan(config: Config) -> Plan:
    """What starts on this machine. Raises UserError for what can be known before anything starts."""
    await asyncio.to_thread(require_addresses, config.bus)
    if "operator" in config.services:
        await asyncio.to_thread(require_unowned_runtime_dir, config.bus)
    if config.dashboard.serve and "dashboard" in config.services:
        if is_page_exposed(config):
            await asyncio.to_thread(page_server_tls, config.bus)
        await _require_free_page(config)
    if "ros2" in config.services:
        await asyncio.to_thread(require_free, "ros2.listen", config.ros2.listen)
    return await complete_plan(config)


async def complete_plan(config: Config) -> Plan:
    """Complete the settings, wherever the addresses in them are. Raises UserError.

    The scenario's route, fence and origin are handed to navigator and localization unless they have their own. A hull
    has no scenario: its route is given, and without an origin of its own the map's is the first fix. Of board and host
    this concerns the one where the navigator runs.
    With a camera other than `sim` there is no eye, and the thrust adapter does not wait for its pulse; with `sim` the
    calibration is the eye's, unless another is given as valid.
    """
    require_modules("up", *(module for name in config.services for module in NEEDED.get(name, ())))
    if "camera" in config.services:
        await asyncio.to_thread(_require_source, config.camera)
    _require_lines(config)
    config = await _with_course(config) if "navigator" in config.services else config
    if config.camera.source == "sim":
        calibration = config.calibration if config.calibration.valid else calibration_of(config.eye)
        return Plan(config.services, replace(config, calibration=calibration))
    adapter = config.plant.adapter
    adapter = replace(adapter, require_pulses=tuple(name for name in adapter.require_pulses if name != EYE))
    config = replace(config, plant=replace(config.plant, adapter=adapter))
    return Plan(config.services, config)


async def _with_course(config: Config) -> Config:
    """Hand route, fence and origin to navigator and localization, unless they have their own."""
    navigator, localization = config.navigator, config.localization
    if config.bus.graph is Graph.HULL:
        if not navigator.route and not navigator.mission:
            raise UserError("navigator.route: not set (a hull follows a route or a mission of its own: --mission FILE)")
        course = _Course(navigator.route, navigator.fence, localization.origin_lat_lon_deg)
    else:
        course = await _course(config)
    if not navigator.route:
        navigator = replace(navigator, route=course.route)
    if not navigator.fence:
        navigator = replace(navigator, fence=course.fence)
    if localization.origin_lat_lon_deg is None:
        localization = replace(localization, origin_lat_lon_deg=course.origin_lat_lon_deg)
    await asyncio.to_thread(load_route_and_mission, navigator, localization.origin_lat_lon_deg)
    return replace(config, navigator=navigator, localization=localization)


def _require_lines(config: Config) -> None:
    """Raises UserError where thrust goes to a microcontroller and nobody has said where that is."""
    graph = config.bus.graph
    if "thrusters" in config.services and not config.thrusters.is_connected:
        raise UserError(f"thrusters.line: not set (profile {config.profile} drives a microcontroller)")
    if graph is Graph.HIL and "plant" in config.services and not config.plant.pwm_line:
        raise UserError("plant.pwm_line: not set (the emulator's bench port, by which profile hil moves the boat)")


def _require_source(camera: CameraConfig) -> None:
    """Raises UserError for files without a picture; a webcam is opened by its service alone."""
    if not camera.is_recording:
        return
    try:
        next(read_frames(Path(camera.source), camera), None)
    except UserError as error:
        raise UserError(f"camera.source {error}") from error


async def _require_free_page(config: Config) -> None:
    host, port = config.dashboard.host, config.dashboard.port
    try:
        server = await asyncio.get_running_loop().create_server(asyncio.Protocol, host, port)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise UserError(f"dashboard.port {port}: {error.strerror}") from error
        raise UserError(
            f"dashboard.port {port}: in use by another program, perhaps another `paani up`: stop that, or choose "
            f"another port (--set dashboard.port={port + 1})"
        ) from error
    server.close()
    await server.wait_closed()


async def _course(config: Config) -> _Course:
    """What the scenario hands over, as files in the runtime folder."""
    folder = await asyncio.to_thread(runtime_dir, config.bus)
    route, fence = folder / "route.toml", folder / "fence.toml"
    await asyncio.to_thread(fence.unlink, missing_ok=True)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", EXPORT_ROUTE, config.world.name, str(route), str(fence), stderr=asyncio.subprocess.PIPE
    )
    try:
        _, errors = await process.communicate()
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
    if process.returncode:
        lines = errors.decode(errors="replace").strip().splitlines() or [f"world.name {config.world.name}: no route"]
        raise UserError(lines[-1])
    origin = tomllib.loads(await asyncio.to_thread(route.read_text, encoding="utf-8"))["origin"]
    fenced = await asyncio.to_thread(fence.exists)
    return _Course(str(route), str(fence) if fenced else "", (origin["latitude_deg"], origin["longitude_deg"]))
