"""The eye as a process: a pose on the bus gives a picture on the bus."""

import asyncio
import contextlib
import os
import threading
from collections.abc import Awaitable, Callable

import cv2
import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, Picture
from paani.clock import WallClock
from paani.config import Config, load_config
from paani.errors import UserError
from paani_sim.eye.camera import BoatPose
from paani_sim.eye.camera_faults import CameraFaults
from paani_sim.eye.configured_camera import boat_pose
from paani_sim.eye.gl import Context
from paani_sim.eye.service import open_camera, render_jpeg, run
from paani_sim.worlds import Fault, FaultKind
from paani_sim.worlds.load import configured_scenario
from tests.at_work import at_work

pytestmark = [pytest.mark.gl, pytest.mark.timeout(60)]


def truth(source_us: int, *, sim_us: int = 2_000_000, x_m: float = 20.0) -> m.TruePose:
    return m.TruePose(
        source_us=source_us, sim_us=sim_us, x_m=x_m, y_m=0.0, z_m=0.177, roll_rad=0.02, pitch_rad=-0.01,
        yaw_rad=0.4, surge_mps=0.0, sway_mps=0.0, yaw_rate_radps=0.0,
    )  # fmt: skip


def niceness(thread: int | None) -> int:
    assert thread is not None
    return os.getpriority(os.PRIO_PROCESS, thread)


def require_gl() -> None:
    try:
        Context().close()
    except UserError as error:
        pytest.skip(str(error))


@pytest.fixture
def gl() -> None:
    """Before an event loop runs: what OpenGL imports blocks it."""
    require_gl()


def test_pose_keeps_every_axis() -> None:
    pose = boat_pose(msgspec.structs.replace(truth(1), y_m=-3.0))
    assert (pose.x_m, pose.y_m, pose.z_m) == (20.0, -3.0, 0.177)
    assert (pose.roll_rad, pose.pitch_rad, pose.yaw_rad) == (0.02, -0.01, 0.4)


def test_settings_reach_the_eye() -> None:
    require_gl()
    config = load_config(sets=("world.name=lake", "world.wind_mps=5", "eye.camera_height_m=1.2", "eye.width_px=160"))
    eye, _ = open_camera(config)
    with eye:
        assert eye.world.name == "lake"
        assert eye.world.wind.speed_mps == 5.0
        assert eye.camera.up_m + 0.177 == pytest.approx(1.2)
        assert eye.camera.width_px == 160


def test_unknown_world_is_one_line() -> None:
    with pytest.raises(UserError, match="unknown world"):
        open_camera(load_config(sets=("world.name=sea",)))


def test_camera_faults_of_a_scenario_reach_its_pictures() -> None:
    """Black while the scenario says so; nothing at all of a camera that drops its pictures."""
    require_gl()
    config = load_config(sets=("world.name=river_camera_black",))
    fault = configured_scenario(config.world).faults[0]
    assert fault.kind is FaultKind.CAMERA_BLACK
    eye, faults = open_camera(config)
    with eye:
        pose = BoatPose(*eye.world.start)
        means = []
        for t_s in (fault.start_s - 0.1, fault.start_s + 0.1):
            data = render_jpeg(eye, faults, pose, t_s, 85)
            assert data is not None
            means.append(np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)).mean())
        assert means[0] > 50.0
        assert means[1] < 15.0
        assert render_jpeg(eye, CameraFaults([Fault(FaultKind.CAMERA_DROPPED, 0.0)]), pose, 1.0, 85) is None


@pytest.mark.usefixtures("gl")
async def test_pose_in_picture_out(open_as: Callable[[str], Awaitable[Bus]], config: Config) -> None:
    """A9: the picture is of the pose, carries its stamp, names its frame, and comes no faster than the set rate."""
    plant, viewer = await open_as("plant"), await open_as("camera")
    poses, pictures = plant.publisher(keys.TRUE_POSE), viewer.latest_picture(keys.RENDERED)
    clock = WallClock()
    async with at_work(run(await open_as("eye"), clock, config)):
        seen: list[Picture] = []
        sent: dict[int, float] = {}
        async with asyncio.timeout(40.0):
            while len(seen) < 8:
                x_m = 20.0 + 2.0 * len(seen)
                sent[poses.put(truth(clock.now_us(), x_m=x_m)).source_us] = x_m
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(0.05):
                        seen.append(await pictures.next())
            drawing = next(each for each in threading.enumerate() if each.name.startswith("gl"))
            assert niceness(drawing.native_id) == niceness(threading.get_native_id()) + 5, "drawing alone yields"
    headers = [p.header for p in seen]
    assert [h.frame_seq for h in headers] == [*range(8)]
    assert all(h.source_us in sent for h in headers)
    assert len({h.frame_epoch for h in headers}) == 1
    # Of seven periods, as the first picture may be late by less than one.
    assert headers[-1].sent_us - headers[0].sent_us > 6e6 / config.eye.rate_hz
    first, last = (
        np.asarray(cv2.imdecode(np.frombuffer(seen[place].data, np.uint8), cv2.IMREAD_COLOR), np.float32)
        for place in (0, -1)
    )
    assert first.shape == last.shape == (240, 320, 3)
    assert last.mean() > 50.0
    assert sent[headers[-1].source_us] > sent[headers[0].source_us]
    assert np.abs(last - first)[:120].mean() > 2.0, "the banks stand elsewhere in the picture of a boat that has moved"
