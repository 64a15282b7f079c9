"""A drive that real processes made, recorded from a real bus: computed again anywhere, and republished."""

from __future__ import annotations

import asyncio
import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, open_bus
from paani.clock import WallClock
from paani.config import Config
from paani.logs.reader import open_log
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.unit.paani_tools.replay.recorded_drive import drive, write_log

pytestmark = pytest.mark.integration
CLOCK = WallClock()
DRIVE_S = 12.0
FAST = "advisor.people.uncalibrated_mps=1.0"  # the boat of the recording is faster than an uncalibrated camera allows
# What two machines can differ in: hash seed, threads, time zone, locale, and the C library's elementary functions.
ENVIRONMENTS: tuple[dict[str, str], ...] = (
    {"PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1", "TZ": "UTC", "LC_ALL": "C"},
    {"PYTHONHASHSEED": "12345", "OMP_NUM_THREADS": "8", "TZ": "Asia/Kolkata", "LC_ALL": "de_DE.UTF-8"},
    {"PYTHONHASHSEED": "random", "TZ": "America/St_Johns", "LANG": "tr_TR.UTF-8", "PYTHONUTF8": "0"},
    {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX", "PYTHONOPTIMIZE": "1"},
)


async def record(spawn: Spawn, open_as: OpenAs, config: Config, folder: Path, *sets: str) -> Path:
    """Real advisor, navigator and controller on evidence and estimates given here, recorded by the real recorder."""
    given = [r for r in await asyncio.to_thread(drive, DRIVE_S, config) if r.topic in GIVEN]
    types = {topic.name: topic for topic in keys.TOPICS}
    buses: dict[str, Bus] = {name: await open_as(name) for name in {types[r.topic].producer for r in given}}
    publishers = {name: buses[types[name].producer].publisher(types[name]) for name in GIVEN}
    (folder / "route.toml").write_text('name = "a"\n' + "".join(
        f"[[waypoints]]\nx_m = {x}.0\ny_m = {y}.0\n" for x, y in ((60, 0), (60, 40))
    ))  # fmt: skip
    async with (
        spawn("recorder", f"recorder.folder={folder}", FAST),
        spawn("advisor", FAST, *sets),
        spawn("navigator", f"navigator.route={folder / 'route.toml'}"),
        spawn("controller"),
    ):
        begin_us = CLOCK.now_us()
        for record in given:
            topic = types[record.topic]
            offset_us = begin_us - given[0].log_us
            await asyncio.sleep(max(0, record.log_us + offset_us - CLOCK.now_us()) * 1e-6)
            message = msgspec.json.decode(record.data, type=topic.type)
            publishers[topic.name].put(msgspec.structs.replace(message, source_us=message.source_us + offset_us))
        await asyncio.sleep(1.0)
    return folder


GIVEN = (keys.EVIDENCE.name, keys.ODOMETRY.name, keys.SIM_TIME.name, keys.ARMING.name)


def check(path: Path, environment: dict[str, str] | None = None) -> tuple[int, str]:
    result = subprocess.run(
        [sys.executable, "-m", "paani", "replay", str(path), "--check"],
        capture_output=True, text=True, check=False, env={**os.environ, **(environment or {})},
    )  # fmt: skip
    assert result.stderr == ""
    return result.returncode, result.stdout


def digest_of(text: str) -> str:
    return next(line for line in text.splitlines() if line.startswith("digest "))


async def test_what_real_processes_decided_is_decided_again(
    spawn: Spawn, open_as: OpenAs, config: Config, tmp_path: Path
) -> None:
    log = await record(spawn, open_as, config, tmp_path)
    code, text = await asyncio.to_thread(check, log)
    assert code == 0, text
    assert text.splitlines()[-1].endswith(" decisions, 0 differ")
    assert int(text.splitlines()[-1].split()[0]) > 150
    opened = await asyncio.to_thread(open_log, log)
    recorded = await asyncio.to_thread(lambda: list(opened.records([keys.THRUST.name])))
    thrusts = [msgspec.json.decode(record.data, type=m.Thrust) for record in recorded]
    assert sum(t.enabled and t.left + t.right > 0 for t in thrusts) > 20
    assert opened.problems == []


def test_every_environment_computes_the_same_bytes(tmp_path: Path) -> None:
    log = write_log(tmp_path / "drive.mcap", drive(40.0))
    results = [check(log, environment) for environment in ENVIRONMENTS]
    assert [code for code, _ in results] == [0] * len(ENVIRONMENTS), results
    assert len({digest_of(text) for _, text in results}) == 1


def test_twenty_repeats_are_one() -> None:
    """In one process; the other test repeats in others."""
    from paani.decider import decider_of  # noqa: PLC0415
    from paani_tools.replay.check import check_service  # noqa: PLC0415
    from paani_tools.replay.ledger import Ledger  # noqa: PLC0415
    from paani_tools.replay.recompute import RecordingFacts  # noqa: PLC0415
    from tests.unit.paani_tools.replay.recorded_drive import CONFIG  # noqa: PLC0415

    records = drive(10.0)
    for service in keys.DECIDING_SERVICES:
        decider = decider_of(service)
        mine = [r for r in records if r.topic in Ledger(decider).topics]
        checks = [check_service(decider, CONFIG, mine, RecordingFacts({}, ())) for _ in range(20)]
        assert all(result.is_exact for result in checks)
        assert len({result.digest for result in checks}) == 1


class Replay:
    """One `paani replay` as a user starts it, and the way to listen to it."""

    def __init__(self, process: asyncio.subprocess.Process, config: Config) -> None:
        self.process, self.config = process, config

    @classmethod
    async def start(cls, file: Path, config: Config, folder: Path, *words: str) -> Replay:
        bus = msgspec.structs.replace(
            config.bus,
            router=f"tcp/127.0.0.1:{find_free_port()}",
            runtime_dir=str(folder / "replay"),
            vessel="otter_replay",
        )
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "paani", "replay", str(file), *words,
            "--set", f"bus.router={bus.router}", "--set", f"bus.runtime_dir={bus.runtime_dir}",
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        assert process.stdout is not None
        assert b"vessel otter_replay" in await process.stdout.readline()
        return cls(process, msgspec.structs.replace(config, bus=bus))

    async def listen(self, user: str = "observer") -> Bus:
        credentials = Path(self.config.bus.runtime_dir) / "credentials" / user
        while not await asyncio.to_thread(credentials.is_file):
            await asyncio.sleep(0.02)
        return await open_bus(self.config.bus, user, CLOCK)

    async def end(self) -> tuple[int, str, str]:
        out, errors = await self.process.communicate()
        assert self.process.returncode is not None
        return self.process.returncode, out.decode(), errors.decode()


async def messages_from(replay: Replay, names: list[str], seconds: float) -> dict[str, list[Any]]:
    topics = [topic for topic in keys.TOPICS if topic.name in names]
    bus = await replay.listen()
    queues = {topic.name: bus.queue(topic, 5000) for topic in topics}
    await asyncio.sleep(seconds)
    found = {name: queue.drain() for name, queue in queues.items()}
    assert bus.drops == {}
    await bus.close()
    return found


async def test_a_replay_keeps_times_order_and_references(config: Config, tmp_path: Path) -> None:
    """New epochs, fresh stamps, true ages; what a message says of another still fits; no command is heard."""
    records = await asyncio.to_thread(drive, 8.0)
    file = await asyncio.to_thread(write_log, tmp_path / "drive.mcap", records)
    began_us = CLOCK.now_us()
    replay = await Replay.start(file, config, tmp_path, "--from", "0", "--loop")
    names = [topic.name for topic in (keys.EVIDENCE, keys.ADVISORY, keys.ODOMETRY, keys.COMMAND, keys.THRUST)]
    found = await messages_from(replay, names, 6.0)
    replay.process.terminate()
    code, _, errors = await replay.end()
    assert (code, errors) == (0, "")
    assert found[keys.COMMAND.name] == found[keys.THRUST.name] == []
    evidence = {(e.frame_epoch, e.frame_seq): e for e in found[keys.EVIDENCE.name]}
    assert len(evidence) > 15
    recorded_epoch = min(msgspec.json.decode(r.data)["epoch"] for r in records)
    matched = 0
    for advisory in found[keys.ADVISORY.name]:
        seen = evidence.get((advisory.frame_epoch, advisory.frame_seq))
        if seen is not None:
            matched += 1
            assert advisory.evidence_sent_us == seen.sent_us
            assert advisory.source_us == seen.source_us
            assert 0.0 < advisory.evidence_age_s < 0.2
    assert matched > 15
    odometry = found[keys.ODOMETRY.name]
    assert all(o.sent_us > began_us and abs(o.epoch - o.sent_us // 1000) < 60_000 for o in odometry)
    assert odometry[0].epoch != recorded_epoch
    gaps_us = [b.sent_us - a.sent_us for a, b in itertools.pairwise(odometry) if b.seq == a.seq + 1]
    assert 45_000 < sum(gaps_us) / len(gaps_us) < 55_000


async def test_faster_in_part_only_some_and_commands_when_asked(config: Config, tmp_path: Path) -> None:
    records = await asyncio.to_thread(drive, 20.0)
    file = await asyncio.to_thread(write_log, tmp_path / "drive.mcap", records)
    words = ("--speed", "4", "--from", "4", "--to", "16", "--commands", "--only", keys.THRUST.name, keys.ODOMETRY.name)
    replay = await Replay.start(file, config, tmp_path, *words, "--loop")
    found = await messages_from(replay, [topic.name for topic in keys.TOPICS], 4.0)
    replay.process.terminate()
    code, _, errors = await replay.end()
    assert (code, errors) == (0, "")
    assert {name for name, items in found.items() if items} == {keys.THRUST.name, keys.ODOMETRY.name}
    odometry = found[keys.ODOMETRY.name]
    assert all(79 <= o.seq <= 321 for o in odometry)
    gaps_us = [b.sent_us - a.sent_us for a, b in itertools.pairwise(odometry) if b.seq == a.seq + 1]
    assert 11_000 < sum(gaps_us) / len(gaps_us) < 14_000
    epochs = [o.epoch for o in odometry]
    assert epochs == sorted(epochs)  # the next pass is a new epoch, so that receivers follow


async def test_a_replay_that_ends_says_what_it_did(config: Config, tmp_path: Path) -> None:
    file = await asyncio.to_thread(lambda: write_log(tmp_path / "drive.mcap", drive(2.0)))
    replay = await Replay.start(file, config, tmp_path, "--speed", "10")
    code, out, errors = await replay.end()
    assert (code, errors) == (0, "")
    assert "messages republished; late by" in out


async def test_what_could_move_a_boat_ends_the_replay(config: Config, tmp_path: Path) -> None:
    file = await asyncio.to_thread(lambda: write_log(tmp_path / "drive.mcap", drive(10.0)))
    replay = await Replay.start(file, config, tmp_path, "--loop", "--commands")
    plant = await replay.listen("plant")
    with plant.alive():
        code, _, errors = await asyncio.wait_for(replay.end(), 20.0)
    await plant.close()
    assert code == 2
    assert "plant has joined the bus of this replay" in errors
    assert len(errors.splitlines()) == 1


async def test_a_live_bus_is_left_alone(config: Config, tmp_path: Path, open_as: OpenAs) -> None:
    await open_as("observer")  # a router listens there now
    file = await asyncio.to_thread(lambda: write_log(tmp_path / "drive.mcap", drive(2.0)))
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani", "replay", str(file), "--set", f"bus.router={config.bus.router}",
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    _, errors = await process.communicate()
    assert process.returncode == 2
    assert config.bus.router in errors.decode()
    assert len(errors.decode().splitlines()) == 1
