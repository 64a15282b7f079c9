"""Recorder process: every message on the bus, into files. No other process waits for it or stops with it."""

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
from paani.topic_names import present_name
from paani_services.recorder.backlog import Backlog, QueuedMessage
from paani_services.recorder.recording import MIB, Recording, remove_empty_files
from paani_services.recorder.system_description import describe_system

LOG = logging.getLogger(__name__)
POLL_PERIOD_S, WRITE_PERIOD_S = 0.1, 0.2
SYNC_PERIOD_S = 5.0  # a loss of power loses at most this much of a recording
INBOX_S, INBOX_EXTRA = 10.0, 32  # depth of an inbox: messages of this time at the nominal rate, and some more


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Record until told to stop, then finish the file. Raises UserError for a folder that cannot be written."""
    settings, folder = config.recorder, Path(config.recorder.folder)
    if not settings.folder:
        raise UserError("recorder.folder: not set (`paani up --record DIR` sets it)")
    await asyncio.to_thread(require_folder, folder)
    await asyncio.to_thread(remove_empty_files, folder)
    left_out = {present_name(name) for name in settings.leave_out}
    topics = [topic for topic in keys.every_topic(config.bus.graph) if topic.name not in left_out]
    recording = Recording(settings, await asyncio.to_thread(describe_system, config), topics)
    backlog = Backlog(settings.queue_messages, round(settings.queue_mib * MIB))
    loop, worker, stop = asyncio.get_running_loop(), ThreadPoolExecutor(1, "write"), threading.Event()
    await loop.run_in_executor(worker, recording.write, (), clock.now_us())
    state = bus.publisher(keys.RECORDER_STATE)
    listener = Listener(bus, topics, recording, backlog)
    try:
        with bus.alive():
            async with asyncio.TaskGroup() as group:
                group.create_task(publish_state(bus, clock, state, recording, backlog))
                group.create_task(repair_unfinished(folder, stop))
                group.create_task(listener.listen())
                group.create_task(sync_to_disk(recording))
                while True:
                    await loop.run_in_executor(worker, recording.write, backlog.drain(), clock.now_us())
                    await asyncio.sleep(WRITE_PERIOD_S)
    finally:
        stop.set()
        listener.poll()
        await loop.run_in_executor(worker, recording.close, backlog.drain(), clock.now_us())
        worker.shutdown(wait=False)


class Listener:
    """Counts the messages of these topics and queues them in the backlog."""

    def __init__(self, bus: Bus, topics: list[keys.Topic[Any]], recording: Recording, backlog: Backlog) -> None:
        self._counts, self._backlog = recording.counts, backlog
        self._inboxes = [(topic, bus.raw(topic, round(INBOX_S * topic.rate_hz) + INBOX_EXTRA)) for topic in topics]

    async def listen(self) -> None:
        while True:
            self.poll()
            await asyncio.sleep(POLL_PERIOD_S)

    def poll(self) -> None:
        """Count and queue what has been received since the last call."""
        for topic, inbox in self._inboxes:
            for log_us, data, attachment in inbox.drain():
                head = read_head(attachment if topic.stance is keys.Stance.PICTURE else data)
                self._counts.count_received(topic.name, head)
                for evicted in self._backlog.put(QueuedMessage(topic, log_us, head, data, attachment)):
                    self._counts.count_dropped(evicted.topic.name)


async def publish_state(
    bus: Bus, clock: Clock, state: Publisher[m.RecorderState], recording: Recording, backlog: Backlog
) -> None:
    """Publish the state of the recording, and one line of it for the health report."""
    while True:
        now = recorder_state(recording, len(backlog), clock.now_us())
        state.put(now)
        bus.note(now.problem or f"{now.file}: {now.written} written, {now.dropped} dropped")
        await asyncio.sleep(1.0 / keys.RECORDER_STATE.rate_hz)


async def sync_to_disk(recording: Recording) -> None:
    """Put the files on the disk in a thread of its own, since a slow disk must not hold up the writing."""
    while True:
        await asyncio.sleep(SYNC_PERIOD_S)
        await asyncio.to_thread(recording.sync_to_disk)


async def repair_unfinished(folder: Path, stop: threading.Event) -> None:
    """Repair the files that earlier recorders left unfinished, while this one already records."""
    for line in await asyncio.to_thread(repair_all, folder, stop.is_set):
        LOG.warning("%s", line)


def recorder_state(recording: Recording, waiting: int, now_us: int) -> m.RecorderState:
    """The message on the state of the recording."""
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
