"""Prepare MaSTr1325 (Bovcon et al. 2019) from its official layout: pictures and masks of three classes (R9 - R11).

ROOT/MaSTr1325_images_512x384/0001.jpg      or ROOT/images/
ROOT/MaSTr1325_masks_512x384/0001m.png      or ROOT/masks/     0 obstacle, 1 water, 2 sky, 4 unknown
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.errors import UserError
from paani.whole_file import new_folder
from paani_models.datasets.checked_files import (
    decode_mask,
    decode_picture,
    raise_first_mistake,
    read_whole_file,
    sha256_hex,
)
from paani_models.datasets.intake import Intake
from paani_models.datasets.leaks import Fingerprint, Leak, find_leaks, fingerprint_picture, hash_distance
from paani_models.datasets.manifest import SourceManifest, Split
from paani_models.datasets.sources import IGNORE

SplitBy = Literal["image", "sequence"]

SIZE_WH = (512, 384)
SEED = 42  # R9 names a seed; S4 and S7 use this one
VAL_FRAC = 0.15  # R9: 198 of 1,325
UNKNOWN = 4  # R10
SEQUENCE_BITS = 24  # consecutive pictures whose hashes differ in more bits begin a new sequence
CODES = frozenset({0, 1, 2, UNKNOWN, IGNORE})
TERMS = SourceManifest(
    source="mastr1325_official",
    repo="MaSTr1325",
    commit="",
    licence="CC BY-NC-SA 4.0 believed: non-commercial research (Bovcon et al. 2019)",
    provenance="",
    mask="three_class",
)


def split_by_image(names: Sequence[str], seed: int = SEED) -> dict[str, Split]:
    """A seeded 15 % of single pictures for validation, as the paper split them (R9).

    Neighbours of a validation picture are trained on (R11).
    """
    shuffled = sorted(names)
    random.Random(seed).shuffle(shuffled)
    held_out = set(shuffled[: int(VAL_FRAC * len(names))])
    return {name: "val" if name in held_out else "train" for name in sorted(names)}


def group_sequences(pictures: Sequence[Fingerprint]) -> dict[str, str]:
    """Identity -> sequence: neighbours in name order, cut where the picture changes; runs that meet again are one."""
    cut: list[Fingerprint] = []
    for seen in sorted(pictures, key=lambda picture: picture.identity):
        new = not cut or hash_distance(cut[-1].bits, seen.bits) > SEQUENCE_BITS
        cut.append(replace(seen, split=f"from_{seen.identity}" if new else cut[-1].split))
    joined = {seen.split: seen.split for seen in cut}
    for leak in find_leaks(cut):
        first, second = sorted((joined[leak.first.split], joined[leak.second.split]))
        joined = {run: first if into == second else into for run, into in joined.items()}
    return {seen.identity: joined[seen.split] for seen in cut}


def split_by_sequence(sequence_of: Mapping[str, str], seed: int = SEED) -> dict[str, Split]:
    """Whole sequences for validation, drawn until they hold 15 % of the pictures or would pass a fifth."""
    groups: dict[str, list[str]] = {}
    for name, sequence in sorted(sequence_of.items()):
        groups.setdefault(sequence, []).append(name)
    order = sorted(groups)
    random.Random(seed).shuffle(order)
    wanted, held_out = VAL_FRAC * len(sequence_of), set[str]()
    for sequence in order:
        if len(held_out) < wanted and len(held_out) + len(groups[sequence]) <= wanted / VAL_FRAC * 0.2:
            held_out.update(groups[sequence])
    return {name: "val" if name in held_out else "train" for name in sorted(sequence_of)}


def to_file_codes(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Official codes -> ours on disc: unknown becomes ignored; reading maps 0, 1, 2 to obstacle, water, sky (R10)."""
    return np.where(mask == UNKNOWN, IGNORE, mask).astype(np.uint8)


def prepare_mastr1325(
    root: Path, out: Path, *, by: SplitBy = "sequence", seed: int = SEED
) -> tuple[SourceManifest, list[Leak]]:
    """Write the new folder `out`: images/, masks/ and manifest.json; return the manifest and the leaks let pass.

    by "image" is the paper's split and lets views leak, and tells how many; by "sequence" refuses them. Raises
    UserError, leaving nothing behind, for a folder that is missing or empty, a picture or mask without its partner or
    that cannot be read or has another size than 512x384, and an unknown mask class.
    """
    images, masks = (_find_folder(root, kind) for kind in ("images", "masks"))
    names = sorted(path.stem for path in images.glob("*.jpg"))
    if not names:
        raise UserError(f"{images}: holds no .jpg picture")
    mistakes = [f"{masks / name}m.png: no such mask" for name in names if not (masks / f"{name}m.png").is_file()]
    orphans = sorted({path.stem for path in masks.glob("*.png")} - {f"{name}m" for name in names})
    raise_first_mistake(mistakes + [f"{masks / orphan}.png: has no picture" for orphan in orphans])
    read: dict[str, NDArray[np.uint8]] = {}
    prints: list[Fingerprint] = []
    for name in tqdm(names, "pictures", unit="picture", mininterval=2.0):
        try:
            read[name], seen = _read_pair(images / f"{name}.jpg", masks / f"{name}m.png")
            prints.append(seen)
        except UserError as error:
            mistakes.append(str(error))
    raise_first_mistake(mistakes)
    sequence_of = group_sequences(prints) if by == "sequence" else dict.fromkeys(names, "")
    split_of = split_by_sequence(sequence_of, seed) if by == "sequence" else split_by_image(names, seed)
    with new_folder(out) as beside:
        intake = Intake(beside, TERMS.source)
        for name in names:
            intake.add(
                images / f"{name}.jpg",
                split=split_of[name],
                sequence=sequence_of[name],
                mask=to_file_codes(read[name]),
            )
        terms = SourceManifest(
            source=TERMS.source,
            repo=TERMS.repo,
            commit=TERMS.commit,
            licence=TERMS.licence,
            provenance=f"official pictures and masks; split by {by}, seed {seed}",
            mask=TERMS.mask,
        )
        return intake.write_manifest(terms, strict=by == "sequence")


def _find_folder(root: Path, kind: str) -> Path:
    for folder in (root / f"MaSTr1325_{kind}_512x384", root / kind):
        if folder.is_dir():
            return folder
    raise UserError(f"{root / f'MaSTr1325_{kind}_512x384'}: no such folder, nor {root / kind}")


def _read_pair(picture: Path, mask: Path) -> tuple[NDArray[np.uint8], Fingerprint]:
    data = read_whole_file(picture)
    rgb = decode_picture(data, picture)
    if (rgb.shape[1], rgb.shape[0]) != SIZE_WH:
        raise UserError(f"{picture}: {rgb.shape[1]}x{rgb.shape[0]}, not {SIZE_WH[0]}x{SIZE_WH[1]}")
    codes = decode_mask(read_whole_file(mask), mask, CODES, SIZE_WH)
    seen = fingerprint_picture(
        rgb, source="", identity=picture.stem, sequence="", split="", location=str(picture), sha256=sha256_hex(data)
    )
    return codes, seen
