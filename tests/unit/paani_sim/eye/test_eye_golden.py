"""Small pictures by hash, one of each world and some weather: nothing changes what the eye draws unnoticed.

The hashes hold for one rasteriser, processor family and numerical library; elsewhere the test is skipped and says why.
"""

import dataclasses
import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani.errors import UserError
from paani_sim.eye import BoatPose, Camera, Eye
from paani_sim.eye.gl import Context
from paani_sim.worlds import World, load_world

pytestmark = [pytest.mark.gl, pytest.mark.timeout(120)]

FILE = Path(__file__).with_name("eye_golden.json")
CAMERA = Camera(width_px=160, height_px=120)
T_S = 21.5
WEATHER: dict[str, dict[str, Any]] = {
    "": {},
    "dusk": {"sky": "dusk", "sun_elevation_rad": 0.2},
    "fog": {"sky": "hazy", "visibility_m": 40.0},
    "rain": {"sky": "overcast", "rain_mmph": 12.0},
}
CASES = [
    ("lake", ""),
    ("river", ""),
    ("canal", ""),
    ("harbour", ""),
    ("river", "dusk"),
    ("canal", "fog"),
    ("lake", "rain"),
]


class Golden(msgspec.Struct, frozen=True):
    """`made_by` is what the hashes hold for."""

    made_by: dict[str, str]
    sha256: dict[str, str]


def stored() -> Golden:
    return msgspec.json.decode(FILE.read_bytes(), type=Golden) if FILE.exists() else Golden({}, {})


def made_by(context: Context) -> dict[str, str]:
    flags = Path("/proc/cpuinfo").read_text().split() if Path("/proc/cpuinfo").exists() else []
    widest = next((flag for flag in ("avx512f", "avx2", "asimd") if flag in flags), "unknown")
    return {
        "renderer": context.renderer,
        "opengl": str(context.gl.glGetString(context.gl.GL_VERSION).decode()),
        "vectors": widest,
        "numpy": version("numpy"),
        "opencv": version("opencv-python-headless"),
    }


def weathered(world: World, weather: str) -> World:
    light = dataclasses.replace(world.light, **WEATHER[weather])
    return dataclasses.replace(world, light=light)


@pytest.mark.parametrize(("name", "weather"), CASES)
def test_picture_is_the_one_that_was_looked_at(name: str, weather: str, update_golden: bool) -> None:
    try:
        context = Context()
    except UserError as error:
        pytest.skip(str(error))
    here, case = made_by(context), f"{name} {weather}".strip()
    try:
        if not update_golden and stored().made_by != here:
            pytest.skip(f"the golden pictures are of {stored().made_by}, here is {here}")
        world = weathered(load_world(name), weather)
        pose = BoatPose(*world.start, roll_rad=0.02, pitch_rad=-0.01)
        with Eye(world, CAMERA, context=context) as eye:
            found = hashlib.sha256(eye.render(pose, T_S).bgr.tobytes()).hexdigest()
    finally:
        context.close()
    if update_golden:
        kept = stored().sha256 if stored().made_by == here else {}
        FILE.write_bytes(msgspec.json.format(msgspec.json.encode(Golden(here, kept | {case: found})), indent=1) + b"\n")
    assert stored().sha256[case] == found, f"{case} looks different: look at it, then pytest --update-golden"
