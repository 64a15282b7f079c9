"""A training bundle: bounded, the same bytes twice, and the same splits once unpacked."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from paani.errors import UserError
from paani_models.commands.models import main
from paani_models.datasets.inventory import find_detector_leaks, find_segmenter_leaks, read_all_samples
from paani_models.datasets.pack import QUALITIES, cover_size_wh, pack_bundle
from paani_models.datasets.sources import Sample, Source, choose_sources, read_boxes, read_mask, read_samples
from paani_models.detector.data import read_boxed
from paani_models.segmenter.scores import read_truth as read_water
from tests.unit.paani_models.datasets.public_sets import own_data, scene, write_picture
from tests.unit.paani_models.datasets.unpacking import unpack

pytestmark = pytest.mark.slow

NAMES = ["tbiseg_dasha", "mcoe_boats"]


def packed(data: Path, out: Path, max_mb: float = 1.0) -> Path:
    pack_bundle(out, read_samples(data, choose_sources(NAMES)), lambda source: data / source.folder, max_mb=max_mb)
    return out


def story(data: Path) -> list[tuple[str, str, bool, str]]:
    samples = read_samples(data, choose_sources(NAMES))
    return [(s.source.name, s.sequence, s.held_out, str(s.picture.relative_to(data))) for s in samples]


@pytest.mark.parametrize("name", ["bundle.tar", "bundle.tar.gz"])
def test_the_same_splits_once_unpacked(name: str, tmp_path: Path) -> None:
    data = own_data(tmp_path / "data")
    archive = packed(data, tmp_path / name)
    assert archive.stat().st_size <= 1_000_000
    there = unpack(archive, tmp_path / "there")
    assert story(there) == story(data)
    assert {held_out for _, _, held_out, _ in story(there)} == {True, False}


def test_pictures_shrink_and_masks_with_them(tmp_path: Path) -> None:
    data = own_data(tmp_path / "data")
    there = unpack(packed(data, tmp_path / "b.tar"), tmp_path / "there")
    for sample in read_samples(there, choose_sources(NAMES)):
        picture = cv2.imread(str(sample.picture))
        if sample.mask:
            assert picture is not None
            assert picture.shape[:2] == read_mask(sample.mask).shape == (256, 410)
            assert set(read_mask(sample.mask).ravel().tolist()) == {0, 1, 2}
            assert (sample.mask.parent.parent / "masks" / sample.mask.name).is_file()
        if sample.label:
            assert picture is not None
            assert picture.shape[:2] == (267, 320)
            assert len(read_boxes(sample.label)) == 2


@pytest.mark.parametrize(
    ("wh", "expected"),
    [((640, 512), (320, 256)), ((1920, 1080), (455, 256)), ((480, 640), (320, 427)), ((300, 200), (300, 200))],
)
def test_a_picture_still_covers_the_input(wh: tuple[int, int], expected: tuple[int, int]) -> None:
    assert cover_size_wh(wh) == expected


def test_the_same_bytes_twice(tmp_path: Path) -> None:
    data = own_data(tmp_path / "data")
    for name in ("a.tar", "a.tar.gz"):
        first = packed(data, tmp_path / name).read_bytes()
        (data / "tbiseg_dasha" / "images" / "DJI_0001_0.jpg").touch()
        assert packed(data, tmp_path / name).read_bytes() == first


def test_the_quality_is_the_best_that_fits(tmp_path: Path) -> None:
    data = own_data(tmp_path / "data")
    samples = read_samples(data, choose_sources(NAMES))

    def at(max_mb: float) -> tuple[int, int]:
        done = pack_bundle(tmp_path / "b.tar", samples, lambda s: data / s.folder, max_mb=max_mb)
        assert done.size_bytes == (tmp_path / "b.tar").stat().st_size <= max_mb * 1e6
        return done.quality, done.size_bytes

    best, size = at(5.0)
    assert best == QUALITIES[0]
    assert at(size * 0.9 / 1e6)[0] < best


def test_what_does_not_fit_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    data = own_data(tmp_path / "data")
    for max_mb, message in ((0.01, "alone take"), (0.06, "do not fit into 0.06 MB")):
        with pytest.raises(UserError, match=message):
            packed(data, tmp_path / "b.tar", max_mb)
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_weights_and_a_start_travel_along(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = own_data(tmp_path / "data")
    (tmp_path / "best.pt").write_bytes(b"start")
    arguments = ["pack", "--data", str(data), "--sources", ",".join(NAMES), "--start", str(tmp_path / "best.pt")]
    assert main([*arguments, "--out", str(tmp_path / "b.tar")]) == 0
    assert "12 pictures, JPEG quality 95" in capsys.readouterr().out
    there = unpack(tmp_path / "b.tar", tmp_path / "there")
    assert (there / "_weights" / "start.bin").read_bytes() == bytes(range(256))
    assert (there / "_start" / "best.pt").read_bytes() == b"start"


def test_two_starts_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = own_data(tmp_path / "data")
    arguments = ["pack", "--data", str(data), "--sources", ",".join(NAMES), "--out", str(tmp_path / "b.tar")]
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "best.pt").write_bytes(b"start")
        arguments += ["--start", str(tmp_path / folder / "best.pt")]
    assert main(arguments) == 2
    assert "--start: two files are called best.pt" in capsys.readouterr().err
    assert not (tmp_path / "b.tar").exists()
    with pytest.raises(SystemExit):
        main([*arguments[:-2], "--max-mb", "nan"])
    assert "--max-mb" in capsys.readouterr().err


def test_terms_travel_along(tmp_path: Path) -> None:
    there = unpack(packed(own_data(tmp_path / "data"), tmp_path / "b.tar"), tmp_path / "there")
    text = (there / "mcoe_boats" / "manifest.json").read_text()
    assert all(word in text for word in ("someone/water", "abc", "CC0", "JPEG quality 95"))


def test_prepare_reports_leaks_between_splits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = own_data(tmp_path / "data")
    command = ["prepare", "--data", str(data), "--sources", ",".join(NAMES), "--manifest", str(tmp_path / "m.json")]
    assert main(command) == 0
    assert "mcoe_boats (train): " in capsys.readouterr().out
    assert '"licence": "CC0"' in (tmp_path / "m.json").read_text()

    leaked = data / "tbiseg_dasha" / "images" / "DJI_0035_2.jpg"
    kept = leaked.read_bytes()
    leaked.write_bytes((data / "tbiseg_dasha" / "images" / "DJI_0001_1.jpg").read_bytes())
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "DJI_0001_1.jpg (train)" in error
    assert "DJI_0035_2.jpg (held out)" in error
    assert "splits leak: 1 pairs" in error

    leaked.write_bytes(kept[:-9])
    assert main(command) == 2
    assert "DJI_0035_2.jpg: cut short" in capsys.readouterr().err

    leaked.write_bytes(kept)
    write_picture(data / "tbiseg_dasha" / "masks3" / "DJI_0035_2.png", scene(1)[..., 0])
    assert main(command) == 2
    assert "DJI_0035_2.png: 96x64, its picture is 640x400" in capsys.readouterr().err


def test_a_mask_only_neighbour_of_a_held_out_box_is_a_leak(tmp_path: Path) -> None:
    """The detector also learns from pictures with masks alone."""
    data = own_data(tmp_path / "data")
    twin = (data / "mcoe_boats" / "images" / "boat5.jpg").read_bytes()
    (data / "tbiseg_dasha" / "images" / "DJI_0001_0.jpg").write_bytes(twin)
    for kind in ("masks", "masks3"):
        write_picture(data / "tbiseg_dasha" / kind / "DJI_0001_0.png", scene(1, (360, 300))[..., 0] * 0)
    held = Source("mcoe_boats", "mcoe_boats", labels="labels", annotated=frozenset({"vessel"}), held_out=("cluster5",))
    samples: list[Sample] = read_samples(data, [*choose_sources(["tbiseg_dasha"]), held])
    seen = read_all_samples(samples, lambda source: data / source.folder)
    assert [leak.cause for leak in find_detector_leaks(seen)] == ["file"]
    assert find_segmenter_leaks(seen) == []


def test_everything_that_training_reads_is_there(tmp_path: Path) -> None:
    there = unpack(packed(own_data(tmp_path / "data"), tmp_path / "b.tar"), tmp_path / "there")
    assert main(["prepare", "--data", str(there), "--sources", ",".join(NAMES)]) == 0
    for sample in read_samples(there, choose_sources(NAMES)):
        assert len(read_boxed(sample).boxes) == (2 if sample.label else 0)
        assert read_water(sample).shape == (256, 410) if sample.mask else sample.label
