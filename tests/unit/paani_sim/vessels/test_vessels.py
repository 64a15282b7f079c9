"""Vessel files: the paper's coefficients to the digit, the Otter's proportions, and what is refused."""

import math
from pathlib import Path

import pytest

import paani_sim.vessels
from paani.errors import UserError
from paani_sim.vessels import VESSELS, load_vessel

FOLDER = Path(paani_sim.vessels.__file__).parent


def test_k4_to_k7_paper_to_the_digit() -> None:
    """K4: 12.4 kg. K5: 4/20, 20/80, 4/25. K6: 650, 90, 0.177. K7: 90 / 24."""
    paper = load_vessel("paper")
    drag, buoyancy = paper.drag, paper.buoyancy
    assert paper.hull.mass_kg == 12.4
    assert (drag.surge_linear, drag.surge_quadratic) == (4.0, 20.0)
    assert (drag.sway_linear, drag.sway_quadratic) == (20.0, 80.0)
    assert (drag.yaw_linear, drag.yaw_quadratic) == (4.0, 25.0)
    assert (buoyancy.heave_stiffness, buoyancy.heave_damping, buoyancy.equilibrium_z_m) == (650.0, 90.0, 0.177)
    assert buoyancy.roll_stiffness == buoyancy.pitch_stiffness == 90.0
    assert buoyancy.roll_damping == buoyancy.pitch_damping == 24.0


def test_k7_k6_imply_the_hull_s_size() -> None:
    """90 = 650 (b / 2)^2 and 90 = 650 L^2 / 12: one hull of 1.3 x 0.75 m."""
    hull, buoyancy = load_vessel("paper").hull, load_vessel("paper").buoyancy
    beam_m = 2.0 * math.sqrt(buoyancy.roll_stiffness / buoyancy.heave_stiffness)
    length_m = math.sqrt(12.0 * buoyancy.pitch_stiffness / buoyancy.heave_stiffness)
    assert hull.length_m == pytest.approx(length_m, abs=0.02)
    assert hull.spacing_m + 2.0 * hull.radius_m == pytest.approx(beam_m, abs=0.02)


def test_k8_paper_has_no_water_or_wind_of_its_own() -> None:
    """K8: no validated current, wave or wind: nothing that the paper does not state pushes its boat."""
    paper = load_vessel("paper")
    assert not any(getattr(paper.added_mass, name) for name in paper.added_mass.__struct_fields__)
    assert not any(getattr(paper.windage, name) for name in paper.windage.__struct_fields__)
    assert (paper.wave_reflection_frac, paper.fans.lag_s) == (0.0, 0.0)


def test_otter_has_the_otter_s_relative_damping() -> None:
    """zeta 0.3, 0.2, 0.4 in heave, roll and pitch, on mass with added mass."""
    otter = load_vessel("otter")
    hull, added, buoyancy = otter.hull, otter.added_mass, otter.buoyancy
    for zeta, stiffness, damping, mass in (
        (0.3, buoyancy.heave_stiffness, buoyancy.heave_damping, hull.mass_kg * (1.0 + added.heave_ratio)),
        (0.2, buoyancy.roll_stiffness, buoyancy.roll_damping, hull.roll_inertia_kgm2 * (1.0 + added.roll_ratio)),
        (0.4, buoyancy.pitch_stiffness, buoyancy.pitch_damping, hull.pitch_inertia_kgm2 * (1.0 + added.pitch_ratio)),
    ):
        assert damping == pytest.approx(2.0 * zeta * math.sqrt(stiffness * mass), rel=2e-3)


def test_both_vessels_are_one_hull() -> None:
    """The same camera, controller and clearances serve both."""
    paper, otter = load_vessel("paper"), load_vessel("otter")
    assert VESSELS == ("otter", "paper")
    assert paper.hull == otter.hull
    assert paper.drag == otter.drag


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("surge_linear = 4.0", "surge_linear = nan", "drag.surge_linear"),
        ("surge_linear = 4.0", "surge_linear = inf", "drag.surge_linear"),
        ("surge_linear = 4.0", "surge_linear = -1.0", "drag.surge_linear"),
        ("surge_linear = 4.0", 'surge_linear = "4"', "drag.surge_linear"),
        ("surge_linear = 4.0", "", "drag: Object missing required field `surge_linear`"),
        (
            "surge_linear = 4.0",
            "surge_linear = 4.0\nsurge_cubic = 1.0",
            "drag: Object contains unknown field `surge_cubic`",
        ),
        ("mass_kg = 12.4", "mass_kg = 0.0", "hull.mass_kg"),
        ("axis_z_m = -0.12", "axis_z_m = nan", "hull.axis_z_m"),
        ("[hull]", "[hull", "paper"),
    ],
)
def test_bad_file_is_refused_by_field(tmp_path: Path, old: str, new: str, problem: str) -> None:
    text = (FOLDER / "paper.toml").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "mine.toml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(UserError) as refusal:
        load_vessel(str(file))
    assert str(file) in str(refusal.value)
    assert (problem in str(refusal.value)) or problem == "paper"
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["submarine", "nowhere/mine.toml", ""])
def test_unknown_vessel_is_refused(name: str) -> None:
    with pytest.raises(UserError, match=r"vessel|No such file"):
        load_vessel(name)


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text((FOLDER / "paper.toml").read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert load_vessel(str(file)) == load_vessel("paper")
