"""Camera process: publishes the pictures of the source that `camera.source` names."""

import asyncio

from paani import keys
from paani.bus import Bus
from paani.clock import Clock, due_after_us, patience_us
from paani.config import CameraConfig, Config
from paani_services.camera.picture_publisher import PicturePublisher


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish at most `camera.rate_hz` pictures a second."""
    output = PicturePublisher(bus, clock, is_calibrated=config.calibration.valid)
    if config.camera.source == "sim":
        await _relay_simulator(bus, clock, config.camera, output)
    else:
        from paani_services.camera.own_pictures import publish_own_pictures  # noqa: PLC0415  OpenCV is 17 MiB

        await publish_own_pictures(bus, clock, config.camera, output)


async def _relay_simulator(bus: Bus, clock: Clock, settings: CameraConfig, output: PicturePublisher) -> None:
    """Publish the simulator's pictures unchanged, with the time of the pose they show."""
    rendered = bus.pull_picture(keys.RENDERED)
    period_us = patience_us(settings.rate_hz)
    origin, due_us = None, 0
    with bus.alive():
        while True:
            await asyncio.sleep(min(max(due_us - clock.now_us(), 0), period_us) * 1e-6)
            picture = await rendered.next()
            due_us = due_after_us(due_us, period_us, clock.now_us())
            source_epoch = (picture.header.epoch, picture.header.frame_epoch)
            if origin not in {None, source_epoch}:
                output.start_new_epoch()
            origin = source_epoch
            output.put(picture.data, picture.header)
