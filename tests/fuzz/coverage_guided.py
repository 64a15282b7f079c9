"""Searches for what breaks a decoder by which of its branches an input reaches; run by hand.

pip install atheris (Python 3.11 to 3.13 on Linux), then

python -m tests.fuzz.coverage_guided TARGET FOLDER [-max_total_time=SECONDS and other options of libFuzzer]

TARGET is a class of tests/fuzz, such as RouteGpx; not ArmedBoat, which a search by coverage soon gives what is valid.
Inputs that reached something new, and a first one of each, are kept in FOLDER; one that breaks the decoder is written
to the working directory, and ends the search.
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["paani", "paani_services", "paani_sim", "gpxpy", "mcap", "tomllib"]):
    from tests.fuzz.campaign import TARGETS

FIRST = 100  # payloads of the target's own, to begin with


def main() -> None:
    """Search until the time is over, or something breaks."""
    name, folder, *options = sys.argv[1:]
    (kind,) = (kind for kind in TARGETS if kind.__name__ == name)
    kept = Path(folder)
    kept.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="paani-fuzz-") as scratch:
        target = kind(Path(scratch), random.Random(1))
        for number in range(FIRST):
            (kept / f"first-{number}").write_bytes(target.payload())
        atheris.Setup([sys.argv[0], *options, str(kept)], target.take)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
