"""Runs payloads of a seed through one target, with memory bounded, and counts what came of them."""

from __future__ import annotations

import collections
import contextlib
import random
import resource
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from paani.clock import process_cpu_s, stopwatch_ms
from tests.fuzz.bus_messages import ArmedBoat, DisarmedChain
from tests.fuzz.files import FILES
from tests.fuzz.lines import LINES
from tests.fuzz.pictures import PICTURES
from tests.fuzz.recordings import RECORDINGS
from tests.fuzz.target import ContractError, Target

TARGETS: tuple[type[Target], ...] = (DisarmedChain, ArmedBoat, *FILES, *LINES, *RECORDINGS, *PICTURES)
# What may be taken beyond what the process has when it begins. The largest picture takes 200 MB.
MEMORY_BYTES = 512 << 20
SLOW_S = 5.0  # of a processor, for one payload
KEPT = 5  # payloads that broke something, of each target


class Crash(msgspec.Struct, frozen=True):
    """A payload after which something else happened than letting in or refusing."""

    error: str
    data: bytes


class Tally(msgspec.Struct):
    """What came of the payloads of one target. `longest_ms`: of a processor, for one payload.

    `peak_mib`: resident memory beyond what it began with.
    """

    target: str
    given: int = 0
    accepted: int = 0
    refused: dict[str, int] = {}
    crashes: int = 0
    kept: list[Crash] = []
    seconds: float = 0.0
    longest_ms: float = 0.0
    peak_mib: float = 0.0


def share_of(kind: type[Target], count: int) -> int:
    """How many of all payloads are this target's; at least one."""
    return max(1, round(count * kind.share / sum(each.share for each in TARGETS)))


def run_target(kind: type[Target], count: int, seed: int, report: Callable[[int], None] = lambda given: None) -> Tally:
    """Give a target its payloads. A crash is counted, and the target begins anew."""
    tally, refused = Tally(kind.name), collections.Counter[str]()
    rng = random.Random(f"{seed} {kind.name}")
    began_ms = stopwatch_ms()
    with contextlib.ExitStack() as stack:
        target = _opened(kind, rng, stack)
        before_mib = _reset_peak_mib()
        stack.enter_context(bounded_memory())
        while tally.given < count:
            data = target.payload()
            before_s = process_cpu_s()
            try:
                cause = target.take(data)
                if process_cpu_s() - before_s > SLOW_S:
                    raise ContractError(f"took {process_cpu_s() - before_s:.0f} s")
            except Exception as error:  # noqa: BLE001  # whatever it is, it is what is looked for
                tally.crashes += 1
                if len(tally.kept) < KEPT:
                    tally.kept.append(Crash(_place(error), data))
                target = _opened(kind, rng, stack)
            else:
                if cause:
                    refused[cause] += 1
                else:
                    tally.accepted += 1
            tally.longest_ms = max(tally.longest_ms, 1e3 * (process_cpu_s() - before_s))
            tally.given += 1
            report(tally.given)
        tally.peak_mib = max(0.0, _peak_mib() - before_mib)
    tally.seconds = (stopwatch_ms() - began_ms) * 1e-3
    tally.refused = dict(refused.most_common())
    return tally


def replay(kind: type[Target], data: bytes) -> str:
    """One payload through a target of its own: empty where it was let in, else why not. Raises what breaks."""
    with contextlib.ExitStack() as stack:
        target = _opened(kind, random.Random(0), stack)
        stack.enter_context(bounded_memory())
        return target.take(data)


@contextlib.contextmanager
def bounded_memory() -> Iterator[None]:
    """No more than `MEMORY_BYTES` beyond what this process has now: whoever wants more gets a MemoryError."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    status = Path("/proc/self/status").read_text(encoding="ascii")
    has_bytes = int(status.partition("VmData:")[2].split()[0]) << 10
    resource.setrlimit(resource.RLIMIT_DATA, (has_bytes + MEMORY_BYTES, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def _opened(kind: type[Target], rng: random.Random, stack: contextlib.ExitStack) -> Target:
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="paani-fuzz-")))
    target = kind(folder, rng)
    stack.callback(target.close)
    return target


def _place(error: BaseException) -> str:
    """The error, and where in our code it came out."""
    places, trace = [], error.__traceback__
    while trace is not None:
        places.append(f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}")
        trace = trace.tb_next
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{text[:200]} at {' < '.join(reversed(places[-6:]))}"


def _reset_peak_mib() -> float:
    """Begin counting the peak of resident memory anew; its value now."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    return _peak_mib()


def _peak_mib() -> float:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024.0
