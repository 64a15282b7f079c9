"""What `paani up` starts where thrust goes to a microcontroller, and what it must be given."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from paani.config import load_config
from paani.errors import UserError
from paani_tools.up.plan import make_plan
from tests.pictures import river

HULL = ("thrusters.line=serial:/dev/pts/99", "sensors.gps.line=serial:/dev/pts/98", "dashboard.serve=false")


@pytest.fixture
def hull(private_sets: tuple[str, ...], tmp_path: Path) -> tuple[str, ...]:
    cv2.imwrite(str(tmp_path / "river.png"), river())
    return (*private_sets, *HULL, f"camera.source={tmp_path}")


@pytest.fixture
def route(tmp_path: Path) -> str:
    file = tmp_path / "route.toml"
    file.write_text('name = "out"\nwaypoints = [{ x_m = 0.0, y_m = 0.0 }, { x_m = 9.0, y_m = 0.0 }]\n')
    return f"navigator.route={file}"


async def test_a_hull_starts_no_simulator_and_nothing_armed(hull: tuple[str, ...], route: str) -> None:
    """A7: no scenario hands over a route, and the map begins at the first fix."""
    plan = await make_plan(load_config(profile="hull", sets=(*hull, route, "world.name=no_such_world")))
    assert {"thrusters", "sensors", "controller", "navigator"} <= set(plan.services)
    assert not {"plant", "eye"} & set(plan.services)
    assert "eye" not in plan.config.plant.adapter.require_pulses
    assert plan.config.localization.origin_lat_lon_deg is None
    assert not plan.config.up.arm_at_start
    assert not plan.config.calibration.valid


async def test_a_hull_is_given_its_route(hull: tuple[str, ...]) -> None:
    with pytest.raises(UserError, match=r"navigator\.route: not set \(a hull follows a route or a mission of its own"):
        await make_plan(load_config(profile="hull", sets=hull))


@pytest.mark.parametrize("profile", ["hil", "hull"])
async def test_thrust_needs_an_address(profile: str, private_sets: tuple[str, ...], tmp_path: Path, route: str) -> None:
    cv2.imwrite(str(tmp_path / "river.png"), river())
    sets = (*private_sets, route, "dashboard.serve=false", f"camera.source={tmp_path}")
    sensors = ("sensors.gps.line=serial:/dev/pts/98",) if profile == "hull" else ()
    with pytest.raises(UserError, match=rf"thrusters\.line: not set \(profile {profile} drives a microcontroller\)"):
        await make_plan(load_config(profile=profile, sets=(*sets, *sensors)))


@pytest.mark.slow
async def test_hardware_in_the_loop_needs_the_pulses(private_sets: tuple[str, ...]) -> None:
    sets = (*private_sets, "dashboard.serve=false", "thrusters.line=socket://127.0.0.1:5001")
    with pytest.raises(UserError, match=r"plant\.pwm_line: not set"):
        await make_plan(load_config(profile="hil", sets=sets))
    plan = await make_plan(load_config(profile="hil", sets=(*sets, "plant.pwm_line=socket://127.0.0.1:5002")))
    assert {"plant", "eye", "thrusters"} <= set(plan.services)
    assert "sensors" not in plan.services
    assert plan.config.navigator.route, "the simulated boat follows its world's route"
