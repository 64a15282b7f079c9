"""Independent pieces of work in this process, or on the workers of a Dask cluster: one function, the same results.

A worker takes work only if its installation is the client's: same code, models, libraries and kind of processor.
Whoever reaches a Dask scheduler can run code on it and on its workers, so that of `--cluster local` listens on
loopback, with certificates that are made for it alone and end with it.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib.metadata
import logging
import platform
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeVar
from urllib.parse import urlsplit

import msgspec

from paani.errors import UserError
from paani.extras import require_modules
from paani.port_address import is_loopback
from paani.source_checksum import checksum_packages
from paani.version import version_text

LOCAL = "local"
CONNECT_S = 5.0  # a scheduler that does not answer by then is not there
PACKAGES = ("paani", "paani_models", "paani_services", "paani_sim")
ENDINGS = (".py", ".toml", ".json", ".onnx")
LIBRARIES = ("numpy", "opencv-python-headless", "onnxruntime", "msgspec", "mujoco", "scipy", "filterpy")
T = TypeVar("T")
R = TypeVar("R")
Keep = Callable[[int, R], None]


class Installation(msgspec.Struct, frozen=True):
    """What results depend on beside the work itself. paani: checksum of PACKAGES; processor: as `platform` names it."""

    paani: str
    python: str
    processor: str
    libraries: dict[str, str]


class Workers(Protocol):
    """Whoever does work."""

    def run(self, function: Callable[[T], R], items: Sequence[T], keep: Keep[R]) -> Generator[int, None, None]:
        """Do `function(item)` for each, and yield its index after `keep(index, result)`, in any order.

        function: of a module, as a worker finds it by its name; called again for an item whose worker died. When
        interrupted or closed, results that were ready are kept first. Raises what `function` raises, and UserError
        where the workers are lost.
        """
        ...


class InProcess:
    """One piece after the other, here."""

    def run(self, function: Callable[[T], R], items: Sequence[T], keep: Keep[R]) -> Generator[int, None, None]:
        """In the order of `items`."""
        for index, item in enumerate(items):
            keep(index, function(item))
            yield index


class ClusterWorkers:
    """The workers of a scheduler, in as many processes as there are."""

    def __init__(self, address: str, client: Any) -> None:
        self._address, self._client = address, client

    def run(self, function: Callable[[T], R], items: Sequence[T], keep: Keep[R]) -> Generator[int, None, None]:
        """As each is done."""
        from distributed import as_completed  # noqa: PLC0415  an extra brings it

        waiting = dict(
            zip(
                self._client.map(functools.partial(_work, inspect_installation(), function), items, pure=False),
                range(len(items)),
                strict=True,
            )
        )
        try:
            for future in as_completed(list(waiting), raise_errors=False):
                index = waiting[future]
                keep(index, self._result(future))
                del waiting[future]
                yield index
        except (KeyboardInterrupt, GeneratorExit):
            for future, index in waiting.items():
                if future.status == "finished":
                    keep(index, self._result(future))
            raise
        finally:
            self._client.cancel(list(waiting), force=True)

    def _result(self, future: Any) -> Any:
        from distributed import CancelledError, KilledWorker  # noqa: PLC0415

        try:
            return future.result()
        except KilledWorker as error:
            raise UserError(
                f"--cluster {self._address}: a piece of work ended {error.allowed_failures + 1} workers"
            ) from None
        except (CancelledError, OSError) as error:
            raise UserError(f"--cluster {self._address}: the scheduler went away ({type(error).__name__})") from None


def add_cluster_argument(parser: argparse.ArgumentParser) -> None:
    """The option that `open_workers` takes."""
    parser.add_argument(
        "--cluster", type=cluster_address, metavar="ADDRESS",
        help="work on a Dask cluster: tcp://HOST:PORT or tls://HOST:PORT of its scheduler, or local",
    )  # fmt: skip


def cluster_address(text: str) -> str:
    """`local`, or a scheduler's address. Raises UserError."""
    if text == LOCAL:
        return text
    with contextlib.suppress(ValueError):
        parts = urlsplit(text)
        if parts.scheme in {"tcp", "tls"} and parts.hostname and parts.port and not (parts.path or parts.query):
            return text
    raise UserError(f"--cluster {text}: expected tcp://HOST:PORT, tls://HOST:PORT or {LOCAL}")


@contextlib.contextmanager
def open_workers(address: str | None, processes: int) -> Iterator[Workers]:
    """This process where there is no address, else the cluster's workers. processes: of the cluster `local`.

    Raises UserError where the extra is missing, no scheduler or worker answers, or a worker's installation is another.
    """
    if address is None:
        yield InProcess()
        return
    require_modules("--cluster", "distributed", *(("cryptography",) if address == LOCAL else ()))
    from distributed import Client  # noqa: PLC0415

    with contextlib.ExitStack() as stack:
        for name in ("distributed", "tornado", "asyncio"):  # what goes wrong is told once, in a line
            stack.callback(logging.getLogger(name).setLevel, logging.getLogger(name).level)
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        if address == LOCAL:
            client = stack.enter_context(Client(stack.enter_context(_local_cluster(processes))))
        else:
            if address.startswith("tcp:") and not is_loopback(urlsplit(address).hostname):
                sys.stderr.write(
                    f"--cluster {address}: whoever reaches it can run code here; tls:// keeps others out\n"
                )
            try:
                client = stack.enter_context(Client(address, timeout=CONNECT_S))
            except (OSError, TypeError, ValueError) as error:  # TypeError: tls without certificates
                raise UserError(f"--cluster {address}: no scheduler answers ({_first_line(error)})") from None
        _require_same_installation(address, client)
        yield ClusterWorkers(address, client)


@functools.cache
def inspect_installation() -> Installation:
    """That of this process, as it was when first asked for."""
    return Installation(
        paani=checksum_packages(PACKAGES, ENDINGS),
        python=platform.python_version(),
        processor=platform.machine(),
        libraries={name: _version(name) for name in LIBRARIES},
    )


def explain_difference(own: Installation, asked: Installation) -> str:
    """What is other in an installation than asked for, with both values; empty where nothing is."""
    if own.paani != asked.paani:
        return f"another paani: {version_text()}, code {own.paani}, not {asked.paani}"
    if own.python != asked.python:
        return f"Python {own.python}, not {asked.python}"
    if own.processor != asked.processor:
        return f"a processor {own.processor}, not {asked.processor}"
    for name, version in asked.libraries.items():
        if own.libraries.get(name) != version:
            return f"{name} {own.libraries.get(name)}, not {version}"
    return ""


def _work(asked: Installation, function: Callable[[T], R], item: T) -> R:
    """On a worker. Raises UserError where it does not fit: it may have joined after the others were asked."""
    from distributed import get_worker  # noqa: PLC0415

    worker = get_worker()
    if refusal := _refusal(asked, worker):
        raise UserError(f"--cluster: worker {worker.address} has {refusal}")
    return function(item)


def _refusal(asked: Installation, dask_worker: Any) -> str:
    """Why this worker does not fit. dask_worker: Dask's, which it hands in itself by this name."""
    threads = dask_worker.state.nthreads
    if threads != 1:
        return f"{threads} threads, of which one may be used (`dask worker --nthreads 1 --nworkers {threads}`)"
    return explain_difference(inspect_installation(), asked)


def _require_same_installation(address: str, client: Any) -> None:
    """Raises UserError naming the first worker that does not fit, and where there is none."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        raise UserError(f"--cluster {address}: its scheduler has no workers") from None
    answers = client.run(_refusal, inspect_installation(), on_error="return")
    for worker, answer in sorted(answers.items()):
        if isinstance(answer, ImportError):  # of this module: none there, or one from before it
            raise UserError(f"--cluster {address}: worker {worker} has no such paani ({_first_line(answer)})")
        if isinstance(answer, OSError):
            continue  # it went away; the others work
        if isinstance(answer, BaseException):
            raise answer
        if answer:
            raise UserError(f"--cluster {address}: worker {worker} has {answer}")


@contextlib.contextmanager
def _local_cluster(processes: int) -> Iterator[Any]:
    """Processes that take no Ctrl-C, so that what they have done can be fetched; a killed one is replaced."""
    from distributed import LocalCluster  # noqa: PLC0415

    resource_tracker.ensure_running()  # its first start unblocks the signal in the thread that starts a worker
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by the threads that start them
    try:
        cluster = LocalCluster(
            n_workers=processes, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, protocol="tls://",
            security=True, silence_logs=logging.CRITICAL + 1,
        )  # fmt: skip
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    with cluster:
        yield cluster


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "none"


def _first_line(error: BaseException) -> str:
    return str(error).partition("\n")[0] or type(error).__name__
