"""The Linux half of the App Lab app: PAANI's bridge, on the socket of the board's router.

Other settings come from the environment, as for every process of PAANI: `PAANI_BUS__ROUTER=tcp/192.168.1.20:7447`.
"""

from __future__ import annotations

import sys

LINE = "unix:/var/run/arduino-router.sock"  # where App Lab mounts the router


def main() -> int:
    try:
        from paani.cli import main as run_paani  # noqa: PLC0415 (a missing wheel gets a sentence, not a traceback)
    except ImportError:
        sys.stderr.write("paani is not installed: put its wheel beside main.py and its name into requirements.txt\n")
        return 2
    return run_paani(["bridge", "--set", f"bridge.line={LINE}"])


if __name__ == "__main__":
    sys.exit(main())
