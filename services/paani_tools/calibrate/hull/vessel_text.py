"""The identified hull as a vessel file, and the settings that belong to its thrust. Pure."""

from __future__ import annotations

import msgspec

from paani_sim.vessels import Vessel
from paani_tools.calibrate.hull.identify import CONFIDENCE, Identification

FIELD_OF = {
    ("hull", "yaw_inertia_kgm2"): "yaw_inertia",
    **{
        ("drag", f"{axis}_{order}"): f"{axis}_{order}"
        for axis in ("surge", "sway", "yaw")
        for order in ("linear", "quadratic")
    },
}
"""Fields of a vessel that a drive identifies, and the parameter of each."""


def identified_vessel(vessel: Vessel, found: Identification) -> Vessel:
    """The vessel with every coefficient that the drive determines; none is below 0."""
    values = msgspec.to_builtins(vessel)
    for (section, field), name in FIELD_OF.items():
        if found.estimates[name].excited:
            values[section][field] = float(f"{max(0.0, found.estimates[name].value):.5g}")
    return msgspec.convert(values, Vessel)


def vessel_toml(vessel: Vessel, found: Identification, base: str) -> str:
    """A vessel file; beside each coefficient its interval, or the vessel that it comes from."""
    values = msgspec.to_builtins(identified_vessel(vessel, found))
    sections = {name: value for name, value in values.items() if isinstance(value, dict)}
    lines = [
        f"# Identified by `paani calibrate hull` from {found.seconds:.0f} s of driving; intervals of"
        f" {100 * CONFIDENCE:.0f} %. What has none is of the vessel `{base}`.",
        f"# Fans: {_thrust_text(found)}",
        "",
        *(f"{name} = {value!r}" for name, value in values.items() if name not in sections),
    ]
    for name, fields in sections.items():
        lines += ["", f"[{name}]"]
        lines += [_line(found, name, field, value) for field, value in fields.items()]
    return "\n".join(lines) + "\n"


def settings_toml(found: Identification, vessel_file: str) -> str:
    """Settings with which simulator and controller use the hull: the thrust curve as the nearest straight line."""
    force = f"force_per_unit_n = {found.force_per_unit_n:.4g}  # {_thrust_text(found)}"
    vessel = msgspec.json.encode(vessel_file).decode()
    return f"[plant]\nvessel = {vessel}\n\n[plant.adapter]\n{force}\n\n[controller]\n{force}\n"


def _thrust_text(found: Identification) -> str:
    linear, quadratic = found.estimates["thrust_linear"], found.estimates["thrust_quadratic"]
    return (
        f"({linear.value:.4g} +- {linear.high - linear.value:.2g}) x +"
        f" ({quadratic.value:.4g} +- {quadratic.high - quadratic.value:.2g}) |x| x newtons at a normalised thrust x"
    )


def _line(found: Identification, section: str, field: str, value: object) -> str:
    name = FIELD_OF.get((section, field))
    if name is None or not found.estimates[name].excited:
        return f"{field} = {value!r}"
    estimate = found.estimates[name]
    return f"{field} = {value!r}  # {estimate.low:.4g} to {estimate.high:.4g}, standard error {estimate.std_error:.2g}"
