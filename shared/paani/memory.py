"""Memory that a process has freed and that the C library or the interpreter keeps: given back."""

from __future__ import annotations

import ctypes
import gc

RECYCLE_S = 15.0  # between two calls of `recycle`
_TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None)


def release_freed_memory() -> None:
    """Worth a call after what was loaded has left large gaps, and now and then. No-op but with glibc."""
    if _TRIM is not None:
        _TRIM(0)


def set_loaded_apart() -> None:
    """Leave what is there by now, the modules above all, out of every collection to come.

    Worth a call once a process is ready: a full collection takes less than a millisecond then, instead of tens.
    """
    gc.collect()
    gc.freeze()


def recycle() -> None:
    """Worth a call now and then: a full collection, which also empties the interpreter's lists of freed tuples.

    Those take up to 2000 of every length: megabytes, filled over an hour, where steps make tuples of what they iterate
    over. A process that makes no cycles of objects would never come to collect by itself. Then the C library gives back
    gaps that hold nothing any more: left by pictures of another size, they are megabytes as well.
    """
    gc.collect()
    release_freed_memory()
