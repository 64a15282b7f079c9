"""`paani calibrate hull RECORDING --vessel NAME|FILE`: a vessel file from a recorded drive, or what the drive lacks."""

import argparse
import sys
from pathlib import Path

from msgspec.structs import replace

from paani.errors import UserError
from paani.option_numbers import quantity
from paani.option_paths import input_path, output_file, require_apart
from paani.statistics.figure_table import FigureTable, table_text
from paani.whole_file import write_whole
from paani_sim.vessels import VESSELS, Vessel, load_vessel
from paani_tools.calibrate.hull.drive import read_drive
from paani_tools.calibrate.hull.identify import CONFIDENCE, Estimate, Identification, identify
from paani_tools.calibrate.hull.vessel_text import settings_toml, vessel_toml

START_FORCE_N = 75.0  # O1: where the search for the thrust curve begins
MAX_MASS_KG = 1e5
REQUIRED = {
    "thrust_linear": "step the thrust from rest to several levels",
    "thrust_quadratic": "step the thrust from rest to several levels, the largest too",
    "surge_linear": "drive slowly for a while, and let the boat coast",
    "surge_quadratic": "drive fast for a while",
    "yaw_linear": "turn gently, to both sides",
    "yaw_quadratic": "turn hard, to both sides",
    "yaw_inertia": "change the side of the turn abruptly, several times",
}
UNITS = {
    "thrust_linear": "N", "thrust_quadratic": "N", "astern_ratio": "", "surge_linear": "N s/m",
    "surge_quadratic": "N s2/m2", "sway_linear": "N s/m", "sway_quadratic": "N s2/m2", "yaw_linear": "N m s",
    "yaw_quadratic": "N m s2", "yaw_inertia": "kg m2", "current_east": "m/s", "current_north": "m/s",
    "gyro_bias": "rad/s", "heading_offset": "rad",
}  # fmt: skip
MAY_BE_NEGATIVE = frozenset({"thrust_quadratic", "current_east", "current_north", "gyro_bias", "heading_offset"})


def main(argv: list[str]) -> int:
    """Exit codes: 0 identified, 1 the drive does not determine everything (nothing is written), 2 user's mistake."""
    options = _parser().parse_args(argv)
    if options.settings is not None and options.out is None:
        raise UserError("--settings: names the vessel's file, so --out is needed too")
    vessel = _vessel(options)
    written = {"--out": options.out, "--settings": options.settings}
    require_apart(written, (options.recording, *((Path(options.vessel),) if options.vessel not in VESSELS else ())))
    found = identify(read_drive(options.recording), vessel, START_FORCE_N)
    sys.stdout.write(table_text(estimate_table(found, options.vessel)))
    if lacking := undetermined(found):
        for name in lacking:
            sys.stderr.write(f"paani: {name} is not determined by this drive: {REQUIRED[name]}\n")
        return 1
    if options.out is not None:
        write_whole(options.out, vessel_toml(vessel, found, options.vessel).encode(), "--out")
    if options.settings is not None:
        write_whole(options.settings, settings_toml(found, str(options.out.absolute())).encode(), "--settings")
    return 0


def undetermined(found: Identification) -> list[str]:
    """What a vessel file needs and the drive does not tell, or tells to be negative."""
    return [name for name in REQUIRED if not found.estimates[name].excited or _is_negative(name, found.estimates[name])]


def estimate_table(found: Identification, base: str) -> FigureTable:
    """Every parameter with its interval, and how well the model follows the drive."""
    percent = 100 * CONFIDENCE
    return FigureTable(
        name=f"{found.seconds:.0f} s of driving, up to {found.fastest[0]:.2f} m/s and {found.fastest[2]:.2f} rad/s",
        columns=("parameter", "value", "std error", f"{percent:.0f} % from", "to", "unit", "note"),
        rows=tuple(_row(name, estimate, base) for name, estimate in found.estimates.items()),
        note=(
            f"left over: {found.speed_residual_mps:.3f} m/s of GPS, {found.rate_residual_radps:.4f} rad/s of gyro,"
            f" {found.samples} samples, {found.outliers} outliers left out."
            f" A fan as a straight line: {found.force_per_unit_n:.1f} N at full thrust."
        ),
    )


def _row(
    name: str, estimate: Estimate, base: str
) -> tuple[str, float, float | None, float | None, float | None, str, str]:
    if estimate.fixed:
        return name, estimate.value, None, None, None, UNITS[name], f"not determined by the drive; as vessel {base}"
    note = "" if estimate.excited or name not in REQUIRED else "not determined by the drive"
    if _is_negative(name, estimate):
        note = "negative, so the model does not fit"
    return name, estimate.value, estimate.std_error, estimate.low, estimate.high, UNITS[name], note


def _is_negative(name: str, estimate: Estimate) -> bool:
    return name not in MAY_BE_NEGATIVE and estimate.high < 0.0


def _vessel(options: argparse.Namespace) -> Vessel:
    vessel = load_vessel(options.vessel)
    if options.mass_kg is None:
        return vessel
    return replace(vessel, hull=replace(vessel.hull, mass_kg=options.mass_kg))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani calibrate hull",
        description="Drag, yaw inertia and thrust curve of a hull, by least squares from a recorded drive.",
    )
    parser.add_argument(
        "recording", type=input_path(), help="a drive on calm water: several speeds, turns to both sides"
    )
    parser.add_argument(
        "--vessel",
        required=True,
        metavar="NAME|FILE",
        help=f"mass, fans and added mass, which no drive tells apart: {', '.join(VESSELS)} or a TOML file",
    )
    parser.add_argument(
        "--mass-kg",
        type=quantity("kg", high=MAX_MASS_KG),
        metavar="KG",
        help="the boat's mass as weighed (default: the vessel's)",
    )
    parser.add_argument("--out", type=output_file("--out"), metavar="FILE", help="write the vessel here (TOML)")
    parser.add_argument(
        "--settings", type=output_file("--settings"), metavar="FILE", help="write settings that use it here (TOML)"
    )
    return parser
