"""Runs many cases, in processes here or on a cluster, and stores one file each: an interrupted suite can go on."""

from __future__ import annotations

import concurrent.futures
import contextlib
import functools
import multiprocessing
import os
import platform
from collections.abc import Generator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import msgspec

from paani.cluster import Workers
from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import indented_json, write_whole
from paani_sim.trials.fingerprint import Fingerprint, FingerprintReader
from paani_sim.trials.result import TrialResult
from paani_sim.trials.run_trial import ComputeEffort, run_trial
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.trials.worker_processes import open_processes

RESULTS_FOLDER, EFFORTS_FOLDER = "trials", "efforts"
# Bounds the memory that an OpenGL driver leaks. Not the executor's own `max_tasks_per_child`: in Python 3.11 it can
# wait for ever for the process that replaces a worker.
DRIVES_PER_PROCESS = 32
THREAD_COUNT_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


class StoredResult(msgspec.Struct, frozen=True, kw_only=True):
    """Content of one result file."""

    fingerprint: Fingerprint
    result: TrialResult


class FailedDrive(msgspec.Struct, frozen=True, kw_only=True):
    """A drive that raised an error instead of giving a result."""

    case: TrialCase
    reason: str


class DriveOrder(msgspec.Struct, frozen=True):
    """One piece of work: a case, what its result is to depend on, and settings. threads: as of `run_trial`."""

    case: TrialCase
    fingerprint: Fingerprint
    sets: tuple[str, ...]
    threads: bool = False


class DriveOutput(msgspec.Struct, frozen=True):
    """What a drive gave, and what it took."""

    result: TrialResult
    effort: ComputeEffort


class StoredSuite(msgspec.Struct, frozen=True, kw_only=True):
    """Results that a run folder holds, cases still to be driven, and counts of outdated results by what differs."""

    results: dict[TrialCase, TrialResult]
    missing: tuple[TrialCase, ...]
    outdated: dict[str, int]


Driven = Generator[tuple[TrialCase, TrialResult | FailedDrive], None, None]


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
) -> Driven:
    """Run each case and yield it when its files are written. When interrupted, workers end and written files stay.

    Raises UserError for the folder, and for a setting or a scenario that no drive can use.
    """
    make_result_folders(folder)
    for name in THREAD_COUNT_VARIABLES:
        os.environ[name] = "1"
    batch = DRIVES_PER_PROCESS * jobs
    for first in range(0, len(cases), batch):
        yield from _run_batch(folder, cases[first : first + batch], reader, sets, jobs)


def run_cases_on(
    workers: Workers, folder: Path, cases: Sequence[TrialCase], reader: FingerprintReader, sets: Sequence[str]
) -> Driven:
    """As `run_cases`, on the workers of a cluster; the files are written here, so that the workers need no such folder.

    Raises UserError also where a worker finds another scenario file than is here.
    """
    make_result_folders(folder)
    orders = [DriveOrder(case, reader.fingerprint(case), tuple(sets)) for case in cases]
    results: dict[int, TrialResult | FailedDrive] = {}

    def keep(index: int, outcome: DriveOutput | FailedDrive) -> None:
        results[index] = store_drive(folder, orders[index], outcome)

    with contextlib.closing(workers.run(drive_order, orders, keep)) as done:
        for index in done:
            yield cases[index], results.pop(index)


def _run_batch(
    folder: Path, cases: Sequence[TrialCase], reader: FingerprintReader, sets: Sequence[str], jobs: int
) -> Driven:
    with open_processes(min(jobs, len(cases))) as executor:
        running = {
            executor.submit(
                _drive_and_store, folder, DriveOrder(case, reader.fingerprint(case), tuple(sets), jobs == 1)
            ): case
            for case in cases
        }
        for future in concurrent.futures.as_completed(running):
            case = running[future]
            try:
                yield case, future.result()
            except BrokenProcessPool:
                raise UserError(f"trial {case.name}: a process was killed; the same command goes on") from None


def drive_order(order: DriveOrder) -> DriveOutput | FailedDrive:
    """Drive one case in this process. Raises UserError for a setting or a scenario that no drive can use."""
    found = _fingerprint_reader(order.sets).fingerprint(order.case)
    if found != order.fingerprint:
        raise UserError(
            f"trial {order.case.name}: other {', '.join(found.list_differences(order.fingerprint))} on "
            f"{platform.node()} than where it was asked for"
        )
    try:
        result, effort = run_trial(order.case, order.sets, threads=order.threads)
    except UserError:
        raise
    except Exception as error:  # noqa: BLE001  # one drive that fails is a finding, not the end of the run
        return FailedDrive(case=order.case, reason=f"{type(error).__name__}: {error}")
    return DriveOutput(result, effort)


def store_drive(folder: Path, order: DriveOrder, output: DriveOutput | FailedDrive) -> TrialResult | FailedDrive:
    """Write the files of a drive into a folder of `make_result_folders`. Raises UserError naming the file."""
    if isinstance(output, FailedDrive):
        return output
    write_whole(folder / EFFORTS_FOLDER / f"{order.case.stem}.json", msgspec.json.encode(output.effort) + b"\n")
    record = StoredResult(fingerprint=order.fingerprint, result=output.result)
    write_whole(result_path(folder, order.case), encode_stored_result(record))
    return output.result


def make_result_folders(folder: Path) -> None:
    """Raises UserError for a folder that cannot be made."""
    for path in (folder / RESULTS_FOLDER, folder / EFFORTS_FOLDER):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"--out {path}: {error.strerror}") from error


def result_path(folder: Path, case: TrialCase) -> Path:
    """Path of a case's result."""
    return folder / RESULTS_FOLDER / f"{case.stem}.json"


def read_stored_result(path: Path) -> StoredResult | None:
    """Read a stored result; None if there is none or it cannot be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=StoredResult)
    except UNREADABLE:
        return None


def encode_stored_result(record: StoredResult) -> bytes:
    """Bytes of a result file."""
    return indented_json(record)


def _drive_and_store(folder: Path, order: DriveOrder) -> TrialResult | FailedDrive:
    """In a worker process, which ends when its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():
        os._exit(1)
    return store_drive(folder, order, drive_order(order))


@functools.cache
def _fingerprint_reader(sets: tuple[str, ...]) -> FingerprintReader:
    return FingerprintReader(sets)
