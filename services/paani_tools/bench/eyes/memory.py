"""How much memory a process that does nothing but perceive holds: run as a module, prints one JSON object."""

import sys
from pathlib import Path

import msgspec

from paani.clock import stopwatch_ms
from paani.config import PerceptionConfig, decode_config
from paani.messages import PictureHeader
from paani_services.perception.pipeline import Perceiver
from paani_tools.bench.eyes.drawn_scene import draw_scene

SETTLED, FRAMES = 40, 240


class Footprint(msgspec.Struct, frozen=True):
    """Resident memory after the last frame, and by how much it grew after the first SETTLED ones, [MiB]."""

    rss_mib: float
    growth_mib: float
    frames: int = FRAMES


def resident_mib() -> float:
    """Of this process."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024.0


def measure_footprint(config: PerceptionConfig) -> Footprint:
    """Perceive drawn pictures in turn."""
    perceiver, pictures = Perceiver(config, stopwatch_ms), [draw_scene(seed) for seed in range(8)]
    settled = 0.0
    for frame in range(FRAMES):
        if frame == SETTLED:
            settled = resident_mib()
        header = PictureHeader(source_us=0, frame_seq=frame, frame_epoch=0, width_px=320, height_px=240)
        evidence, _ = perceiver.perceive(pictures[frame % len(pictures)], header, 0.0)
        assert evidence.usable
    perceiver.close()
    held = resident_mib()
    return Footprint(round(held, 1), round(held - settled, 2))


if __name__ == "__main__":
    found = measure_footprint(decode_config(sys.stdin.buffer.read()).perception)
    sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
