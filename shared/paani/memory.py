"""Memory that a process has freed and the C library keeps: given back to the machine."""

from __future__ import annotations

import ctypes


def release_freed_memory() -> None:
    """Worth a call once, after what was loaded has left large gaps; a few milliseconds. No-op but with glibc."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
