"""Run one service as a child that dies with its supervisor.

`python -m paani_tools.up.child PARENT_PID SERVICE`
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1


def run(parent_pid: int, service: str) -> int:
    """Ask the kernel to kill this process when its parent dies, then become the service."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:  # it died before we asked
        return 1
    from paani.cli import main  # noqa: PLC0415  # takes a second on a busy machine: not before the request above

    return main(["run", service])


if __name__ == "__main__":
    raise SystemExit(run(int(sys.argv[1]), sys.argv[2]))
