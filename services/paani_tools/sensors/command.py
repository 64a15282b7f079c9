"""`paani sensors`."""

from __future__ import annotations

import argparse
import asyncio
import math
import sys

import msgspec

from paani import keys
from paani import messages as m
from paani.cli import add_config_arguments, config_from
from paani.config import Config
from paani.errors import UserError
from paani.keys import Graph
from paani.option_numbers import seconds
from paani_tools.inspect.listen import observer
from paani_tools.sensors.text import device_line, missing

PATIENCE_S = 5.0  # five reports: longer means that the sensor process does not run


def main(argv: list[str]) -> int:
    """Show what the devices of a running hull say; 1 if one that is set was not in order at the end."""
    parser = argparse.ArgumentParser(
        prog="paani sensors",
        description="What each GPS, IMU and heading device of a running hull says, once a second, and what is missing. "
        "Exit code 1: at the end a device that is set was not in order.",
    )
    parser.add_argument("--for", dest="seconds", type=seconds, metavar="S", help="stop after S seconds")
    parser.add_argument("--json", action="store_true", help="one JSON object a second instead of lines")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    options.profile = options.profile or "hull"
    config = config_from(options)
    if config.bus.graph is not Graph.HULL:
        raise UserError(f"profile '{config.profile}': only a hull has devices; a simulation's are simulated")
    return asyncio.run(_show(config, options.seconds or math.inf, as_json=options.json))


async def _show(config: Config, seconds: float, *, as_json: bool) -> int:
    async with observer(config.bus) as bus:
        states, gps, imu = bus.queue(keys.SENSORS_STATE, 4), bus.latest(keys.GPS), bus.latest(keys.IMU)
        loop = asyncio.get_running_loop()
        end_s, state = loop.time() + seconds, None
        while loop.time() < end_s:
            try:
                async with asyncio.timeout(min(PATIENCE_S, end_s - loop.time())):
                    state = await states.get()
            except TimeoutError:
                if loop.time() < end_s or state is None:
                    raise UserError(
                        f"sensors/state: nothing on {config.bus.router} (does the process `sensors` run? "
                        "`paani up --profile hull` starts it)"
                    ) from None
                break
            sys.stdout.write(
                _as_json(state, gps.value, imu.value) if as_json else _as_text(state, gps.value, imu.value)
            )
            sys.stdout.flush()
        return int(state is None or not all(_is_in_order(device) for device in state.devices))


def _as_text(state: m.SensorsState, fix: m.GpsFix | None, sample: m.ImuSample | None) -> str:
    lines = [device_line(device, fix, sample) for device in state.devices]
    lines.append(missing(state.devices, sample))
    return "".join(f"{line}\n" for line in lines if line) + "\n"


def _as_json(state: m.SensorsState, fix: m.GpsFix | None, sample: m.ImuSample | None) -> str:
    row = {
        "devices": state.devices,
        "gps": fix,
        "imu": sample,
        "missing": missing(state.devices, sample),
    }
    return msgspec.json.encode(row).decode() + "\n"


def _is_in_order(device: m.SensorDevice) -> bool:
    return device.status in {m.SensorStatus.OFF, m.SensorStatus.OK}
