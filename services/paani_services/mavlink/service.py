"""MAVLink process: the bus to ground stations, and what they ask for to the operator's process."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from typing import Any

from paani import keys
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock
from paani.config import Config
from paani.mission_client import MissionClient
from paani.operator_client import OperatorClient
from paani.port_address import tcp_address
from paani.runtime import runtime_path
from paani_services.mavlink.acts import Acts, is_link_lost
from paani_services.mavlink.camera import Camera, Stream
from paani_services.mavlink.endpoints import Endpoints
from paani_services.mavlink.gateway import Gateway
from paani_services.mavlink.log_files import serve_logs
from paani_services.mavlink.signing import STAMP_FILE, Signer, read_signing_key, read_stamp, save_stamps
from paani_services.mavlink.snapshot import TOPICS, Snapshot
from paani_services.mavlink.trials import Trials
from paani_services.mavlink.video import Video

LOG = logging.getLogger(__name__)
PERIOD_S = 0.02


class Inputs:
    """What is on the bus, as far as it is fresh."""

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._clock, self._steady = clock, MonotonicClock()
        self._started_us = self._steady.now_us()
        rows = {field: keys.topic_in(topic, bus.graph) for field, topic in TOPICS.items()}
        self._inboxes = {
            field: (row.fresh_s, bus.latest(row)) for field, row in rows.items() if row.producer != keys.NOBODY
        }

    def snapshot(self) -> Snapshot:
        """Now."""
        fresh: dict[str, Any] = {
            field: inbox.value for field, (fresh_s, inbox) in self._inboxes.items() if inbox.receipt_age_s() <= fresh_s
        }
        boot_ms = (self._steady.now_us() - self._started_us) // 1000
        return Snapshot(now_us=self._clock.now_us(), boot_ms=boot_ms % (1 << 32), **fresh)


def stream_of(config: Config, video: Video) -> Stream | None:
    """What is served now; None where `mavlink.video` names no address."""
    if not config.mavlink.video:
        return None
    hfov_deg = config.calibration.hfov_deg if config.calibration.valid else 0.0
    return Stream(*tcp_address(config.mavlink.video), keys.PICTURE.rate_hz, hfov_deg, video.size_px)


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Serve ground stations until told to stop. Raises UserError for an address or a key that cannot be had."""
    settings = config.mavlink
    signer, stamp_file = None, runtime_path(config.bus) / STAMP_FILE
    if settings.signing_key_file:
        key = await asyncio.to_thread(read_signing_key, settings.signing_key_file)
        signer = Signer(key, clock.now_us(), await asyncio.to_thread(read_stamp, stamp_file))
    inputs = Inputs(bus, clock)
    client = OperatorClient(bus, clock)
    acts = Acts(
        client, MissionClient(bus, clock), clock, bus.count_drop, lambda: gateway.hands(clock.now_us()),
        lambda order: gateway.missions.shows(order),
    )  # fmt: skip
    trials = Trials(bus, clock, lambda: inputs.snapshot().shadow, lambda *ended: gateway.parameters.answer(*ended))
    video = Video(bus.pull_picture(keys.PICTURE), settings, config.bus.vessel, bus.count_drop)
    camera = Camera(config.bus.vessel, lambda: stream_of(config, video))
    gateway = Gateway(
        acts.ask, acts.send, client.drive, trials.ask, bus.count_drop, camera, advisor=config.advisor,
        cruise_mps=config.navigator.cruise_mps, is_signed=signer is not None,
    )  # fmt: skip
    gateway.tick(inputs.snapshot())
    endpoints = Endpoints(gateway, settings, signer, clock)
    with contextlib.closing(endpoints), contextlib.closing(acts), contextlib.closing(trials), contextlib.closing(video):
        await endpoints.open()
        await video.open()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(video.show_pictures())
            if signer is not None:
                tasks.create_task(save_stamps(stamp_file, signer))
            tasks.create_task(serve_logs(gateway.logs, config.recorder.folder, clock))
            with bus.alive():
                LOG.info("MAVLink to udp %s, at tcp %s", settings.udp or "nowhere", settings.tcp or "nowhere")
                begun_us = clock.now_us()
                try:
                    while True:
                        snapshot = inputs.snapshot()
                        gateway.tick(snapshot)
                        heard_us = gateway.commander_us or begun_us
                        if is_link_lost(snapshot, bus.user, heard_us, settings.link_loss_s):
                            LOG.warning("no ground station for %.1f s: STOP", settings.link_loss_s)
                            await acts.stop()
                        present = sum(station.is_present(snapshot.now_us) for station in gateway.stations)
                        bus.note(f"{present} ground station{'' if present == 1 else 's'}")
                        await asyncio.sleep(PERIOD_S)
                finally:  # nobody is left who could be asked
                    if is_link_lost(inputs.snapshot(), bus.user, 0, settings.link_loss_s):
                        await acts.stop()
