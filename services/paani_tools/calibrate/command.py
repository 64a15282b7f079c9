"""`paani calibrate RECORDING|--live SECONDS --shore-m METRES`: a calibration section for the boat's settings.

`paani calibrate hull` and the like are commands of their own.
"""

import argparse
import asyncio
import importlib
import sys

from paani.cli import add_config_arguments, config_from
from paani.config import CalibrationConfig
from paani.errors import UserError
from paani.option_numbers import quantity
from paani.option_paths import input_path, output_file, require_apart
from paani.whole_file import write_whole
from paani_tools.calibrate.gather import collect_live, collect_recorded, waterline_observations
from paani_tools.calibrate.mount import Mount, estimate_mount

MAX_SECONDS = 3600.0
COMMANDS = {
    "hull": "paani_tools.calibrate.hull.command",
    "thrusters": "paani_tools.calibrate.thrusters.command",
}
"""What else is calibrated, by the first word, and the module whose `main` does it."""


def main(argv: list[str]) -> int:
    """Print what was found, and write it. Raises UserError for input that cannot calibrate; then nothing is written."""
    if argv and argv[0] in COMMANDS:
        return int(importlib.import_module(COMMANDS[argv[0]]).main(argv[1:]))
    options = _parser().parse_args(argv)
    config = config_from(options)
    require_apart({"--out": options.out}, (options.recording, options.config))
    if (options.recording is None) == (options.live is None):
        raise UserError("name a recording, or --live SECONDS")
    for name in ("hfov_deg", "height_m"):
        if getattr(config.calibration, name) <= 0.0:
            raise UserError(f"calibration.{name} is not known (--set calibration.{name}=...)")
    if options.live is not None:
        collected = asyncio.run(collect_live(config.bus, options.live))
    else:
        collected = collect_recorded(options.recording)
    mount = estimate_mount(waterline_observations(*collected), config.calibration, options.shore_m)
    sys.stdout.write(
        f"pitch_down_deg {mount.pitch_down_deg:.2f}, roll_deg {mount.roll_deg:.2f}; {mount.pictures} pictures,"
        f" {mount.spread_deg:.2f} degrees between them, {mount.residual_deg:.2f} between columns\n"
    )
    if options.out is not None:
        write_whole(options.out, calibration_toml(config.calibration, mount).encode(), "--out")
    return 0


def calibration_toml(calibration: CalibrationConfig, mount: Mount) -> str:
    """The section as TOML, for `paani up --config`."""
    centre = ", ".join(f"{part:g}" for part in calibration.centre_frac)
    return (
        "[calibration]\n"
        "valid = true\n"
        f"hfov_deg = {calibration.hfov_deg:g}\n"
        f"centre_frac = [{centre}]\n"
        f"height_m = {calibration.height_m:g}\n"
        f"forward_m = {calibration.forward_m:g}\n"
        f"pitch_down_deg = {mount.pitch_down_deg:.3f}\n"
        f"roll_deg = {mount.roll_deg:.3f}\n"
        f"yaw_deg = {calibration.yaw_deg:g}\n"
        f'measured_by = "paani calibrate: {mount.pictures} pictures, {mount.spread_deg:.2f} degrees between them"\n'
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani calibrate",
        description="Pitch and roll of the camera's mount, from the far waterline and the boat's roll and pitch. "
        f"For the rest of the boat: {', '.join(f'paani calibrate {name}' for name in COMMANDS)}.",
    )
    parser.add_argument("recording", type=input_path(), nargs="?", help="a recording of the moored or slow boat")
    parser.add_argument(
        "--live",
        type=quantity("seconds", 1.0, MAX_SECONDS, with_low=True),
        metavar="SECONDS",
        help="listen to the running boat instead",
    )
    parser.add_argument(
        "--shore-m",
        type=quantity("metres", 0.0, 1e6),
        required=True,
        metavar="METRES",
        help="how far away the shore in the picture is",
    )
    parser.add_argument(
        "--out", type=output_file("--out"), metavar="FILE", help="write the calibration section here (TOML)"
    )
    add_config_arguments(parser)
    return parser
