"""Keeps every process of a plan running, and leaves none behind."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from paani.bus import Bus
from paani.clock import MonotonicClock
from paani.config import Config, encode_config
from paani.errors import UserError
from paani_tools.up.backoff import Backoff
from paani_tools.up.log_files import keep_bounded, open_log
from paani_tools.up.plan import Plan
from paani_tools.up.silence import ROUTER, Silence

WATCH_S = 0.5
RECORDER = "recorder"
# One group after the other, so that the recorder hears the others' last words. Together under 3 s.
STOP_RECORDER_S, STOP_ROUTER_S, KILL_S = 0.9, 0.4, 0.3
STOP_S = 1.3
GIVE_UP_FAILURES = 5  # ends in a row of a process that was never alive
USER_MISTAKE = 2
# One thread for each native library: the processes are the parallelism.
CHILD_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1",
    "MALLOC_ARENA_MAX": "2",
    "MUJOCO_GL": "egl",
}

Say = Callable[[str], None]


class ServiceFailed(Exception):
    """A process that ends again and again and was never alive."""


class ServiceProcess:
    """One service: its process, and what is known of it."""

    def __init__(self, name: str, log: Path) -> None:
        self.name, self.log = name, log
        self.process: asyncio.subprocess.Process | None = None
        self.backoff = Backoff(random.Random())
        self.alive = False
        self.ever_alive = False
        self.restarts = 0
        self.fallen = False

    def send(self, number: signal.Signals) -> None:
        """Signal the process group, if there still is one."""
        if self.process is not None and self.process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, number)


class Supervisor:
    """`keep_running`, `follow_alive` and `watch` run until cancelled; `stop` must follow."""

    def __init__(self, plan: Plan, logs: Path, say: Say) -> None:
        self._say = say
        self._clock = MonotonicClock()
        self._silence = Silence(self._clock.now_us())
        self._config = plan.config
        self.units = {name: ServiceProcess(name, logs / f"{name}.log") for name in plan.services}
        self._changed = asyncio.Event()
        self._stopping = False

    @property
    def restarts(self) -> dict[str, int]:
        """How often each process was started again."""
        return {name: unit.restarts for name, unit in self.units.items()}

    @property
    def missing(self) -> list[str]:
        """Services that are not alive now."""
        return [name for name, unit in self.units.items() if not unit.alive]

    async def is_alive(self, name: str) -> None:
        """Returns when this service is alive."""
        while not self.units[name].alive:
            self._changed.clear()
            await self._changed.wait()

    async def all_alive(self) -> None:
        """Returns when every service is alive."""
        while self.missing:
            self._changed.clear()
            await self._changed.wait()

    async def keep_running(self, name: str) -> None:
        """Start one process whenever it is not running.

        Raises UserError when it ends with a user's mistake before it was ever alive, NotKeptAlive when it cannot start.
        """
        unit = self.units[name]
        while not self._stopping:
            started_us = self._clock.now_us()
            await self._launch(unit)
            assert unit.process is not None
            code = await unit.process.wait()
            self._silence.ended(name)
            self._set_alive(unit, alive=False)
            # What worked before is no mistake in the settings: a camera was pulled out, a disk is gone.
            if code == USER_MISTAKE and not unit.ever_alive:
                raise UserError(await asyncio.to_thread(_mistake_text, unit))
            delay_s = unit.backoff.after((self._clock.now_us() - started_us) * 1e-6)
            if not unit.ever_alive and unit.backoff.failures >= GIVE_UP_FAILURES:
                last = await asyncio.to_thread(_last_line, unit.log)
                raise ServiceFailed(f"{name} ended {unit.backoff.failures} times before it was alive: {last}")
            self._say(f"{name} ended ({_exit_text(code)}); starting it again in {delay_s:.1f} s (log: {unit.log})")
            await asyncio.sleep(delay_s)
            unit.fallen = True
            unit.restarts += 1

    async def follow_alive(self, bus: Bus) -> None:
        """Liveliness tokens: alive means ready."""
        async for name, alive in bus.alive_events():
            if name in self.units:
                if alive:
                    self._silence.note_health(name, self._clock.now_us())
                self._set_alive(self.units[name], alive=alive)

    def on_health(self, name: str) -> None:
        """A service has reported its health. Called on any thread."""
        self._silence.note_health(name, self._clock.now_us())

    async def watch(self) -> None:
        """Kill what hangs, which `keep_running` starts again, and keep the logs bounded."""
        while True:
            await asyncio.sleep(WATCH_S)
            for unit in self.units.values():
                await asyncio.to_thread(keep_bounded, unit.log)
            for name in self._silence.hung(self._clock.now_us()):
                self._say(f"{name} hangs: killing it")
                self._silence.ended(name)
                self.units[name].send(signal.SIGKILL)

    async def stop(self) -> None:
        """SIGTERM to all but recorder and router, then to these; SIGKILL for what is still there. Under 3 s."""
        self._stopping = True
        others = [unit for name, unit in self.units.items() if name not in {ROUTER, RECORDER}]
        last = ((RECORDER, STOP_RECORDER_S), (ROUTER, STOP_ROUTER_S))
        groups = [(others, STOP_S), *(([self.units[name]], s) for name, s in last if name in self.units)]
        for units, limit_s in groups:
            for unit in units:
                unit.send(signal.SIGTERM)
                unit.send(signal.SIGCONT)
            await _await_ends(units, limit_s)
        for unit in self.units.values():
            unit.send(signal.SIGKILL)
        await _await_ends([*self.units.values()], KILL_S)

    async def _launch(self, unit: ServiceProcess) -> None:
        log = await asyncio.to_thread(open_log, unit.log, afresh=not unit.restarts)
        unit.process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "paani_tools.up.child",
            str(os.getpid()),
            unit.name,
            env=environment(self._config),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            process_group=0,
        )
        log.close()
        self._silence.started(unit.name, self._clock.now_us())

    def _set_alive(self, unit: ServiceProcess, *, alive: bool) -> None:
        if alive and unit.fallen:
            self._say(f"{unit.name} is back")
            unit.fallen = False
        unit.alive = alive
        unit.ever_alive |= alive
        self._changed.set()


def environment(config: Config) -> dict[str, str]:
    """What a process is started with."""
    return {**os.environ, **CHILD_ENVIRONMENT, "PAANI_CONFIG_JSON": encode_config(config).decode()}


async def _await_ends(units: list[ServiceProcess], limit_s: float) -> None:
    waits = [asyncio.create_task(unit.process.wait()) for unit in units if unit.process is not None]
    if waits:
        _, late = await asyncio.wait(waits, timeout=limit_s)
        for task in late:
            task.cancel()


def _exit_text(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit {code}"


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1] if lines else f"nothing in {log}"


def _mistake_text(unit: ServiceProcess) -> str:
    return _last_line(unit.log).removeprefix(f"paani {unit.name}: ").removeprefix("paani: ")
