"""Runs many cases in worker processes and stores one file each, so that an interrupted suite can go on."""

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
from paani.whole_file import indented_json, write_whole
from paani_sim.trials.fingerprint import Fingerprint, FingerprintReader
from paani_sim.trials.result import TrialResult
from paani_sim.trials.run_trial import run_trial
from paani_sim.trials.trial_cases import TrialCase

RESULTS_FOLDER, EFFORTS_FOLDER = "trials", "efforts"
# Bounds the memory that an OpenGL driver leaks. Not the executor's own `max_tasks_per_child`: in Python 3.11 it can
# wait for ever for the process that replaces a worker.
DRIVES_PER_PROCESS = 32
NICENESS = 5
THREAD_COUNT_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


class StoredResult(msgspec.Struct, frozen=True, kw_only=True):
    """Content of one result file."""

    fingerprint: Fingerprint
    result: TrialResult


class FailedDrive(msgspec.Struct, frozen=True, kw_only=True):
    """A drive that raised an error instead of giving a result."""

    case: TrialCase
    reason: str


class StoredSuite(msgspec.Struct, frozen=True, kw_only=True):
    """Results that a run folder holds, cases still to be driven, and counts of outdated results by what differs."""

    results: dict[TrialCase, TrialResult]
    missing: tuple[TrialCase, ...]
    outdated: dict[str, int]


def find_stored_results(folder: Path, cases: Sequence[TrialCase], reader: FingerprintReader) -> StoredSuite:
    """Find the results of the folder that still hold. One with another fingerprint, or unreadable, is driven again."""
    results: dict[TrialCase, TrialResult] = {}
    missing: list[TrialCase] = []
    outdated: dict[str, int] = {}
    for case in cases:
        record, fingerprint = read_stored_result(result_path(folder, case)), reader.fingerprint(case)
        if record is not None and record.fingerprint == fingerprint:
            results[case] = record.result
            continue
        missing.append(case)
        if record is not None:
            name = "other " + ", ".join(record.fingerprint.list_differences(fingerprint))
            outdated[name] = outdated.get(name, 0) + 1
    return StoredSuite(results=results, missing=tuple(missing), outdated=outdated)


def run_cases(
    folder: Path, cases: Sequence[TrialCase], reader: FingerprintReader, sets: Sequence[str], jobs: int
) -> Iterator[tuple[TrialCase, TrialResult | FailedDrive]]:
    """Run each case and yield it when its files are written. When interrupted, workers end and written files stay.

    Raises UserError for the folder, and for a setting or a scenario that no drive can use.
    """
    for name in (RESULTS_FOLDER, EFFORTS_FOLDER):
        _make_folder(folder / name)
    for name in THREAD_COUNT_VARIABLES:
        os.environ[name] = "1"
    batch = DRIVES_PER_PROCESS * jobs
    for first in range(0, len(cases), batch):
        yield from _run_batch(folder, cases[first : first + batch], reader, sets, jobs)


def _run_batch(
    folder: Path, cases: Sequence[TrialCase], reader: FingerprintReader, sets: Sequence[str], jobs: int
) -> Iterator[tuple[TrialCase, TrialResult | FailedDrive]]:
    executor = concurrent.futures.ProcessPoolExecutor(
        min(jobs, len(cases)), mp_context=multiprocessing.get_context("spawn"), initializer=_initialise_worker
    )
    try:
        running = {
            executor.submit(_run_and_store, folder, case, reader.fingerprint(case), tuple(sets), jobs == 1): case
            for case in cases
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


def result_path(folder: Path, case: TrialCase) -> Path:
    """Path of a case's result."""
    return folder / RESULTS_FOLDER / f"{case.stem}.json"


def read_stored_result(path: Path) -> StoredResult | None:
    """Read a stored result; None if there is none or it cannot be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=StoredResult)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None


def encode_stored_result(record: StoredResult) -> bytes:
    """Bytes of a result file."""
    return indented_json(record)


def _run_and_store(
    folder: Path, case: TrialCase, fingerprint: Fingerprint, sets: tuple[str, ...], threads: bool
) -> TrialResult | FailedDrive:
    """Run one case in a worker process. The worker ends when its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():
        os._exit(1)
    try:
        result, effort = run_trial(case, sets, threads=threads)
    except UserError:
        raise
    except Exception as error:  # noqa: BLE001  # one drive that fails is a finding, not the end of the run
        return FailedDrive(case=case, reason=f"{type(error).__name__}: {error}")
    write_whole(folder / EFFORTS_FOLDER / f"{case.stem}.json", msgspec.json.encode(effort) + b"\n")
    write_whole(result_path(folder, case), encode_stored_result(StoredResult(fingerprint=fingerprint, result=result)))
    return result


def _initialise_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.nice(NICENESS)
    cv2.setNumThreads(1)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {path}: {error.strerror}") from error
