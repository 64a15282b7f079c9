"""MaSTr1325 in its official layout: mask codes, both splits, refusals (R9 - R11)."""

from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from paani.errors import UserError
from paani_models.datasets import mastr1325 as mastr1325_source
from paani_models.datasets.manifest import load_manifest
from paani_models.datasets.mastr1325 import (
    VAL_FRAC,
    prepare_mastr1325,
    split_by_image,
    split_by_sequence,
    to_file_codes,
)
from paani_models.datasets.sources import decode_mask_classes, read_mask
from tests.unit.paani_models.datasets.public_sets import mastr1325, scene, write_picture

NAMES = [f"{number:04}" for number in range(1, 1326)]


def test_the_papers_split_sizes_r9() -> None:
    split = split_by_image(NAMES)
    assert Counter(split.values()) == {"train": 1127, "val": 198}
    assert split == split_by_image(list(reversed(NAMES)))
    assert split != split_by_image(NAMES, seed=43)
    assert VAL_FRAC == 0.15


def test_r9_single_pictures_are_held_out_and_no_block_of_neighbours() -> None:
    """Of 198 in 1,325 drawn one by one, about 30 follow another; of one block, 197 would."""
    split = split_by_image(NAMES)
    held_out = [split[name] == "val" for name in NAMES]
    assert sum(one and other for one, other in pairwise(held_out)) < 60


@pytest.mark.slow
def test_r9_the_seed_asked_for_splits_the_pictures(tmp_path: Path) -> None:
    raw = mastr1325(tmp_path / "raw", (4,) * 5)
    found = []
    for seed in (1, 2):
        manifest, _ = prepare_mastr1325(raw, tmp_path / str(seed), by="image", seed=seed)
        found.append({Path(item.file).stem: item.split for item in manifest.items})
        assert found[-1] == split_by_image(list(found[-1]), seed)
    assert found[0] != found[1]


def test_official_codes_become_ours_r10() -> None:
    official = np.array([0, 1, 2, 4, 255], np.uint8)
    assert decode_mask_classes(to_file_codes(official)).tolist() == [1, 0, 2, 255, 255]


@pytest.mark.slow
def test_a_miniature_keeps_its_masks_r10(tmp_path: Path) -> None:
    manifest, _ = prepare_mastr1325(mastr1325(tmp_path / "raw"), tmp_path / "out")
    assert load_manifest(tmp_path / "out") == manifest
    assert len(manifest.items) == 10
    mask = read_mask(tmp_path / "out" / manifest.items[0].mask)
    assert mask[[50, 110, 150, 300], 0].tolist() == [2, 255, 1, 0]


@pytest.mark.slow
def test_whole_sequences_stay_together(tmp_path: Path) -> None:
    manifest, leaks = prepare_mastr1325(mastr1325(tmp_path / "raw", (6, 6, 6, 6, 6, 6)), tmp_path / "out")
    sides: dict[str, set[str]] = {}
    for item in manifest.items:
        sides.setdefault(item.seq, set()).add(item.split)
    assert len(sides) >= 4
    assert all(len(side) == 1 for side in sides.values())
    assert {item.split for item in manifest.items} == {"train", "val"}
    assert leaks == []


@pytest.mark.slow
def test_a_place_seen_again_is_one_sequence(tmp_path: Path) -> None:
    raw = mastr1325(tmp_path / "raw", (3, 3))
    write_picture(raw / "MaSTr1325_images_512x384" / "0007.jpg", scene(100, (512, 384)))
    write_picture(raw / "MaSTr1325_masks_512x384" / "0007m.png", np.zeros((384, 512), np.uint8))
    manifest, _ = prepare_mastr1325(raw, tmp_path / "out")
    assert manifest.items[6].seq == manifest.items[0].seq != manifest.items[3].seq


@pytest.mark.slow
def test_the_image_split_lets_neighbours_leak_r11(tmp_path: Path) -> None:
    """Ten still scenes of four frames: single frames are held out, so nearly each has its twin in training."""
    raw = mastr1325(tmp_path / "raw", (4,) * 10)
    _, leaks = prepare_mastr1325(raw, tmp_path / "out", by="image")
    assert len({leak.second.identity if leak.second.split == "val" else leak.first.identity for leak in leaks}) == 6


def test_sequences_fill_fifteen_to_twenty_percent() -> None:
    split = split_by_sequence({f"{i:04}": f"s{i // 25}" for i in range(1325)})
    assert 0.15 <= Counter(split.values())["val"] / 1325 <= 0.20


def _no_folder(raw: Path) -> None:
    (raw / "MaSTr1325_masks_512x384").rename(raw / "elsewhere")


def _no_pictures(raw: Path) -> None:
    for path in (raw / "MaSTr1325_images_512x384").iterdir():
        path.unlink()


def _no_mask(raw: Path) -> None:
    (raw / "MaSTr1325_masks_512x384" / "0002m.png").unlink()


def _no_picture(raw: Path) -> None:
    (raw / "MaSTr1325_images_512x384" / "0002.jpg").unlink()


def _mask(mask: np.ndarray) -> Callable[[Path], None]:
    return lambda raw: write_picture(raw / "MaSTr1325_masks_512x384" / "0002m.png", mask)


def _cut_short(raw: Path) -> None:
    path = raw / "MaSTr1325_masks_512x384" / "0002m.png"
    path.write_bytes(path.read_bytes()[:-20])


def _wrong_size(raw: Path) -> None:
    write_picture(raw / "MaSTr1325_images_512x384" / "0002.jpg", scene(0, (500, 384)))


REFUSALS: dict[str, tuple[Callable[[Path], None], str]] = {
    "no folder": (_no_folder, r"MaSTr1325_masks_512x384: no such folder"),
    "no pictures": (_no_pictures, r"holds no \.jpg picture"),
    "no mask": (_no_mask, r"0002m\.png: no such mask"),
    "no picture": (_no_picture, r"0002m\.png: has no picture"),
    "a truncated mask": (_cut_short, r"0002m\.png: cut short"),
    "another picture size": (_wrong_size, r"0002\.jpg: 500x384, not 512x384"),
    "another mask size": (_mask(np.zeros((192, 256), np.uint8)), r"0002m\.png: 256x192, its picture is 512x384"),
    "an unknown class": (_mask(np.full((384, 512), 3, np.uint8)), r"0002m\.png: unknown class 3"),
    "colours": (_mask(scene(0, (512, 384))), r"0002m\.png: a mask is 8-bit grey"),
    "sixteen bits": (_mask(np.zeros((384, 512), np.uint16)), r"0002m\.png: a mask is 8-bit grey"),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_what_is_wrong_is_named_and_nothing_is_half_written(name: str, tmp_path: Path) -> None:
    spoil, message = REFUSALS[name]
    raw = mastr1325(tmp_path / "raw", (2,))
    spoil(raw)
    with pytest.raises(UserError, match=message):
        prepare_mastr1325(raw, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["raw"]


@pytest.mark.slow
def test_a_grey_mask_stored_in_three_channels_is_read(tmp_path: Path) -> None:
    raw = mastr1325(tmp_path / "raw")
    path = raw / "MaSTr1325_masks_512x384" / "0001m.png"
    write_picture(path, np.asarray(cv2.cvtColor(cv2.imread(str(path), 0), cv2.COLOR_GRAY2BGR), np.uint8))
    manifest, _ = prepare_mastr1325(raw, tmp_path / "out")
    assert read_mask(tmp_path / "out" / manifest.items[0].mask)[300, 0] == 0


@pytest.mark.slow
def test_w3_sequences_that_lie_in_two_parts_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if no picture were known to be of the sequence of another."""
    monkeypatch.setattr(
        mastr1325_source, "group_sequences", lambda prints: {each.identity: each.identity for each in prints}
    )
    with pytest.raises(UserError, match="splits leak"):
        prepare_mastr1325(mastr1325(tmp_path / "raw", (6, 6, 6)), tmp_path / "out")
    assert not (tmp_path / "out").exists()
