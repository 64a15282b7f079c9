"""A process that ends by a mistake: of the settings at a start, of what is there now once it has worked."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from paani.config import load_config
from paani.errors import UserError
from paani_tools.up.plan import Plan
from paani_tools.up.supervise import Supervisor
from tests.at_work import at_work
from tests.conftest import OpenAs
from tests.mcu_peer import until

MISSING = "camera.source=webcam:63"


@pytest.fixture
def supervisor(open_as: OpenAs, private_sets: tuple[str, ...], tmp_path: Path) -> Supervisor:
    """Of a camera that is not there, beside a router."""
    config = load_config(sets=(*private_sets, MISSING))
    return Supervisor(Plan(config=config, services=("camera",)), tmp_path, lambda text: None)


async def test_a_camera_that_was_never_there_is_a_mistake(supervisor: Supervisor) -> None:
    with pytest.raises(UserError, match=r"camera\.source webcam:63: no camera at /dev/video63"):
        await asyncio.wait_for(supervisor.keep_running("camera"), 30.0)


async def test_a_camera_that_was_pulled_out_is_waited_for(supervisor: Supervisor) -> None:
    supervisor.units["camera"].ever_alive = True
    async with at_work(supervisor.keep_running("camera")):
        await until(lambda: supervisor.restarts["camera"] >= 2, 30.0)
    await supervisor.stop()
