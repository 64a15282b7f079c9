"""Drives many cases in processes of their own and keeps one file each, so that a run can be gone on with."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import cv2
import msgspec

from paani.errors import UserError
from paani.whole_file import write_whole
from paani_sim.trials.cases import Case
from paani_sim.trials.fingerprint import MadeWith, Maker
from paani_sim.trials.one import run_case
from paani_sim.trials.result import TrialResult

TRIALS, EFFORTS = "trials", "efforts"
# Bounds what a driver of OpenGL may leave behind. Not the executor's own `max_tasks_per_child`: in Python 3.11 it can
# wait for ever for the process that should take over.
DRIVES_PER_PROCESS = 32
NICE = 5
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """One result file."""

    made_with: MadeWith
    result: TrialResult


class Failure(msgspec.Struct, frozen=True, kw_only=True):
    """A drive that gave no result."""

    case: Case
    why: str


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """What a run folder already holds: results by case, what is still to be driven, and why of the old that are."""

    results: dict[Case, TrialResult]
    wanted: tuple[Case, ...]
    outdated: dict[str, int]


def look(folder: Path, cases: Sequence[Case], maker: Maker) -> Kept:
    """Which results of the folder hold. One that was made otherwise, or cannot be read, is wanted again."""
    results: dict[Case, TrialResult] = {}
    wanted: list[Case] = []
    outdated: dict[str, int] = {}
    for case in cases:
        record, made_with = read_record(result_path(folder, case)), maker.of(case)
        if record is not None and record.made_with == made_with:
            results[case] = record.result
            continue
        wanted.append(case)
        if record is not None:
            name = "other " + ", ".join(record.made_with.differs(made_with))
            outdated[name] = outdated.get(name, 0) + 1
    return Kept(results=results, wanted=tuple(wanted), outdated=outdated)


def drive_all(
    folder: Path, cases: Sequence[Case], maker: Maker, sets: Sequence[str], jobs: int
) -> Iterator[tuple[Case, TrialResult | Failure]]:
    """Each case as it is done, its files written. Interrupted, the processes end and what is written stays.

    Raises UserError for the folder, and for a setting or a scenario that no drive can use.
    """
    for name in (TRIALS, EFFORTS):
        _make_folder(folder / name)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    batch = DRIVES_PER_PROCESS * jobs
    for first in range(0, len(cases), batch):
        yield from _drive_batch(folder, cases[first : first + batch], maker, sets, jobs)


def _drive_batch(
    folder: Path, cases: Sequence[Case], maker: Maker, sets: Sequence[str], jobs: int
) -> Iterator[tuple[Case, TrialResult | Failure]]:
    executor = concurrent.futures.ProcessPoolExecutor(
        min(jobs, len(cases)), mp_context=multiprocessing.get_context("spawn"), initializer=_begin_process
    )
    try:
        running = {
            executor.submit(_drive, folder, case, maker.of(case), tuple(sets), jobs == 1): case for case in cases
        }
        for future in concurrent.futures.as_completed(running):
            case = running[future]
            try:
                yield case, future.result()
            except BrokenProcessPool:
                raise UserError(f"trial {case.name}: a process was killed; the same command goes on") from None
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def result_path(folder: Path, case: Case) -> Path:
    """Where its result lies."""
    return folder / TRIALS / f"{case.stem}.json"


def read_record(path: Path) -> Record | None:
    """None where there is none, or none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Record)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None


def encoded(record: Record) -> bytes:
    """The bytes of a result file."""
    return msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"


def _drive(
    folder: Path, case: Case, made_with: MadeWith, sets: tuple[str, ...], threads: bool
) -> TrialResult | Failure:
    """In a process of its own, which ends with the one that asked: what nobody waits for is not driven."""
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():
        os._exit(1)
    try:
        result, effort = run_case(case, sets, threads=threads)
    except UserError:
        raise
    except Exception as error:  # noqa: BLE001  # one drive that fails is a finding, not the end of the run
        return Failure(case=case, why=f"{type(error).__name__}: {error}")
    write_whole(folder / EFFORTS / f"{case.stem}.json", msgspec.json.encode(effort) + b"\n")
    write_whole(result_path(folder, case), encoded(Record(made_with=made_with, result=result)))
    return result


def _begin_process() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.nice(NICE)
    cv2.setNumThreads(1)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {path}: {error.strerror}") from error
