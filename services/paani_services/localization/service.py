"""Localization process: IMU and GPS in, local and global odometry out."""

import asyncio
from collections import Counter

from paani import keys
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock
from paani.config import Config
from paani_services.localization.choice import create_estimator

IMU_DEPTH = 64  # samples kept between two steps: five at 100 Hz and 20 Hz, and room for a process that was held up


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish both estimates at `rate_hz`, whatever the wall clock is set to meanwhile."""
    monotonic = MonotonicClock()
    imu, gps = bus.queue(keys.IMU, IMU_DEPTH), bus.latest(keys.GPS)
    local, odometry = bus.publisher(keys.LOCAL_ODOMETRY), bus.publisher(keys.ODOMETRY)
    estimator = create_estimator(config.localization)
    period_us = round(1e6 / config.localization.rate_hz)
    last_fix, counted_drops = None, Counter[str]()
    with bus.alive():
        due_us = monotonic.now_us()
        while True:
            fix = gps.value if gps.value is not last_fix else None
            last_fix = gps.value
            local_now, global_now = estimator.step(imu.drain(), fix, clock.now_us())
            local.put(local_now)
            odometry.put(global_now)
            for cause, n in (estimator.drops - counted_drops).items():
                bus.count_drop(cause, n)
            counted_drops = estimator.drops.copy()
            due_us = max(due_us + period_us, monotonic.now_us())
            await asyncio.sleep(max(0, due_us - monotonic.now_us()) * 1e-6)
