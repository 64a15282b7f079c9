"""The river driven by containers: board and host on networks of their own, and the emulated microcontroller."""

from __future__ import annotations

import asyncio
import contextlib
import io
import random
import tarfile
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus
from paani.clock import MonotonicClock
from paani.config import Config, load_config
from tests.arming import arm_on_page
from tests.at_work import at_work
from tests.bus_peers import joined, until
from tests.conftest import find_free_port
from tests.deploy.engine import Engine
from tests.fake_router import FakeRouter
from tests.firmware.emulator import Emulator, open_emulator
from tests.firmware.line_listener import pipe_to_router

CLOCK = MonotonicClock()
BOARD_PROFILES, HOST_PROFILES = "mcu", "sim,record"
MOVES_N = 0.5
GATEWAY = "{{(index .IPAM.Config 0).Gateway}}"
Action = Callable[[], object]
UNDER_WAY_S, BACK_S = 60.0, 60.0


class Drive:
    """A drive under way, as the host's bus tells of it. Times are of the monotonic clock [us]."""

    def __init__(self, engine: Engine, page: str, mcu: Emulator, bus: Bus) -> None:
        self.engine, self.page, self.mcu = engine, page, mcu
        self.applied: list[tuple[int, float]] = []  # when it was heard, newtons
        self.decisions = 0
        self.distance_m = self.collisions = 0.0
        self.bridge: m.BridgeState | None = None
        self.newest: dict[str, m.Message] = {}  # of what decides whether the boat moves
        topics: tuple[keys.Topic[Any], ...] = (keys.THRUST_APPLIED, keys.COMMAND, keys.OPERATOR_STATE, keys.ADVISORY)
        for topic in topics:
            bus.on(topic, self._hear)
        bus.on(keys.THRUST_APPLIED, self._hear_applied)
        bus.on(keys.EVIDENCE, self._hear_evidence)
        bus.on(keys.TRUE_POSE, self._hear_pose)
        bus.on(keys.BRIDGE_STATE, self._hear_bridge)

    def _hear(self, message: m.Message) -> None:
        self.newest[type(message).__name__] = message

    def _hear_applied(self, applied: m.ThrustApplied) -> None:
        self.applied.append((CLOCK.now_us(), applied.left_n + applied.right_n))

    def _hear_evidence(self, evidence: m.Evidence) -> None:
        self.decisions += evidence.usable

    def _hear_pose(self, pose: m.TruePose) -> None:
        self.distance_m, self.collisions = pose.distance_m, pose.collisions

    def _hear_bridge(self, state: m.BridgeState) -> None:
        self.bridge = state

    async def await_under_way(self) -> None:
        """Until the boat has been moving for a second."""

        def under_way() -> bool:
            newest = [force_n for at_us, force_n in self.applied if at_us > CLOCK.now_us() - 1_000_000]
            return len(newest) > 10 and all(abs(force_n) > MOVES_N for force_n in newest)

        await until(under_way, limit_s=UNDER_WAY_S)

    def zero_after_s(self, since_us: int) -> float:
        """From then to the first report of no thrust [s]; infinite where there was none."""
        still = (at_us - since_us for at_us, force_n in self.applied if at_us >= since_us and force_n == 0.0)
        return min(still, default=float("inf")) * 1e-6

    async def fault(self, begin: Action, lasts_s: float, end: Action) -> tuple[float, float]:
        """Seconds from the fault's beginning to no thrust, and from its end to thrust again."""
        await self.await_under_way()
        begun_us = CLOCK.now_us()
        await asyncio.to_thread(begin)
        await asyncio.sleep(lasts_s)
        await asyncio.to_thread(end)
        ended_us = CLOCK.now_us()
        await until(lambda: self.zero_after_s(begun_us) < float("inf"), limit_s=BACK_S)
        stopped_s = self.zero_after_s(begun_us)
        zero_us = begun_us + stopped_s * 1e6

        def moves() -> list[int]:
            return [at for at, force_n in self.applied if at > zero_us and abs(force_n) > MOVES_N]

        await until(lambda: bool(moves()), limit_s=BACK_S)
        return stopped_s, max(0.0, (moves()[0] - ended_us) * 1e-6)


def build(engine: Engine, *profiles: str) -> None:
    """The images of both sides, with those of profiles that have their own."""
    engine.ensure_base_image()
    for side in ("board", "host"):
        engine.compose(side, *(f"--profile={one}" for one in profiles), "build", "-q")


def start(engine: Engine) -> None:
    """Both sides, as deploy/README.md says: the board's, its credentials to the host, the host's."""
    engine.compose("board", "up", "-d", "--wait")
    packed = engine.pipe(b"", "exec", engine.container("board", "router"), "tar", "-c", "credentials")
    unpack = ("run", "--rm", "-T", "--no-deps", "--entrypoint", "tar", "setup", "-x")
    engine.pipe(packed, "compose", "-f", "deploy/compose.host.yaml", *unpack)
    engine.compose("host", "up", "-d", "--wait")


def stop(engine: Engine) -> None:
    """Containers, networks and volumes of both."""
    for side in ("host", "board"):
        engine.compose(side, "--profile", "*", "down", "--volumes", "-t", "5", check=False)


@contextlib.asynccontextmanager
async def afloat(engine: Engine, profiles: str, environment: Mapping[str, str]) -> AsyncIterator[None]:
    """Both sides alive with these profiles, of Compose and what else its environment tells it; nothing is armed."""
    engine.environment |= {
        "PAANI_LINK_ADDRESS": engine.docker("network", "inspect", "bridge", "-f", GATEWAY).strip(),
        "PAANI_LINK_PORT": str(find_free_port()),
        "COMPOSE_PROFILES": profiles,
        **environment,
    }
    try:
        await asyncio.to_thread(start, engine)
        yield
    except BaseException:
        for side in ("board", "host"):
            print(engine.compose(side, "logs", "--no-color", "--tail", "30", check=False))
        raise
    finally:
        await asyncio.to_thread(stop, engine)


@contextlib.asynccontextmanager
async def driving(engine: Engine) -> AsyncIterator[Drive]:
    """Both sides alive, armed on the page, with the microcontroller's image behind a router on the board's machine."""
    port = find_free_port()
    with tempfile.TemporaryDirectory(prefix="paani-", dir="/run") as line, tempfile.TemporaryDirectory() as runtime:
        await asyncio.to_thread(Path(line).chmod, 0o755)
        socket = Path(line) / "router.sock"
        places = {"PAANI_PAGE_PORT": str(port), "PAANI_BRIDGE": f"unix:/host{socket}"}
        async with (
            open_emulator() as mcu,
            _wired(mcu, socket),
            afloat(engine, f"{BOARD_PROFILES},{HOST_PROFILES}", places),
        ):
            config = await asyncio.to_thread(_own_settings, engine, Path(runtime))
            async with joined(config.bus, OBSERVER, 10.0) as bus:
                page = f"http://127.0.0.1:{port}"
                drive = Drive(engine, page, mcu, bus)
                await arm_on_page(page, config.bus)
                try:
                    yield drive
                except BaseException:
                    print(*drive.newest.values(), sep="\n")
                    raise


@contextlib.asynccontextmanager
async def _wired(mcu: Emulator, socket: Path) -> AsyncIterator[None]:
    router = FakeRouter(socket, random.Random(1))
    await router.start()
    await asyncio.to_thread(socket.chmod, 0o666)  # as the board's own
    try:
        async with at_work(pipe_to_router(mcu.guide, socket)):
            yield
    finally:
        await router.stop()


def _own_settings(engine: Engine, runtime: Path) -> Config:
    """Settings of an observer on the host's bus, and the operator's key."""
    host = engine.container("host", "operator")
    packed = engine.pipe(b"", "exec", host, "tar", "-c", "credentials", "operator-key")
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(runtime, filter="data")
    network = '{{(index .NetworkSettings.Networks "paani-host_bus").IPAddress}}'
    address = engine.docker("inspect", "-f", network, engine.container("host", "router")).strip()
    return load_config(sets=(f"bus.router=tcp/{address}:7447", f"bus.runtime_dir={runtime}"))
