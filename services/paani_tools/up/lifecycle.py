"""One run of the whole loop, from the first process to the last."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
import signal
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from typing import Any, NamedTuple

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import open_bus
from paani.clock import Clock, WallClock, stopwatch_ms
from paani.errors import UserError
from paani.sides import Side
from paani_tools.up.arm import arm_once, page_line
from paani_tools.up.collect import Collector
from paani_tools.up.other_side import report_other_side
from paani_tools.up.plan import Plan
from paani_tools.up.prepare import prepare_folder
from paani_tools.up.run_summary import Report, Summary
from paani_tools.up.silence import ROUTER
from paani_tools.up.supervise import RECORDER, ServiceFailed, Supervisor
from paani_tools.up.terminal import Display

READY_S = 120.0
PROGRESS_S = 0.2


class Outcome(NamedTuple):
    """Figures of the run, and the line that says why it ended badly (empty: it did not)."""

    report: Report
    failure: str


async def run_plan(
    plan: Plan, seconds: float | None, display: Display, during: Callable[[], Awaitable[None]] | None = None
) -> Outcome:
    """Run the plan for `seconds` after every service is alive (None: until a signal), then stop everything.

    during: awaited instead of the seconds; cancelled by a signal or a service that cannot be kept alive.
    Raises UserError when a service ends with a user's mistake; nothing is left running in any case.
    """
    clock, summary = WallClock(), Summary()
    logs = await asyncio.to_thread(prepare_folder, plan.config)
    supervisor = Supervisor(plan, logs, display.print_line)
    told_to_stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    signals = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup ignores it
        signals.append(signal.SIGHUP)
    for number in signals:
        loop.add_signal_handler(number, told_to_stop.set)
    failure = ""

    async def sleep() -> None:
        await asyncio.sleep(math.inf if seconds is None else seconds)

    try:
        await _run_until(told_to_stop, _run(plan, supervisor, summary, clock, display, during or sleep))
    except ServiceFailed as error:
        failure = str(error)
    finally:
        report = summary.report(clock.now_us(), plan.config.profile, plan.config.world.name, supervisor.restarts)
        if not failure and summary.begun and supervisor.missing:
            failure = f"not alive at the end: {', '.join(supervisor.missing)}"
        await supervisor.stop()
        for number in signals:
            loop.remove_signal_handler(number)
    return Outcome(report, failure)


async def _run(
    plan: Plan,
    supervisor: Supervisor,
    summary: Summary,
    clock: Clock,
    display: Display,
    during: Callable[[], Awaitable[None]],
) -> None:
    bus = collector = None
    try:
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(supervisor.keep_running(ROUTER), name=ROUTER)]
            bus = await open_bus(plan.config.bus, OBSERVER, clock)
            collector = Collector(bus, plan.config.bus.side, summary)
            for service in plan.services:
                bus.on(keys.health(service), functools.partial(_on_health, supervisor))
            works = [supervisor.follow_alive(bus), supervisor.watch(), collector.run()]
            if plan.config.bus.side is not Side.BOTH:
                works.append(report_other_side(bus, plan.config.bus, display.print_line))
            for work in works:
                tasks.append(group.create_task(work))
            if RECORDER in plan.services:
                tasks.append(group.create_task(supervisor.keep_running(RECORDER), name=RECORDER))
                await _await_recorder(supervisor)
            for name in plan.services:
                if name not in {ROUTER, RECORDER}:
                    tasks.append(group.create_task(supervisor.keep_running(name), name=name))
            await _await_all_alive(supervisor, display)
            if plan.config.dashboard.serve and "dashboard" in plan.services:
                display.print_line(await asyncio.to_thread(page_line, plan.config))
            if plan.config.up.arm_at_start and "operator" in plan.services:
                await arm_once(plan.config, clock, display.print_line)
            summary.begin(clock.now_us())
            await during()
            for task in tasks:
                task.cancel()
    except BaseExceptionGroup as group_error:
        raise _cause(group_error) from None
    finally:
        if collector is not None:
            collector.drain()
        if bus is not None:
            await bus.close()


async def _await_recorder(supervisor: Supervisor) -> None:
    """The recorder hears everybody's first word only if it is there before them."""
    try:
        await asyncio.wait_for(supervisor.is_alive(RECORDER), READY_S)
    except TimeoutError:
        raise ServiceFailed(f"not alive after {READY_S:.0f} s: {RECORDER}") from None


async def _await_all_alive(supervisor: Supervisor, display: Display) -> None:
    started_ms = stopwatch_ms()
    total = len(supervisor.units)
    while missing := supervisor.missing:
        elapsed_s = (stopwatch_ms() - started_ms) * 1e-3
        if elapsed_s > READY_S:
            raise ServiceFailed(f"not alive after {READY_S:.0f} s: {', '.join(missing)}")
        display.waiting(total - len(missing), total, missing, elapsed_s)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(supervisor.all_alive(), PROGRESS_S)
    display.print_line(f"all {total} processes alive after {(stopwatch_ms() - started_ms) * 1e-3:.1f} s")


async def _run_until(stop: asyncio.Event, work: Coroutine[Any, Any, None]) -> None:
    """Await the work, or give it up when told to stop."""
    run, stopping = asyncio.create_task(work), asyncio.create_task(stop.wait())
    await asyncio.wait({run, stopping}, return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    run.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await run


def _on_health(supervisor: Supervisor, health: m.Health) -> None:
    supervisor.on_health(health.service)


def _cause(group: BaseExceptionGroup[BaseException]) -> BaseException:
    """The reason to tell: a user's mistake before anything else."""
    leaves = list(_leaves(group))
    return next((leaf for kind in (UserError, ServiceFailed) for leaf in leaves if isinstance(leaf, kind)), leaves[0])


def _leaves(error: BaseException) -> Iterator[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        for inner in error.exceptions:
            yield from _leaves(inner)
    else:
        yield error
