"""Evidence and attitude, paired, from a recording or from the bus."""

import asyncio
import contextlib
import math
from bisect import bisect_left
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np

from paani import keys
from paani.bus import Queue
from paani.config import BusConfig
from paani.errors import UserError
from paani.logs.reader import open_log
from paani.messages import Evidence, Message, Odometry, TimeBase
from paani.undecodable import UNDECODABLE
from paani_tools.calibrate.horizon import fit_waterline
from paani_tools.calibrate.mount import WaterlineObservation
from paani_tools.inspect.listen import observer
from paani_tools.progress import Progress

MAX_GAP_US = 100_000
MAX_SPEED_MPS = 0.5  # faster, and the bow lifts by itself
MAX_PICTURES = 2000
SEED = 1
DEPTH = 1024
SHOW_S = 0.25
Collected = tuple[list[Evidence], list[Odometry]]
T = TypeVar("T", bound=Message)


def collect_recorded(path: Path) -> Collected:
    """What a recording holds of both. Raises UserError naming the file and what it lacks."""
    log = open_log(path)
    evidence: list[Evidence] = []
    odometry: list[Odometry] = []
    wanted = {keys.EVIDENCE.name, keys.ODOMETRY.name}
    span_us = max(1, log.end_us - log.start_us)
    with Progress("reading") as bar:
        for record in log.records(wanted):
            bar.at((record.log_us - log.start_us) / span_us)
            with contextlib.suppress(*UNDECODABLE):
                if record.topic == keys.EVIDENCE.name:
                    evidence.append(msgspec.json.decode(record.data, type=Evidence))
                else:
                    odometry.append(msgspec.json.decode(record.data, type=Odometry))
    for name, found in ((keys.EVIDENCE.name, evidence), (keys.ODOMETRY.name, odometry)):
        if not found:
            raise UserError(f"{path}: no {name} in it")
    return evidence, odometry


async def collect_live(bus_config: BusConfig, seconds: float) -> Collected:
    """What comes over the bus in that time. Raises UserError where nothing listens or something does not come."""
    async with observer(bus_config) as bus:
        collected: Collected = ([], [])
        tasks = [
            asyncio.create_task(_collect(bus.queue(keys.EVIDENCE, DEPTH), collected[0])),
            asyncio.create_task(_collect(bus.queue(keys.ODOMETRY, DEPTH), collected[1])),
        ]
        steps = math.ceil(seconds / SHOW_S)
        with Progress("listening") as bar:
            for step in range(steps):
                bar.at(step / steps, f"{len(collected[0])} pictures")
                await asyncio.sleep(seconds / steps)
        for task in tasks:
            task.cancel()
    for name, found in ((keys.EVIDENCE.name, collected[0]), (keys.ODOMETRY.name, collected[1])):
        if not found:
            raise UserError(f"bus: no {name} came in {seconds:g} s")
    return collected


def waterline_observations(evidence: Iterable[Evidence], odometry: Iterable[Odometry]) -> list[WaterlineObservation]:
    """Waterlines of live pictures with the attitude heard within 0.1 s of each, boat slow; at most MAX_PICTURES.

    Raises UserError when the attitude is missing throughout.
    """
    frames = {(e.frame_epoch, e.frame_seq): e for e in evidence if e.time_base is TimeBase.CAPTURE and e.water_edge}
    attitudes = sorted((o for o in odometry if o.healthy and _is_known(o)), key=lambda o: o.source_us)
    if not frames:
        raise UserError("no evidence says where the water ends (live pictures, segmented)")
    if not attitudes:
        raise UserError("no healthy odometry: roll and pitch of the boat are not known")
    chosen = list(frames.values())[:: max(1, len(frames) // MAX_PICTURES)]
    rng = np.random.default_rng(SEED)
    stamps = [o.source_us for o in attitudes]
    found: list[WaterlineObservation] = []
    for frame in chosen:
        at = bisect_left(stamps, frame.source_us)
        nearest = min(attitudes[max(0, at - 1) : at + 1], key=lambda o: abs(o.source_us - frame.source_us))
        if abs(nearest.source_us - frame.source_us) > MAX_GAP_US or abs(nearest.surge_mps) > MAX_SPEED_MPS:
            continue
        line = fit_waterline(frame, rng)
        if line is not None:
            found.append(WaterlineObservation(line, nearest.roll_rad, nearest.pitch_rad))
    return found


async def _collect(queue: Queue[T], kept: list[T]) -> None:
    while True:
        kept.append(await queue.get())


def _is_known(odometry: Odometry) -> bool:
    """A filter without an IMU says exactly level."""
    numbers = (odometry.roll_rad, odometry.pitch_rad)
    return all(map(math.isfinite, numbers)) and any(numbers)
