"""Camera process: publishes the pictures of the source that `camera.source` names."""

from paani import keys
from paani.bus import Bus
from paani.clock import Clock, patience_us
from paani.config import CameraConfig, Config
from paani.pace import Pace
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
    pace, origin = Pace(clock, patience_us(settings.rate_hz)), None
    with bus.alive():
        while True:
            await pace.wait()
            picture = await rendered.next()
            pace.took_one()
            source_epoch = (picture.header.epoch, picture.header.frame_epoch)
            if origin not in {None, source_epoch}:
                output.start_new_epoch()
            origin = source_epoch
            output.put(picture.data, picture.header)
