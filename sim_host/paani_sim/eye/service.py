"""Eye process: the boat's true pose in, the picture its camera would see out.

Everything that touches OpenGL happens in one thread of its own: a context belongs to its thread.
"""

from __future__ import annotations

import asyncio
import dataclasses
from concurrent.futures import ThreadPoolExecutor

import cv2

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani_sim.eye.camera import REST_Z_M, BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.worlds import load_world


def open_eye(config: Config) -> Eye:
    """The eye of the configured world and camera."""
    world = load_world(config.world.name)
    world = dataclasses.replace(world, wind=dataclasses.replace(world.wind, speed_mps=config.world.wind_mps))
    settings = config.eye
    camera = Camera(
        width_px=settings.width_px,
        height_px=settings.height_px,
        hfov_deg=settings.hfov_deg,
        forward_m=settings.camera_forward_m,
        up_m=settings.camera_height_m - REST_Z_M,
        down_deg=settings.pitch_down_deg,
    )
    eye = Eye(world, camera)
    eye.exposure *= settings.exposure_frac
    return eye


def pose_of(truth: m.TruePose) -> BoatPose:
    """Where the boat is and how it lies."""
    return BoatPose(truth.x_m, truth.y_m, truth.yaw_rad, truth.z_m, truth.roll_rad, truth.pitch_rad)


def jpeg(eye: Eye, pose: BoatPose, t_s: float, quality: int, actors_along_m: tuple[float, ...] = ()) -> bytes:
    """One encoded picture."""
    picture = eye.render(pose, t_s, actors_along_m)
    _, data = cv2.imencode(".jpg", picture.bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Render the newest pose at `eye.rate_hz`; alive once the first picture has come out."""
    poses = bus.latest(keys.TRUE_POSE)
    pictures = bus.picture_publisher(keys.RENDERED)
    loop, gl_thread = asyncio.get_running_loop(), ThreadPoolExecutor(1, "gl")
    settings, period_us = config.eye, round(1e6 / config.eye.rate_hz)
    eye = await loop.run_in_executor(gl_thread, open_eye, config)
    try:
        await loop.run_in_executor(gl_thread, jpeg, eye, BoatPose(*eye.world.start), 0.0, settings.jpeg_quality)
        with bus.alive():
            due_us, frame_seq, epoch = clock.now_us(), 0, None
            while True:
                await asyncio.sleep(min(max(due_us - clock.now_us(), 0), period_us) * 1e-6)
                truth = await poses.next()
                if epoch not in {None, truth.epoch}:
                    pictures.new_epoch()
                    frame_seq = 0
                epoch = truth.epoch
                data = await loop.run_in_executor(
                    gl_thread,
                    jpeg,
                    eye,
                    pose_of(truth),
                    truth.sim_us * 1e-6,
                    settings.jpeg_quality,
                    truth.actors_along_m,
                )
                header = m.PictureHeader(
                    source_us=truth.source_us,
                    frame_seq=frame_seq,
                    frame_epoch=truth.epoch,
                    width_px=settings.width_px,
                    height_px=settings.height_px,
                )
                pictures.put_picture(header, data)
                frame_seq += 1
                due_us = max(due_us + period_us, clock.now_us())
    finally:
        await loop.run_in_executor(gl_thread, eye.close)
        gl_thread.shutdown(wait=False)
