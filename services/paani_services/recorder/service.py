"""Recorder process: everything on the bus, into files. Nothing waits for it, and nothing stops with it."""

from __future__ import annotations

import asyncio
import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from paani import keys
from paani import messages as m
from paani.bus import Bus, Publisher
from paani.clock import Clock
from paani.config import Config
from paani.errors import UserError
from paani.logs.folder import require_folder
from paani.logs.repair import repair_all
from paani.logs.writer import read_head
from paani_services.recorder.about import make_about
from paani_services.recorder.backlog import Backlog, Heard
from paani_services.recorder.recording import MIB, Recording, remove_empty

LOG = logging.getLogger(__name__)
LISTEN_S, WRITE_S = 0.1, 0.2
SYNC_S = 5.0  # a loss of power costs at most this
HELD_S, SPARE = 10.0, 32  # what Zenoh keeps of a topic between two looks


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Record until told to stop, then finish the file. Raises UserError for a folder that cannot be written."""
    settings, folder = config.recorder, Path(config.recorder.folder)
    if not settings.folder:
        raise UserError("recorder.folder: not set (`paani up --record DIR` sets it)")
    await asyncio.to_thread(require_folder, folder)
    await asyncio.to_thread(remove_empty, folder)
    topics = [topic for topic in keys.every_topic() if topic.name not in settings.leave_out]
    recording = Recording(settings, await asyncio.to_thread(make_about, config), topics)
    backlog = Backlog(settings.queue_messages, round(settings.queue_mib * MIB))
    loop, worker, stop = asyncio.get_running_loop(), ThreadPoolExecutor(1, "write"), threading.Event()
    await loop.run_in_executor(worker, recording.write, (), clock.now_us())
    state = bus.publisher(keys.RECORDER_STATE)
    listener = Listener(bus, topics, recording, backlog)
    try:
        with bus.alive():
            async with asyncio.TaskGroup() as group:
                group.create_task(tell(bus, clock, state, recording, backlog))
                group.create_task(mend(folder, stop))
                group.create_task(listener.listen())
                group.create_task(sync(recording))
                while True:
                    await loop.run_in_executor(worker, recording.write, backlog.drain(), clock.now_us())
                    await asyncio.sleep(WRITE_S)
    finally:
        stop.set()
        listener.take()
        await loop.run_in_executor(worker, recording.close, backlog.drain(), clock.now_us())
        worker.shutdown(wait=False)


class Listener:
    """Whatever comes on these topics waits in the backlog."""

    def __init__(self, bus: Bus, topics: list[keys.Topic[Any]], recording: Recording, backlog: Backlog) -> None:
        self._counts, self._backlog = recording.counts, backlog
        self._inboxes = [(topic, bus.raw(topic, round(HELD_S * topic.rate_hz) + SPARE)) for topic in topics]

    async def listen(self) -> None:
        while True:
            self.take()
            await asyncio.sleep(LISTEN_S)

    def take(self) -> None:
        """Count and keep what has come since the last time."""
        for topic, inbox in self._inboxes:
            for log_us, data, attachment in inbox.drain():
                head = read_head(attachment if topic.stance is keys.Stance.PICTURE else data)
                self._counts.heard(topic.name, head)
                for gone in self._backlog.put(Heard(topic, log_us, head, data, attachment)):
                    self._counts.dropped(gone.topic.name)


async def tell(
    bus: Bus, clock: Clock, state: Publisher[m.RecorderState], recording: Recording, backlog: Backlog
) -> None:
    """The state of the recording on the bus, and in one line for the health report."""
    while True:
        now = recorder_state(recording, len(backlog), clock.now_us())
        state.put(now)
        bus.note(now.problem or f"{now.file}: {now.written} written, {now.dropped} dropped")
        await asyncio.sleep(1.0 / keys.RECORDER_STATE.rate_hz)


async def sync(recording: Recording) -> None:
    """Beside the writing, which a slow disk must not hold up."""
    while True:
        await asyncio.sleep(SYNC_S)
        await asyncio.to_thread(recording.sync)


async def mend(folder: Path, stop: threading.Event) -> None:
    """Repair what earlier recorders left unfinished, while this one already records."""
    for line in await asyncio.to_thread(repair_all, folder, stop.is_set):
        LOG.warning("%s", line)


def recorder_state(recording: Recording, waiting: int, now_us: int) -> m.RecorderState:
    """What the recorder says of itself."""
    topics, path = recording.counts.topics(), recording.path
    return m.RecorderState(
        source_us=now_us,
        recording=path is not None,
        problem=recording.problem[:400],
        file=path.name if path is not None else "",
        since_us=recording.since_us,
        file_bytes=recording.size_bytes,
        free_bytes=recording.free_bytes,
        waiting=waiting,
        written=sum(topic.written for topic in topics),
        dropped=sum(topic.dropped for topic in topics),
        missing=sum(topic.missing for topic in topics),
        topics=topics,
    )
