"""Perception process: the camera's newest picture in, evidence and class mask out."""

import asyncio
import logging
from concurrent.futures import ThreadPoolExecutor

import cv2
import msgspec

from paani import keys
from paani import messages as m
from paani.arrays import U8
from paani.bus import Bus, Picture
from paani.clock import Clock, patience_us, stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani.keys import Graph
from paani.memory import release_freed_memory
from paani.pace import Pace
from paani.runtime import runtime_dir
from paani_services.perception.journal import JOURNAL_FOLDER, Journal
from paani_services.perception.pipeline import Perceiver

LOG = logging.getLogger(__name__)

SEGMENTER_HAS_SEEN = {
    "open": "its segmenter has never seen real water",
    "paper": "its segmenter has seen a few pictures of open sea alone",
}


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Process the newest picture at most `perception.rate_hz` times a second, in a thread beside the event loop."""
    pictures = bus.latest_picture(keys.PICTURE)
    odometry = bus.latest(keys.ODOMETRY)
    evidence_publisher, mask_publisher = bus.publisher(keys.EVIDENCE), bus.picture_publisher(keys.MASK)
    loop, worker = asyncio.get_running_loop(), ThreadPoolExecutor(1, "perceive")
    perceiver = await loop.run_in_executor(worker, Perceiver, config.perception, stopwatch_ms)
    await loop.run_in_executor(worker, release_freed_memory)  # what loading the networks took: some 15 MiB
    require_people_seen(perceiver, config)
    warn_uncalibrated(config)
    judge_weights(config)
    folder = await asyncio.to_thread(runtime_dir, config.bus)
    journal = Journal(folder / JOURNAL_FOLDER, round(config.perception.journal_max_mib * 2**20))
    pace, last = Pace(clock, patience_us(config.perception.rate_hz)), (-1, -1)

    def perceive(picture: Picture) -> tuple[m.Evidence, Picture | None]:
        age_s = (clock.now_us() - picture.header.source_us) * 1e-6
        roll_rad = roll_at_capture_rad(picture.header.source_us, odometry.value, config.perception.max_roll_age_s)
        evidence, mask = perceiver.perceive(picture.data, picture.header, age_s, roll_rad)
        return evidence, encode_mask(mask, picture.header) if mask is not None and mask_publisher.is_watched() else None

    def write_to_journal(observation: m.Evidence) -> None:
        if not journal.append(msgspec.json.encode(observation)):
            bus.count_drop("journal")

    try:
        with bus.alive():
            while True:
                await pace.wait()
                picture = await pictures.next()
                frame = (picture.header.frame_epoch, picture.header.frame_seq)
                if last[0] * 1000 > clock.now_us() + config.bus.max_future_s * 1e6:  # before the clock was set back
                    last = (-1, -1)
                if frame <= last:  # B3
                    bus.count_drop("duplicate_frame" if frame == last else "old_frame")
                    continue
                last = frame
                pace.took_one()
                evidence, mask = await loop.run_in_executor(worker, perceive, picture)
                sent = evidence_publisher.put(evidence)
                worker.submit(write_to_journal, sent)
                if mask is not None:
                    mask_publisher.put_picture(mask.header, mask.data)
                bus.note(sight_note(sent, config))
    finally:
        worker.shutdown(wait=False)
        perceiver.close()


def require_people_seen(perceiver: Perceiver, config: Config) -> None:
    """Warn of a detector without a class person. Raises UserError on a hull, which might hit whom it cannot see."""
    if perceiver.sees_people:
        return
    text = f"perception.detector {config.perception.detector}: has no class person"
    if config.bus.graph is Graph.HULL:
        raise UserError(f"{text}; a hull needs one that sees people")
    LOG.warning("%s: people are not seen", text)


def warn_uncalibrated(config: Config) -> None:
    """Log what is taken for granted of a camera that nobody measured, and what measures it; nothing in `paper`."""
    if not config.calibration.valid and config.perception.candidates.use:
        LOG.warning(
            "calibration.valid is false: no distance is known, so everybody in view counts as near, and so does a "
            "vessel in the middle of the way, and advice limits the speed (advisor.people.uncalibrated_mps); "
            "`paani calibrate RECORDING` measures the camera"
        )


def judge_weights(config: Config) -> None:
    """Log what weights other than the full ones do worse, and how fast their advice may be followed.

    Raises UserError on a hull whose water they would tell: their segmenters have seen too little real water.
    """
    weights = config.perception.weights
    if weights == "full":
        return
    if config.bus.graph is Graph.HULL and not config.perception.segmenter:
        raise UserError(
            f"perception.weights {weights}: {SEGMENTER_HAS_SEEN[weights]}; a hull needs perception.segmenter, "
            "a file of your own, or perception.weights full"
        )
    LOG.warning(
        "perception.weights is %s: networks that have learnt from few pictures miss people and vessels that the "
        "full set sees, most piers and buoys, and where water ends; no network says whether a picture is fit; "
        "advice limits the speed (advisor.people.uncalibrated_mps); models/MODEL_CARD.md has the figures",
        weights,
    )


def sight_note(evidence: m.Evidence, config: Config) -> str:
    """What the page says of perception: why a picture is unusable, else by which networks, and whether in metres."""
    if not evidence.usable:
        return f"unusable: {evidence.cause}"
    notes = []
    if not config.calibration.valid and config.perception.candidates.use:
        notes.append("uncalibrated camera, everybody counts as near, speed limited")
    if config.perception.weights != "full":
        notes.append(f"{config.perception.weights} weights, which miss more, speed limited")
    return "; ".join((*notes, evidence.models))


def roll_at_capture_rad(source_us: int, odometry: m.Odometry | None, max_age_s: float) -> float:
    """The boat's roll when a picture was taken; 0 where no odometry of that time is known."""
    if odometry is None or abs(source_us - odometry.source_us) * 1e-6 > max_age_s:
        return 0.0
    return odometry.roll_rad


def encode_mask(mask: U8, header: m.PictureHeader) -> Picture:
    """The mask as a PNG of class numbers, with the frame id of the picture it was made from."""
    height, width = mask.shape
    named = msgspec.structs.replace(header, width_px=width, height_px=height, media_type="image/png")
    return Picture(named, cv2.imencode(".png", mask)[1].tobytes())
