"""Draw the pictures of this folder anew: `python examples/draw_pictures.py [FOLDER]`.

Each is what the simulated boat's camera sees in one place of one scenario. Another graphics driver may give
other bytes.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from paani.config import EyeConfig
from paani_sim.eye.camera import BoatPose
from paani_sim.eye.configured_camera import open_eye
from paani_sim.worlds.load import load_scenario

JPEG_QUALITY = 85


class View(NamedTuple):
    """A scenario, and where the boat lies in it: metres east and north, and degrees counter-clockwise from east."""

    scenario: str
    x_m: float
    y_m: float
    heading_deg: float
    exposure_frac: float = 1.0


VIEWS = {
    "clear_water": View("lake", 8.0, 49.0, 178.0),
    "boat_ahead": View("lake", -60.5, 5.0, 152.0),
    "swimmer_ahead": View("lake", 44.6, -47.6, -46.0),
    "buoy_ahead": View("river", 61.0, 16.2, -14.0),
    "pontoon": View("lake", 10.5, -55.0, -62.0),
    "bank": View("river", 97.5, 0.2, -62.0),
    "canal": View("canal", 155.0, -27.0, -39.0),
    "too_dark": View("river", 50.5, 17.3, 0.0, exposure_frac=0.002),
}


def draw(view: View) -> bytes:
    """The picture as JPEG."""
    with open_eye(load_scenario(view.scenario).world, EyeConfig(exposure_frac=view.exposure_frac)) as eye:
        picture = eye.render(BoatPose(view.x_m, view.y_m, math.radians(view.heading_deg)), 0.0).bgr
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return np.asarray(data).tobytes()


def main() -> None:
    """Write every picture."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "pictures"
    for name, view in VIEWS.items():
        (folder / f"{name}.jpg").write_bytes(draw(view))


if __name__ == "__main__":
    main()
