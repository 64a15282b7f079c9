"""MAVProxy, as a process, runs a mission on the simulated river, is refused, and is lost."""

from __future__ import annotations

import asyncio
import importlib.util
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.bus import open_bus
from paani.clock import WallClock
from tests.integration.mavlink_river import River, river_in, until
from tests.transcript import Transcript

pytestmark = [
    pytest.mark.integration,
    pytest.mark.slow,
    pytest.mark.timeout(400),
    pytest.mark.skipif(importlib.util.find_spec("MAVProxy") is None, reason="MAVProxy is not installed"),
]
COMMAND, LATITUDE = 3, 8  # columns of a file of waypoints
UNPRINTED = re.compile(r"[^\x20-\x7e\n]")
LIMIT_S = 30.0  # for a word of the boat
MODULES = "--default-modules=param,wp,fence,arm,mode"


@pytest.fixture
def river(tmp_path: Path) -> Iterator[River]:
    with river_in(tmp_path) as started:
        yield started


class Console:
    """What is typed and printed."""

    def __init__(self, process: asyncio.subprocess.Process, transcript: Transcript) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        self._input, self._output, self._transcript = process.stdin, process.stdout, transcript
        self.printed = ""

    async def expect(self, text: str, command: str = "", refused: str = "") -> None:
        """Type a command, and read until this is printed.

        refused: printed where the command is to be typed again: on a busy machine a process of the boat may be silent
        for a moment.
        """
        self._type(command)
        try:
            async with asyncio.timeout(60.0):
                while text not in self.printed:
                    read = await self._output.read(4096)
                    assert read, self.printed
                    self.printed += UNPRINTED.sub("", read.decode(errors="replace"))
                    if refused and refused in self.printed:
                        await asyncio.sleep(1.0)
                        self._type(command)
        except TimeoutError:
            pytest.fail(f"not printed: {text!r}, but {self.printed}")
        finally:
            self._transcript.note("MAVProxy", self.printed)

    def _type(self, command: str) -> None:
        self.printed = ""
        self._transcript.note("typed", command)
        self._input.write(f"{command}\n".encode() if command else b"")


async def test_mavproxy_runs_a_mission_is_refused_and_is_lost(
    river: River, tmp_path: Path, transcript: Transcript
) -> None:
    bus = await open_bus(river.config.bus, "observer", WallClock())
    states, speeds, missions = (bus.latest(key) for key in (keys.OPERATOR_STATE, keys.ODOMETRY, keys.MISSION))
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-W", "ignore", "-m", "MAVProxy.mavproxy", "--master", f"tcp:127.0.0.1:{river.tcp}", "--nowait",
        f"--state-basedir={tmp_path}", MODULES, cwd=tmp_path, env={**os.environ, "HOME": str(tmp_path)},
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    console = Console(process, transcript)
    try:
        await console.expect("Received")  # all parameters: the refusal of the file was understood
        await console.expect("CRUISE_SPEED     0.6", "param show CRUISE_SPEED")
        await console.expect("CRUISE_SPEED: is not tunable", "param set CRUISE_SPEED 3")
        await console.expect("mode: no home", "mode RTL")
        await console.expect("Saved", "wp list")
        assert "177 3" in console.printed

        # Its mission without the jump and a fence around it; one with a take-off and one that leaves the fence.
        await console.expect("Saved", "wp save saved.txt")
        head, *lines = (tmp_path / "saved.txt").read_text().splitlines()
        items = [line.split("\t") for line in lines if line.split("\t")[COMMAND] == "16"]
        last = [str(len(items)), *items[-1][1:]]

        def save(name: str, *rows: list[str]) -> None:
            (tmp_path / name).write_text("\n".join((head, *("\t".join(row) for row in rows), "")))

        save("own.txt", *items)
        save("takeoff.txt", *items, [*last[:COMMAND], "22", *last[COMMAND + 1 :]])
        save("outside.txt", *items, [*last[:LATITUDE], "51.0", *last[LATITUDE + 1 :]])
        latitudes, longitudes = ([float(item[at]) for item in items[1:]] for at in (LATITUDE, LATITUDE + 1))
        (south, north), (west, east) = ((min(each) - 1e-3, max(each) + 1e-3) for each in (latitudes, longitudes))
        corners = ((south, west), (south, east), (north, east), (north, west))
        save("fence.txt", *(
            [str(seq), "0", "0", "5001", "4", "0", "0", "0", str(corner[0]), str(corner[1]), "0", "1"]
            for seq, corner in enumerate(corners)
        ))  # fmt: skip
        await console.expect("TYPE_MISSION: ACCEPTED", "wp load own.txt", "TYPE_MISSION: DENIED")
        mission = await until(missions.next, lambda mission: mission.accepted_us > 0, LIMIT_S)
        assert [len(leg.waypoints) for leg in mission.legs] == [len(items) - 1]
        await console.expect("TYPE_FENCE: ACCEPTED", "fence load fence.txt", "TYPE_FENCE: DENIED")
        mission = await until(missions.next, lambda mission: bool(mission.fence), LIMIT_S)
        assert [len(area.corners) for area in mission.fence] == [4]
        await console.expect("TYPE_MISSION: UNSUPPORTED", "wp load takeoff.txt")
        assert "the boat cannot do command 22" in console.printed
        await console.expect("TYPE_MISSION: INVALID", "wp load outside.txt", "TYPE_MISSION: DENIED")
        assert "is outside the fence" in console.printed

        await console.expect("COMPONENT_ARM_DISARM: ACCEPTED", "arm throttle", "COMPONENT_ARM_DISARM: FAILED")
        assert (await until(states.next, lambda state: state.armed, LIMIT_S)).by == "mavlink"
        await console.expect("DO_SET_MODE: ACCEPTED", "mode AUTO", "DO_SET_MODE: DENIED")
        await until(speeds.next, lambda own: own.surge_mps >= 0.2, LIMIT_S)
        transcript.note("boat", "makes way")
        await console.expect("Mode RTL", "mode RTL", "DO_SET_MODE: DENIED")
        await until(states.next, lambda state: state.mode is m.DriveMode.RETURN, LIMIT_S)
    finally:
        process.kill()
        await process.wait()
    transcript.note("MAVProxy", "is killed: the link is lost")
    state = await until(states.next, lambda state: state.stopped, LIMIT_S)
    assert (state.by, state.armed) == ("mavlink", False)
    transcript.note("boat", f"STOP, asked by {state.by}; not armed")
    await until(speeds.next, lambda own: own.surge_mps <= 0.1, LIMIT_S)
    transcript.note("boat", "stands")
    await bus.close()
