"""Leaks between splits: found in every disguise, not seen where there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from paani.errors import UserError
from paani_models.commands.models import data_folder
from paani_models.datasets.leaks import Fingerprint, find_leaks, fingerprint_picture, hash_distance, refuse_leaks
from paani_models.datasets.sources import SOURCES, read_picture, read_samples
from tests.unit.paani_models.datasets.public_sets import scene


def printed(picture: NDArray[np.uint8], name: str, split: str, sequence: str = "", sha: str = "") -> Fingerprint:
    return fingerprint_picture(
        picture,
        source="river",
        identity=name,
        sequence=sequence,
        split=split,
        location=f"{name}.jpg",
        sha256=sha or name,
    )


def jpeg(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 30])[1], 1), np.uint8)


DISGUISES: dict[str, Callable[[NDArray[np.uint8]], NDArray[np.uint8]]] = {
    "the same": lambda p: p,
    "encoded again": jpeg,
    "smaller": lambda p: cv2.resize(p, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA),
    "brighter": lambda p: np.clip(p * 1.2 + 10, 0, 255).astype(np.uint8),
    "blurred": lambda p: cv2.GaussianBlur(p, (0, 0), 2),
    "a little moved": lambda p: np.roll(p, 2, axis=1),
}


@pytest.mark.parametrize("disguise", DISGUISES)
def test_the_same_view_is_found(disguise: str) -> None:
    picture = scene(3, (320, 240))
    twin = np.asarray(DISGUISES[disguise](picture), np.uint8)
    (leak,) = find_leaks([printed(picture, "a", "train"), printed(twin, "b", "val")])
    assert (leak.cause, leak.first.identity, leak.second.identity) == ("view", "a", "b")
    with pytest.raises(UserError, match=r"a\.jpg \(train\) and b\.jpg \(val\) share all but the same view"):
        refuse_leaks([leak])


@pytest.mark.slow
def test_different_scenes_do_not_leak() -> None:
    pictures = [printed(scene(seed), f"{seed}", "train" if seed % 2 else "val") for seed in range(200)]
    assert find_leaks(pictures) == []


def test_a_shared_bow_is_no_shared_view() -> None:
    """Half of both pictures is the own boat; the hashes alone may meet, the water above differs."""
    first, second = scene(1, (96, 64)), scene(2, (96, 64))
    second[40:] = first[40:]
    ours, theirs = printed(first, "a", "train"), printed(second, "b", "val")
    assert find_leaks([ours, replace(theirs, bits=ours.bits)]) == []


def test_ids_sequences_and_bytes_are_certain() -> None:
    pictures = [
        printed(scene(1), "a", "train", "s1"),
        printed(scene(2), "b", "val", "s1"),
        printed(scene(3), "c", "train", sha="x"),
        printed(scene(4), "d", "test", sha="x"),
        printed(scene(5), "e", "train"),
        replace(printed(scene(6), "e", "val"), location="other/e.jpg"),
    ]
    causes = {(leak.first.location, leak.second.location): leak.cause for leak in find_leaks(pictures)}
    assert causes == {
        ("a.jpg", "b.jpg"): "sequence",
        ("c.jpg", "d.jpg"): "file",
        ("e.jpg", "other/e.jpg"): "id",
    }


def test_ids_of_different_sources_may_meet() -> None:
    ours, theirs = printed(scene(1), "0001", "train"), printed(scene(2), "0001", "val")
    assert find_leaks([ours, replace(theirs, source="lake", sha256="")]) == []


def test_one_side_alone_cannot_leak() -> None:
    assert find_leaks([printed(scene(1), name, "train", "s") for name in "ab"]) == []
    refuse_leaks([])


def test_more_pairs_are_counted() -> None:
    pictures = [printed(scene(1), name, split) for name, split in (("a", "train"), ("b", "val"), ("c", "val"))]
    with pytest.raises(UserError, match=r"\(and 1 more pairs\)"):
        refuse_leaks(find_leaks(pictures))


@pytest.mark.data
@pytest.mark.skipif(not data_folder().is_dir(), reason=f"no picture data at {data_folder()}; set PAANI_DATA")
def test_on_real_pictures_copies_are_found_and_different_sources_are_not() -> None:
    """Every sixth picture against a disguised copy of itself, and against every other source."""
    samples = {sample.picture: sample for sample in read_samples(data_folder(), SOURCES)}
    found, originals = 0, []
    for index, sample in enumerate(list(samples.values())[::6]):
        picture = read_picture(sample.picture)
        disguise = list(DISGUISES.values())[index % len(DISGUISES)]
        place = sample.source.folder.split("_")[0]  # two folders of one maker show the same views
        originals.append(printed(picture, sample.picture.name, place))
        copy = printed(np.asarray(disguise(picture), np.uint8), "copy", "val")
        found += bool(find_leaks([originals[-1], copy]))
    assert found >= 0.97 * len(originals) > 500
    assert find_leaks(originals) == []


def test_distance_counts_bits() -> None:
    assert hash_distance(0b1011, 0b0010) == 2
