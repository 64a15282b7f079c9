"""The board's image for arm64, built from the same Dockerfile and run on an emulated Cortex-A53: does it judge alike?

    python -m tests.deploy.arm64

Needs root, and Debian's qemu-user-static and binfmt-support. Prints what is said of each picture
(default: those of examples/pictures), what differs, and how long each step took. Emulated: answers, not speed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from paani.clock import MonotonicClock
from tests.deploy.engine import BASE_IMAGE, Engine, NoEngine, running_engine
from tests.places import ROOT

CLOCK = MonotonicClock()
BASE_ARM64 = "paani/base-arm64:bookworm"
PROCESSOR = "cortex-a53"
BINFMT = Path("/proc/sys/fs/binfmt_misc")
ANSWER = ("usable", "cause", "direction", "reason")
TIMINGS = ("_ms", "_us")  # fields that differ from run to run


def main() -> int:
    """0 where both images give the same answers, 1 where they differ, 2 where they cannot be asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path, default=ROOT / "examples" / "pictures", metavar="FOLDER")
    options = parser.parse_args()
    try:
        with running_engine() as engine:
            return _compare(engine, options.pictures.resolve())
    except NoEngine as reason:
        sys.stderr.write(f"{reason}\n")
        return 2


def _compare(engine: Engine, pictures: Path) -> int:
    _enable_emulation()
    engine.ensure_base_image()
    if not engine.docker("images", "-q", BASE_ARM64).strip():
        _timed("base image for arm64", lambda: engine.run("sh", "deploy/base-image.sh", BASE_ARM64, "arm64"))
    answers = {}
    for machine, base in (("amd64", BASE_IMAGE), ("arm64", BASE_ARM64)):
        arguments = (
            "--platform",
            f"linux/{machine}",
            "--build-arg",
            f"BASE_IMAGE={base}",
            "-t",
            f"paani-board:{machine}",
        )
        build = ("build", "-q", "-f", "deploy/Dockerfile", "--target", "board", *arguments, ".")
        _timed(f"board's image for {machine}", partial(engine.docker, *build))
        answers[machine] = _timed(f"pictures on {machine}", partial(_judge, engine, machine, pictures))
    unlike = False
    for here, there in zip(answers["amd64"], answers["arm64"], strict=True):
        verdicts = [answer.get(name) for answer in (here, there) for name in ANSWER]
        alike = verdicts[: len(ANSWER)] == verdicts[len(ANSWER) :]
        unlike = unlike or not alike
        largest = max(_distances(here, there, ""), default=0.0)
        verdict = f"alike, numbers within {largest:.1e}" if alike else f"not alike: {verdicts}"
        sys.stdout.write(f"{Path(here['path']).name}: {here['direction']}, {here['reason']}: {verdict}\n")
    return 1 if unlike else 0


def _judge(engine: Engine, machine: str, folder: Path) -> list[dict[str, Any]]:
    # onnxruntime counts cores in /sys, which there is the host's.
    options = (
        "--platform",
        f"linux/{machine}",
        "--network",
        "none",
        "--read-only",
        "--tmpfs",
        "/tmp",
        "--tmpfs",
        "/sys/devices",
    )
    emulated = ("-e", f"QEMU_CPU={PROCESSOR}") if machine == "arm64" else ()
    pictures = ("-v", f"{folder}:/pictures:ro")
    output = engine.docker(
        "run", "--rm", *options, *emulated, *pictures, f"paani-board:{machine}", "look", "--json", "/pictures"
    )
    return [msgspec.json.decode(line) for line in output.splitlines()]


def _distances(here: Any, there: Any, path: str) -> Iterator[float]:
    """How far the numbers of two JSON trees lie apart, where both have one."""
    if isinstance(here, dict) and isinstance(there, dict):
        for key in sorted({*here} & {*there}):
            yield from _distances(here[key], there[key], key)
    elif isinstance(here, list) and isinstance(there, list):
        for one, other in zip(here, there, strict=False):
            yield from _distances(one, other, path)
    elif isinstance(here, float) and isinstance(there, float) and not path.endswith(TIMINGS):
        yield abs(here - there)


def _enable_emulation() -> None:
    if not (BINFMT / "register").exists():
        subprocess.run(["mount", "-t", "binfmt_misc", "binfmt_misc", str(BINFMT)], check=False)
    if not (BINFMT / "qemu-aarch64").exists():
        done = subprocess.run(
            ["update-binfmts", "--enable", "qemu-aarch64"], capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            raise NoEngine("needs qemu-user-static and binfmt-support (Debian packages)")


def _timed(what: str, act: Callable[[], Any]) -> Any:
    begin_us = CLOCK.now_us()
    result = act()
    sys.stdout.write(f"{what}: {(CLOCK.now_us() - begin_us) * 1e-6:.0f} s\n")
    sys.stdout.flush()
    return result


if __name__ == "__main__":
    sys.exit(main())
