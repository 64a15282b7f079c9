"""Every test gets its own router, port and runtime folder; readiness is a liveliness token, never a sleep."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import itertools
import os
import signal
import socket
import sys
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import pytest
from blockbuster import blockbuster_ctx
from hypothesis import settings

from paani.bus import Bus, open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock
from paani.config import Config, load_config
from tests.claims_check.left_out import left_out_text
from tests.claims_check.table import read_table
from tests.places import ROOT
from tests.transcript import Transcript

ALONE = {"bench", "browser", "deploy", "fault", "firmware", "integration", "link"}  # folders
RESULTS_ALONE = {
    "bench": "board chain fleet judgement soak",
    "deploy": "images",
    "browser": """
        camera_labels devices_tab exposed_page fleet_page heading_verdicts health_tab indicator_strip installed
        legibility map_objects map_projection map_tiles mission_cells models_report recording_chip recordings_tab
        replay_page route_editor sensor_strip sizes tabs time tuning_strip
    """,
    "integration": """
        certificates claims_check cluster docs doctor examples fleet graphs inspect mavlink package
        replay trials up up_offline up_record
    """,
}  # by folder, the files that wait for results and do not watch the clock
BESIDE = {f"tests/{folder}/test_{name}.py" for folder, names in RESULTS_ALONE.items() for name in names.split()}
SOAK = "tests/bench/test_soak.py"  # first, as it sits out its minutes and hardly computes; it yields to nothing
IMAGES = "tests/deploy/test_images.py"  # next, as what drives in containers waits for them
STOPS_THE_BOAT = {"fault", "link"}  # folders
WORKER = "PYTEST_XDIST_WORKER" in os.environ  # other tests run at the same time
NICENESS = 5  # workers that compute leave more than half of two cores to the one that watches the clock
MAX_REASON_CHARACTERS = 300

settings.register_profile("quick", max_examples=15, deadline=None)  # for `make check`; everything else tries more
settings.register_profile("thorough", deadline=None)  # a busy machine fails no test
settings.load_profile("thorough")

pytest_plugins = ("tests.rotation",)

FIRST_PORT, PORTS_OF_A_WORKER, PORT_WORKERS = 20_000, 3_000, 4
START_TIMEOUT_S = 40.0
STOP_TIMEOUT_S = 10.0

Spawn = Callable[..., AbstractAsyncContextManager[asyncio.subprocess.Process]]
OpenAs = Callable[[str], Awaitable[Bus]]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the golden files anew")
    parser.addoption("--transcripts", type=Path, metavar="FOLDER", help="leave what clients of the ports said there")


def is_alone(nodeid: str) -> bool:
    """Whether a test starts processes or watches the clock, by its folder and file."""
    return nodeid.split("/")[1] in ALONE and nodeid.partition("::")[0] not in BESIDE


def is_whole_run(config: pytest.Config) -> bool:
    """Whether all tests were asked for, as `make test` does."""
    return [Path(arg).resolve() for arg in config.args] == [ROOT / "tests"]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In a whole run what watches the clock or takes longest comes first, and what starts processes gets a second try.

    The summary tells of it; what stops the boat gets none. Named tests run in the order in which they are named.
    """
    if is_whole_run(config):
        items.sort(key=lambda item: (not is_alone(item.nodeid), not item.nodeid.startswith((SOAK, IMAGES))))
        for item in items:
            if item.nodeid.split("/")[1] in ALONE - STOPS_THE_BOAT:
                item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """One worker has all that watches the clock, one test after the other; the rest is shared out file by file."""
    from xdist.scheduler import LoadScopeScheduling  # noqa: PLC0415  a single process does without it

    class AloneFirst(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
        def _split_scope(self, nodeid: str) -> str:
            return "alone" if is_alone(nodeid) else nodeid.partition("::")[0]

    config.option.loadscopereorder = False
    return AloneFirst(config, log)


@functools.cache
def yield_the_processors() -> None:
    """Give this process and its children what others leave, those of other sessions and containers too.

    Linux shares the processors among sessions first, and niceness counts within one alone (sched(7), autogroup).
    """
    os.setpriority(os.PRIO_PROCESS, 0, max(NICENESS, os.getpriority(os.PRIO_PROCESS, 0)))
    with contextlib.suppress(OSError):  # the first of its session already, or a kernel without such groups
        os.setsid()
        Path("/proc/self/autogroup").write_text(str(NICENESS), encoding="ascii")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """What may run beside a test that watches the clock yields to it and to its processes.

    The worker that has those gets them first, and only then yields as well.
    """
    if WORKER and not is_alone(item.nodeid) and not item.nodeid.startswith(SOAK):
        yield_the_processors()
    if item.get_closest_marker("train"):
        import torch  # noqa: PLC0415  only these tests have it

        torch.set_num_threads(1)  # steps of networks this small wait for each other's threads most of the time


class WhatRan:
    """The tests that ran and those that skipped, from the reports of all workers; told at the very end."""

    def __init__(self) -> None:
        self.ran: set[str] = set()
        self.skipped: dict[str, str] = {}
        self.tier_s: defaultdict[str, float] = defaultdict(float)  # setup and teardown included
        self.first_tries: dict[str, str] = {}  # why those failed that were tried once more

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = report.nodeid.partition("[")[0]
        self.tier_s[name.split("/")[1]] += report.duration
        if str(report.outcome) == "rerun":  # a plugin's word, of which the type knows nothing
            crash = getattr(report.longrepr, "reprcrash", None)
            self.first_tries[report.nodeid] = str(report.longrepr) if crash is None else crash.message
        if report.skipped:
            self._skip(name, report.longrepr)
        elif report.when == "call":
            self.ran.add(name)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self._skip(report.nodeid, report.longrepr)

    def _skip(self, name: str, why: object) -> None:
        self.skipped[name] = str(why[2]).removeprefix("Skipped: ") if isinstance(why, tuple) else str(why)


def pytest_configure(config: pytest.Config) -> None:
    """A run of everything ends with why first tries failed, the time of each tier, and the statements left out."""
    if not WORKER and is_whole_run(config):
        config.pluginmanager.register(WhatRan(), WhatRan.__name__)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    found = config.pluginmanager.get_plugin(WhatRan.__name__)
    if found is not None and found.ran:
        longest_first = sorted(found.tier_s.items(), key=lambda each: -each[1])
        for name, why in sorted(found.first_tries.items()):
            print(f"First try of {name}:", " ".join(why.split())[:MAX_REASON_CHARACTERS])
        print("Seconds by tier:", ", ".join(f"{tier} {time_s:.0f}" for tier, time_s in longest_first))
        print(left_out_text(read_table(ROOT), found.ran, found.skipped), end="\n")


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-golden"))


@pytest.fixture(autouse=True, scope="session")
def no_blocking_calls() -> Iterator[None]:
    """Our code may not block the event loop; the detector watches only our packages."""
    with blockbuster_ctx(["paani", "paani_services", "paani_sim"]):
        yield


@pytest.fixture
def free_port() -> int:
    return find_free_port()


def find_free_port() -> int:
    """A port that is free, and given to nobody else before long: not to another worker, nor by the system.

    A test's processes open it seconds later, and two routers at one port would be one bus.
    """
    for port in _ports():
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


@functools.cache
def _ports() -> Iterator[int]:
    """The ports of this worker, one after the other from anywhere; all lie below those that Linux gives by itself."""
    number = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % PORT_WORKERS
    first = FIRST_PORT + number * PORTS_OF_A_WORKER
    begin = os.getpid() % PORTS_OF_A_WORKER
    return itertools.cycle(first + (begin + step) % PORTS_OF_A_WORKER for step in range(PORTS_OF_A_WORKER))


@pytest.fixture
def private_sets(tmp_path: Path) -> tuple[str, ...]:
    """Settings that keep one test's bus apart from every other."""
    return (
        f"bus.router=tcp/127.0.0.1:{find_free_port()}",
        f"bus.runtime_dir={tmp_path / 'runtime'}",
        f"dashboard.port={find_free_port()}",
    )


@pytest.fixture
def transcript(request: pytest.FixtureRequest) -> Iterator[Transcript]:
    """Of this test's session, left in the folder of `--transcripts`."""
    made = Transcript()
    yield made
    folder: Path | None = request.config.getoption("--transcripts")
    if folder is not None:
        made.write(folder / f"{request.node.name.removeprefix('test_')}.txt")


@pytest.fixture
def config(private_sets: tuple[str, ...]) -> Config:
    return load_config(sets=private_sets)


@pytest.fixture
async def open_as(config: Config) -> AsyncIterator[OpenAs]:
    """`await open_as("advisor")` opens the bus as that user, on a real router that runs in this process."""
    router = await open_router(config.bus)
    opened: list[Bus] = []

    async def open_as(user: str) -> Bus:
        bus = await open_bus(config.bus, user, WallClock())
        opened.append(bus)
        return bus

    yield open_as
    for bus in opened:
        await bus.close()
    await asyncio.to_thread(router.close)


@pytest.fixture
def spawn(open_as: OpenAs, private_sets: tuple[str, ...]) -> Spawn:
    """`async with spawn("advisor", "advisor.rate_hz=50"):` runs the real process; a dirty exit fails the test."""

    @contextlib.asynccontextmanager
    async def spawn(service: str, *sets: str) -> AsyncIterator[asyncio.subprocess.Process]:
        arguments = [word for setting in (*private_sets, *sets) for word in ("--set", setting)]
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "paani",
            "run",
            service,
            *arguments,
            stderr=asyncio.subprocess.PIPE,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        try:
            await wait_alive(await open_as("observer"), service, process)
            yield process
        finally:
            if process.returncode is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
            async with asyncio.timeout(STOP_TIMEOUT_S):
                _, errors = await process.communicate()
        assert process.returncode == 0, f"{service} exited {process.returncode}: {errors.decode()[-2000:]}"

    return spawn


def put_raw(bus: Bus, name: str, data: bytes) -> None:
    """Write any bytes below the vessel's prefix, as a faulty or hostile peer would."""
    bus._session.put(f"{bus.prefix}/{name}", data)


async def wait_alive(bus: Bus, service: str, process: asyncio.subprocess.Process) -> None:
    """Return when the service's liveliness token is there; fail at once when it exits first."""

    async def token() -> None:
        async for name, alive in bus.alive_events():
            if name == service and alive:
                return

    waiting = [asyncio.create_task(token()), asyncio.create_task(process.wait())]
    try:
        async with asyncio.timeout(START_TIMEOUT_S):
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in waiting:
            task.cancel()
    if process.returncode is not None:
        assert process.stderr is not None
        pytest.fail(f"{service} exited {process.returncode}: {(await process.stderr.read()).decode()[-2000:]}")
