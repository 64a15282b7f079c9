"""Miniatures of the public sets in their official layouts, drawn here."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray


def scene(seed: int, wh: tuple[int, int] = (96, 64)) -> NDArray[np.uint8]:
    """A picture unlike that of any other seed, BGR."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 256, (6, 8, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(coarse, wh, interpolation=cv2.INTER_CUBIC), np.uint8)


def write_picture(path: Path, picture: NDArray[np.uint8]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture)


WATERSCENES_LABELS = {
    "000001": "0 .2 .5 .1 .1\n0 .8 .5 .1 .1\n",
    "000002": "1 .5 .5 .02 .04\n",
    "000003": "2 .5 .4 .02 .06\n4 .5 .5 .2 .2\n",
    "000004": "3 .5 .5 .4 .3\n",
    "000005": "6 .5 .5 .1 .05\n5 .3 .3 .2 .2\n",
    "000006": "",
    "000007": "3 .6 .5 .4 .3\n2 .6 .4 .02 .06\n",
    "000008": "0 .5 .5 .1 .1\n1 .1 .5 .02 .02\n",
}
WATERSCENES_LISTS = {"train": range(1, 7), "val": (7,), "test": (8,)}


def waterscenes(root: Path) -> Path:
    """Eight pictures: train 1..6 (of which 2, 3 and 5 show a buoy, sailor or kayak), val 7, test 8."""
    for identity, text in WATERSCENES_LABELS.items():
        write_picture(root / "image" / f"{identity}.jpg", scene(int(identity)))
        label = root / "detection" / "yolo" / f"{identity}.txt"
        label.parent.mkdir(parents=True, exist_ok=True)
        label.write_text(text)
    for split, numbers in WATERSCENES_LISTS.items():
        (root / f"{split}.txt").write_text("".join(f"{number:06}\n" for number in numbers))
    return root


def mastr1325(root: Path, runs: tuple[int, ...] = (4, 3, 3)) -> Path:
    """Runs of pictures that move a little, each run another scene; masks hold every official code."""
    number = 0
    for run, length in enumerate(runs):
        for frame in range(length):
            number += 1
            picture = np.roll(scene(100 + run, (512, 384)), 4 * frame, axis=1)
            write_picture(root / "MaSTr1325_images_512x384" / f"{number:04}.jpg", picture)
            mask = np.zeros((384, 512), np.uint8)
            mask[:100], mask[100:120], mask[200:] = 2, 4, 1
            write_picture(root / "MaSTr1325_masks_512x384" / f"{number:04}m.png", mask)
    return root


def own_data(root: Path, frames: int = 4) -> Path:
    """A data folder of two sources: dasha (masks; DJI_0035 is held out) and mcoe (boxes; cluster6 is held out)."""
    dasha, number = [], 0
    for sequence in ("DJI_0001", "DJI_0035"):
        for frame in range(frames):
            number += 1
            name = f"{sequence}_{frame}"
            picture = cv2.resize(scene(500 + number), (640, 400), interpolation=cv2.INTER_CUBIC)
            write_picture(root / "tbiseg_dasha" / "images" / f"{name}.jpg", np.asarray(picture, np.uint8))
            water = np.zeros((400, 640), np.uint8)
            water[200:] = 1
            write_picture(root / "tbiseg_dasha" / "masks" / f"{name}.png", water)
            water[:100] = 2
            write_picture(root / "tbiseg_dasha" / "masks3" / f"{name}.png", water)
            dasha.append(f'{{"file":"images/{name}.jpg","seq":"{sequence}"}}')
    mcoe = []
    for cluster in range(5, 5 + frames):
        name = f"boat{cluster}"
        write_picture(root / "mcoe_boats" / "images" / f"{name}.jpg", scene(700 + cluster, (360, 300)))
        label = root / "mcoe_boats" / "labels" / f"{name}.txt"
        label.parent.mkdir(exist_ok=True)
        label.write_text("1 .5 .5 .2 .2\n3 .2 .6 .1 .1\n")
        mcoe.append(f'{{"file":"images/{name}.jpg","seq":"cluster{cluster}"}}')
    for folder, items in (("tbiseg_dasha", dasha), ("mcoe_boats", mcoe)):
        terms = '"repo":"someone/water","commit":"abc","licence":"CC0"'
        (root / folder / "manifest.json").write_text(f'{{{terms},"items":[{",".join(items)}]}}')
    (root / "_weights").mkdir()
    (root / "_weights" / "start.bin").write_bytes(bytes(range(256)))
    return root
