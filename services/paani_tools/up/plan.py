"""What one start runs, with which settings."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from paani.bus.routing import require_free
from paani.config import Config, calibration_of
from paani.errors import UserError
from paani.runtime import runtime_dir

EXPORT_ROUTE = "paani_sim.worlds.export_route"  # run as a module: the contract imports no simulator
EYE = "eye"


class Plan(NamedTuple):
    """Services in the order they start, and the settings all of them are handed."""

    services: tuple[str, ...]
    config: Config


class _Course(NamedTuple):
    """Files of route and fence ("": none), and where the map's (0, 0) lies [deg]."""

    route: str
    fence: str
    origin_lat_lon_deg: tuple[float, float]


async def make_plan(config: Config) -> Plan:
    """Complete the settings. Raises UserError for what can be known before anything starts.

    The scenario's route, fence and origin are handed to navigator and localization unless they have their own.
    With a camera other than `sim` there is no eye, and the thrust adapter does not wait for its pulse; with `sim` the
    calibration is the eye's, unless another is given as valid.
    """
    require_free(config.bus.router)
    await _require_source(config.camera.source)
    if config.dashboard.serve:
        await _require_free_page(config)
    course = await _course(config)
    navigator, localization = config.navigator, config.localization
    if not navigator.route:
        navigator = replace(navigator, route=course.route)
    if not navigator.fence:
        navigator = replace(navigator, fence=course.fence)
    if localization.origin_lat_lon_deg is None:
        localization = replace(localization, origin_lat_lon_deg=course.origin_lat_lon_deg)
    config = replace(config, navigator=navigator, localization=localization)
    if config.camera.source == "sim":
        calibration = config.calibration if config.calibration.valid else calibration_of(config.eye)
        return Plan(config.services, replace(config, calibration=calibration))
    adapter = config.plant.adapter
    adapter = replace(adapter, require_pulses=tuple(name for name in adapter.require_pulses if name != EYE))
    config = replace(config, plant=replace(config.plant, adapter=adapter))
    return Plan(config.services, config)


async def _require_source(source: str) -> None:
    if source != "sim" and not source.startswith("webcam") and not await asyncio.to_thread(Path(source).exists):
        raise UserError(f"camera.source {source}: no such file or folder")


async def _require_free_page(config: Config) -> None:
    host, port = config.dashboard.host, config.dashboard.port
    try:
        server = await asyncio.get_running_loop().create_server(asyncio.Protocol, host, port)
    except OSError as error:
        raise UserError(f"dashboard.port {port}: {error.strerror}") from error
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
