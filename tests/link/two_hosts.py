"""The river driven by two hosts: `paani up --only board` and `--only host` in a namespace each, and what is heard."""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import msgspec

from paani.authority import credentials_folder, ensure_credentials
from paani.clock import MonotonicClock
from paani.config import load_config
from tests.link.listener import Applied, Decided, Dropped, Line
from tests.link.namespaces import Link, address, emulated_link

CLOCK = MonotonicClock()
PORT, LINK_PORT = 7447, 7448
START_S, UNDER_WAY_S = 60.0, 60.0
MOVES_N = 0.5


class Drive:
    """A drive under way: its link, and what was heard in the host's namespace."""

    def __init__(self, link: Link, folder: Path, host: subprocess.Popen[str], board: subprocess.Popen[str]) -> None:
        self.link, self.folder, self.host, self.board = link, folder, host, board
        self.applied: list[Applied] = []
        self.decided: list[Decided] = []
        self.drops: dict[str, dict[str, int]] = {}

    def hear(self, output: Iterator[str]) -> None:
        """Take lines of the listener until it ends."""
        decoder: msgspec.json.Decoder[Line] = msgspec.json.Decoder(Line)
        for text in output:
            match decoder.decode(text):
                case Applied() as applied:
                    self.applied.append(applied)
                case Decided() as decided:
                    self.decided.append(decided)
                case Dropped(service=service, drops=drops):
                    self.drops[service] = drops

    def wait(self, seconds: float) -> None:
        """Let it drive. Raises AssertionError if a side ends."""
        self.until(lambda: False, seconds, "")

    def until(self, condition: Callable[[], bool], limit_s: float, what: str) -> None:
        """Wait for a condition; with `what`, fail where it does not come."""
        deadline_us = CLOCK.now_us() + round(limit_s * 1e6)
        while not condition():
            for name, process in (("board", self.board), ("host", self.host)):
                assert process.poll() is None, f"the {name} ended: {(self.folder / f'{name}.out').read_text()}"
            if CLOCK.now_us() > deadline_us:
                newest = f"{self.applied[-3:]}, {self.decided[-3:]}"
                assert not what, f"not within {limit_s} s: {what}; {newest} {self.output()}"
                return
            threading.Event().wait(0.02)

    def newest_us(self) -> int:
        """When the thrust adapter was heard last."""
        return self.applied[-1].at_us

    def output(self) -> str:
        """What both sides printed."""
        return "".join((self.folder / f"{name}.out").read_text() for name in ("board", "host"))

    def await_under_way(self) -> None:
        """Until the boat has been moving for a second."""

        def under_way() -> bool:
            newest = [each for each in list(self.applied) if each.at_us > CLOCK.now_us() - 1_000_000]
            return len(newest) > 10 and all(abs(each.force_n) > MOVES_N for each in newest)

        self.until(under_way, UNDER_WAY_S, "the boat under way")

    def cut(self, seconds: float) -> tuple[int, int]:
        """Cut the link; returns when it went and when it was back [us]."""
        cut_us = CLOCK.now_us()
        self.link.set(cut=True)
        self.wait(seconds)
        back_us = CLOCK.now_us()
        self.link.set(cut=False)
        return cut_us, back_us

    def zero_after_s(self, cut_us: int) -> float:
        """From the cut to the first step without thrust [s]; infinite where there was none."""
        after = [each for each in self.applied if each.at_us >= cut_us]
        return next(((each.at_us - cut_us) * 1e-6 for each in after if each.force_n == 0.0), float("inf"))

    def await_thrust_after(self, back_us: int, limit_s: float) -> float:
        """From the return of the link to thrust again [s]."""

        def first() -> Applied | None:
            return next((a for a in list(self.applied) if a.at_us > back_us and abs(a.force_n) > MOVES_N), None)

        self.until(lambda: first() is not None, limit_s, "thrust after the cut")
        found = first()
        assert found is not None
        return (found.at_us - back_us) * 1e-6


@contextlib.contextmanager
def driving(
    folder: Path,
    *,
    world: str = "river",
    sets: tuple[str, ...] = (),
    seed: int = 1,
    board_env: Mapping[str, str] | None = None,
) -> Iterator[Drive]:
    """Both sides alive, with the same credentials; stopped afterwards. The host's figures are in host.json then."""
    with emulated_link(seed) as link, contextlib.ExitStack() as stack:
        processes = {}
        runtime = folder / "runtime"
        own = (
            f"bus.router=tcp/127.0.0.1:{PORT}",
            f"bus.link={address('board', LINK_PORT)}",
            f"bus.runtime_dir={runtime}",
        )
        ensure_credentials(load_config(sets=own).bus)
        assert credentials_folder(load_config(sets=own).bus).is_dir()
        words = [word for setting in (*own, *sets) for word in ("--set", setting)]
        for side in ("board", "host"):
            output = stack.enter_context((folder / f"{side}.out").open("w"))
            summary = ["--summary", str(folder / f"{side}.json")]
            # Shared memory is off for every session (paani.bus.session): it would pass by the link.
            processes[side] = link.start(
                side,
                "-m",
                "paani",
                "up",
                "--only",
                side,
                "--headless",
                "--world",
                world,
                *summary,
                *words,
                env=board_env if side == "board" else None,
                stdout=output,
            )
        drive = Drive(link, folder, processes["host"], processes["board"])
        drive.until(lambda: drive.output().count("alive after") == 2, START_S, "both sides alive")
        listener = link.start("host", "-m", "tests.link.listener", *words, stdout=subprocess.PIPE)
        assert listener.stdout is not None
        hearing = threading.Thread(target=drive.hear, args=(stack.enter_context(listener.stdout),), daemon=True)
        hearing.start()
        try:
            yield drive
        finally:
            link.stop(listener)
            hearing.join(5.0)
            link.stop(processes["host"])
            link.stop(processes["board"])
