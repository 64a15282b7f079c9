"""What a vessel file says, and reading it strictly: nothing unknown, nothing missing, nothing that is not finite."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import msgspec

from paani.config.section import Fraction, NonNegative, Positive, Section
from paani.errors import UserError
from paani.undecodable import UNDECODABLE
from paani_sim.water.waves import GRAVITY_MPS2

_FOLDER = Path(__file__).parent
VESSELS = tuple(sorted(file.stem for file in _FOLDER.glob("*.toml")))

Coordinate = Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]


class Hull(Section, frozen=True):
    """Rigid body, and two capsules that collide: axes `spacing_m` apart, `axis_z_m` above the body's origin."""

    mass_kg: Positive
    roll_inertia_kgm2: Positive
    pitch_inertia_kgm2: Positive
    yaw_inertia_kgm2: Positive
    length_m: Positive
    spacing_m: Positive
    radius_m: Positive
    axis_z_m: Coordinate


class AddedMass(Section, frozen=True):
    """Of the mass (surge, sway, heave) and of the moments of inertia (roll, pitch, yaw)."""

    surge_ratio: NonNegative
    sway_ratio: NonNegative
    heave_ratio: NonNegative
    roll_ratio: NonNegative
    pitch_ratio: NonNegative
    yaw_ratio: NonNegative


class Drag(Section, frozen=True):
    """F = -c1 v - c2 |v| v through the water, in N, N m, m/s and rad/s."""

    surge_linear: NonNegative
    surge_quadratic: NonNegative
    sway_linear: NonNegative
    sway_quadratic: NonNegative
    yaw_linear: NonNegative
    yaw_quadratic: NonNegative


class Buoyancy(Section, frozen=True):
    """Springs and dampers against the water's surface [N, N m, m, rad, s]. `max_weights` bounds the lift."""

    equilibrium_z_m: Positive
    heave_stiffness: Positive
    heave_damping: NonNegative
    max_weights: Positive
    roll_stiffness: Positive
    roll_damping: NonNegative
    pitch_stiffness: Positive
    pitch_damping: NonNegative


class FanPair(Section, frozen=True):
    """Two fans side by side, `height_m` above the body's origin; their force follows the order within `lag_s`."""

    spacing_m: Positive
    height_m: NonNegative
    lag_s: NonNegative


class Windage(Section, frozen=True):
    """Areas above water and coefficients of the wind's force (Fossen 2021, section 10.1)."""

    frontal_area_m2: NonNegative
    lateral_area_m2: NonNegative
    surge_coefficient: NonNegative
    sway_coefficient: NonNegative
    yaw_coefficient: NonNegative


class Vessel(Section, frozen=True):
    """One vessel. `wave_reflection_frac` is the part of a wave's height that the hull throws back."""

    hull: Hull
    added_mass: AddedMass
    drag: Drag
    buoyancy: Buoyancy
    fans: FanPair
    windage: Windage
    wave_reflection_frac: Fraction

    @property
    def draught_m(self) -> float:
        """How deep the hull lies at rest: the spring in heave is a waterplane's, and a box on that is so deep (K6)."""
        return self.hull.mass_kg * GRAVITY_MPS2 / self.buoyancy.heave_stiffness


def load_vessel(name: str) -> Vessel:
    """The vessel of this name, or of this TOML file. Raises UserError naming file and field."""
    if name in VESSELS:
        file = _FOLDER / f"{name}.toml"
    elif name.endswith(".toml"):
        file = Path(name)
    else:
        raise UserError(f"plant.vessel: no vessel {name!r} (known: {', '.join(VESSELS)}; or a TOML file)")
    try:
        return msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8-sig")), Vessel)
    except OSError as error:
        raise UserError(f"{file}: {error.strerror}") from error
    except UNDECODABLE as error:
        text, _, path = str(error).partition(" - at ")
        field = path.strip("`").removeprefix("$").lstrip(".")
        raise UserError(f"{file}: {field}: {text}" if field else f"{file}: {text}") from error
