"""`paani doctor` beside a running boat, and `paani up` on a machine that lacks something."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys

import pytest

from paani.bus.routing import open_router
from paani.config import load_config
from paani_tools.doctor.command import CHECKS
from paani_tools.doctor.finding import State, run_check

pytestmark = pytest.mark.integration


async def test_a_running_router_is_known_by_letting_us_in(private_sets: tuple[str, ...], tmp_path: object) -> None:
    config = load_config(sets=private_sets)
    router = await open_router(config.bus)
    stranger = load_config(sets=(*private_sets, f"bus.runtime_dir={tmp_path}/other"))
    try:
        (ours,) = await asyncio.to_thread(lambda: list(run_check("router", CHECKS["router"], config)))
        (theirs,) = await asyncio.to_thread(lambda: list(run_check("router", CHECKS["router"], stranger)))
    finally:
        await asyncio.to_thread(router.close)
    assert (ours.state, ours.text.split(": ")[1]) == (State.OK, "a router is running and lets us in")
    assert theirs.state is State.FAIL


@pytest.mark.rotating(cpu_s=10)
def test_up_points_to_the_doctor(private_sets: tuple[str, ...]) -> None:
    """Without a driver for OpenGL there is no eye."""
    words = [word for setting in private_sets for word in ("--set", setting)]
    environment = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere.json"}
    command = [sys.executable, "-m", "paani", "up", "--headless", "--for", "1", *words]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].endswith("(`paani doctor` says what this machine lacks)")
    assert "libegl1" in done.stderr
