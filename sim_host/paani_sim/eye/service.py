"""Eye process: the boat's true pose in, the picture its camera would see out.

Everything that touches OpenGL happens in one thread of its own: a context belongs to its thread.
"""

from __future__ import annotations

import asyncio
import os
from concurrent.futures import ThreadPoolExecutor

import cv2

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani.pace import Pace
from paani_sim.eye.camera import BoatPose
from paani_sim.eye.camera_faults import CameraFaults
from paani_sim.eye.configured_camera import boat_pose, open_eye
from paani_sim.eye.renderer import Eye
from paani_sim.worlds.load import configured_scenario

NICE = 5  # of the thread that draws, and of those that the renderer begins: they yield to the control chain


def open_camera(config: Config) -> tuple[Eye, CameraFaults]:
    """The eye of the configured scenario, and what goes wrong with it."""
    scenario = configured_scenario(config.world)
    return open_eye(scenario.world, config.eye), CameraFaults(scenario.faults)


def render_jpeg(
    eye: Eye, faults: CameraFaults, pose: BoatPose, t_s: float, quality: int, actors_along_m: tuple[float, ...] = ()
) -> bytes | None:
    """One encoded picture; None where the camera drops it."""
    bgr = faults.apply(eye.render(pose, t_s, actors_along_m).bgr, t_s)
    if bgr is None:
        return None
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Render the newest pose at `eye.rate_hz`; alive once the first picture has come out."""
    poses = bus.latest(keys.TRUE_POSE)
    pictures = bus.picture_publisher(keys.RENDERED)
    loop, gl_thread = asyncio.get_running_loop(), ThreadPoolExecutor(1, "gl", os.nice, (NICE,))
    settings = config.eye
    eye, faults = await loop.run_in_executor(gl_thread, open_camera, config)
    try:
        start = BoatPose(*eye.world.start)
        await loop.run_in_executor(gl_thread, render_jpeg, eye, CameraFaults(()), start, 0.0, settings.jpeg_quality)
        with bus.alive():
            pace, frame_seq, epoch = Pace(clock, round(1e6 / settings.rate_hz)), 0, None
            while True:
                await pace.wait()
                truth = await poses.next()
                if epoch not in {None, truth.epoch}:
                    pictures.new_epoch()
                    frame_seq = 0
                epoch = truth.epoch
                data = await loop.run_in_executor(
                    gl_thread,
                    render_jpeg,
                    eye,
                    faults,
                    boat_pose(truth),
                    truth.sim_us * 1e-6,
                    settings.jpeg_quality,
                    truth.actors_along_m,
                )
                pace.took_one()
                if data is None:
                    continue
                header = m.PictureHeader(
                    source_us=truth.source_us,
                    frame_seq=frame_seq,
                    frame_epoch=truth.epoch,
                    width_px=settings.width_px,
                    height_px=settings.height_px,
                )
                pictures.put_picture(header, data)
                frame_seq += 1
    finally:
        await loop.run_in_executor(gl_thread, eye.close)
        gl_thread.shutdown(wait=False)
