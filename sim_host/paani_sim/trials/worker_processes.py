"""Processes of this machine that work side by side, and end with what they are asked for."""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator

import cv2

NICENESS = 5


@contextlib.contextmanager
def open_processes(count: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """Processes that give way to others.

    Where the body fails or is interrupted they end in the midst of their work, and what waits is dropped.
    """
    with concurrent.futures.ProcessPoolExecutor(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=_initialise
    ) as executor:
        try:
            yield executor
        except BaseException:
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _initialise() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.nice(NICENESS)
    cv2.setNumThreads(1)
