"""Mask codes, box text, splits by sequence (R8, R10)."""

from pathlib import Path

import numpy as np
import pytest

from paani.cli import main as paani
from paani.errors import UserError
from paani_models.commands.models import data_folder, main
from paani_models.datasets.selection import PictureSelection, source_names
from paani_models.datasets.sources import (
    ANNOTATIONS,
    DETECTOR_CLASSES,
    SOURCES,
    WITHOUT_WATER,
    Source,
    choose_sources,
    decode_mask_classes,
    is_held_out,
    list_pictures_without_water,
    read_boxes,
    read_samples,
)


def write_source(folder: Path, files: dict[str, str]) -> None:
    folder.mkdir(parents=True)
    items = ",".join(f'{{"file":"images/{name}.jpg","seq":"{seq}"}}' for name, seq in files.items())
    (folder / "manifest.json").write_text(f'{{"items":[{items}]}}')


def test_mask_codes_r10() -> None:
    assert decode_mask_classes(np.array([0, 1, 2, 3, 4, 255], np.uint8)).tolist() == [1, 0, 2, 255, 255, 255]


def test_boxes_are_corners_clipped_to_the_picture(tmp_path: Path) -> None:
    label = tmp_path / "a.txt"
    label.write_text("1 0.5 0.5 0.2 0.4\n3 0.05 0.5 0.2 0.2 0.77\n\n")
    np.testing.assert_allclose(read_boxes(label), [[1, 0.4, 0.3, 0.6, 0.7], [3, 0, 0.4, 0.15, 0.6]], atol=1e-6)


def test_boxes_below_a_score_are_left_out_and_each_needs_one(tmp_path: Path) -> None:
    label = tmp_path / "a.txt"
    label.write_text("1 0.5 0.5 0.2 0.4 0.49\n3 0.5 0.5 0.2 0.2 0.5\n")
    np.testing.assert_allclose(read_boxes(label, 0.5), [[3, 0.4, 0.4, 0.6, 0.6]], atol=1e-6)
    label.write_text("1 0.5 0.5 0.2 0.4 0.9\n3 0.5 0.5 0.2 0.2\n")
    with pytest.raises(UserError, match=r"a\.txt:2: has no score after the box"):
        read_boxes(label, 0.5)


@pytest.mark.parametrize(
    "text", ["4 .5 .5 .1 .1", "1 .5 .5 0 .1", "1 .5 .5 .1", "1 .5 x .1 .1", "1 1.5 .5 .1 .1", "1 nan .5 .1 .1"]
)
def test_bad_boxes_are_refused_with_their_line_r8(tmp_path: Path, text: str) -> None:
    label = tmp_path / "a.txt"
    label.write_text(f"1 .5 .5 .1 .1\n{text}\n")
    with pytest.raises(UserError, match=r"a\.txt:2"):
        read_boxes(label)


def test_boxes_in_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    label = tmp_path / "a.txt"
    label.write_bytes(b"1 .5 .5 .1 .1\n# Bo\xefte\n")
    with pytest.raises(UserError, match=r"a\.txt"):
        read_boxes(label)


@pytest.mark.parametrize("held_out", ["seq0", "seq1", "seq2"])
def test_whole_sequences_are_held_out(tmp_path: Path, held_out: str) -> None:
    write_source(tmp_path / "river", {f"f{i}": f"seq{i % 3}" for i in range(9)})
    source = Source("river", "river", masks="masks", held_out=(held_out,))
    samples = read_samples(tmp_path, [source])
    assert {s.sequence for s in samples if s.held_out} == {held_out}
    assert {s.sequence for s in samples if not s.held_out} == {"seq0", "seq1", "seq2"} - {held_out}


def test_a_source_without_sequences_is_cut_into_runs(tmp_path: Path) -> None:
    write_source(tmp_path / "river", {f"f{i}": "" for i in range(50)})
    samples = read_samples(tmp_path, [Source("river", "river", masks="masks", held_out=("run1",))])
    assert [s.picture.stem for s in samples if s.held_out] == [f"f{i}" for i in range(24, 48)]


def test_a_repeated_file_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "buoys").mkdir()
    (tmp_path / "buoys" / "manifest.json").write_text('{"items":[{"file":"images/a.jpg"},{"file":"images/a.jpg"}]}')
    assert len(read_samples(tmp_path, [Source("buoys", "buoys", masks="masks")])) == 1


def test_about_one_sequence_in_eight_is_held_out_by_name() -> None:
    share = np.mean([is_held_out(Source("x", "x"), f"cluster{i}") for i in range(2000)])
    assert 0.10 < share < 0.15


def test_unknown_source_and_missing_manifest_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="'nowhere'"):
        choose_sources(["nowhere"])
    with pytest.raises(UserError, match=r"tbiseg_dasha.manifest\.json"):
        read_samples(tmp_path, choose_sources(["tbiseg_dasha"]))


@pytest.mark.parametrize("text", [",", "oasis,", ",oasis"])
def test_an_empty_name_is_not_every_source(text: str) -> None:
    with pytest.raises(UserError, match=f"^--sources {text}: names of sources"):
        source_names(text)
    assert (source_names(""), source_names("oasis,open")) == ([], ["oasis", "open"])


def test_a_name_that_no_folder_can_have_is_refused_with_its_variable(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PAANI_DATA", "n" * 300)
    assert paani(["models", "held-out"]) == 2
    assert capsys.readouterr().err == f"paani: PAANI_DATA {'n' * 300}: File name too long\n"
    monkeypatch.setenv("PAANI_DATA", "")
    unset = data_folder()
    monkeypatch.delenv("PAANI_DATA")
    assert unset == data_folder()


@pytest.mark.data
@pytest.mark.skipif(not data_folder().is_dir(), reason=f"no picture data at {data_folder()}; set PAANI_DATA")
def test_no_picture_is_on_both_sides_r8() -> None:
    samples = read_samples(data_folder(), SOURCES)
    for kind in ("mask", "label"):
        sides = [{s.picture for s in samples if getattr(s, kind) and s.held_out == side} for side in (True, False)]
        assert sides[0]
        assert not sides[0] & sides[1]


def test_pictures_without_water_are_listed_once_in_order() -> None:
    listed = WITHOUT_WATER.read_text().splitlines()
    assert listed == sorted(set(listed))
    assert list_pictures_without_water() == set(listed)


@pytest.mark.data
@pytest.mark.skipif(not data_folder().is_dir(), reason=f"no picture data at {data_folder()}; set PAANI_DATA")
def test_pictures_without_water_exist_and_those_held_out_are_no_clean_pictures(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert all((data_folder() / name).is_file() for name in list_pictures_without_water())
    assert main(["held-out", "--without-water"]) == 0
    dry = set(capsys.readouterr().out.split())
    assert main(["held-out"]) == 0
    others = set(capsys.readouterr().out.split())
    assert dry <= list_pictures_without_water()
    assert not others & list_pictures_without_water()
    trained = {s.picture for s in PictureSelection(data_folder(), [], None).training_samples()}
    assert len(dry) >= 15
    assert not {data_folder() / name for name in dry} & trained
    assert len([s for s in read_samples(data_folder(), SOURCES) if s.without_water and s.picture in trained]) >= 45


def test_every_drawn_box_is_a_pier_inside_its_picture() -> None:
    drawn = sorted(ANNOTATIONS.glob("*/*.txt"))
    assert len(drawn) > 100
    for path in drawn:
        assert (read_boxes(path)[:, 0] == DETECTOR_CLASSES.index("pier")).all(), path


@pytest.mark.data
@pytest.mark.skipif(not data_folder().is_dir(), reason=f"no picture data at {data_folder()}; set PAANI_DATA")
def test_drawn_boxes_belong_to_pictures_and_a_held_out_place_is_not_trained_on() -> None:
    pictures = PictureSelection(data_folder(), [], None)
    labels = {s.label for s in pictures.samples if s.source.drawn}
    assert labels == set(ANNOTATIONS.glob("*/*.txt"))
    held_out = {s.picture for s in pictures.boxed_samples(held_out=True) if s.source.drawn}
    assert 8 <= len(held_out) <= 20
    assert not held_out & {s.picture for s in pictures.boxed_samples(held_out=False)}


def test_w3_sequences_are_whole_however_the_held_out_ones_are_chosen(tmp_path: Path) -> None:
    """By one in so many, by the source's own lists, and by name."""
    write_source(tmp_path / "river", {f"f{i}": f"seq{i % 6}" for i in range(60)})
    samples = read_samples(tmp_path, [Source("river", "river", masks="masks", one_in=2)])
    held_out, others = ({s.sequence for s in samples if s.held_out is side} for side in (True, False))
    assert held_out
    assert others
    assert not held_out & others
    (tmp_path / "lists").mkdir()
    items = ",".join(f'{{"file":"images/{split}.jpg","split":"{split}"}}' for split in ("train", "val", "test"))
    (tmp_path / "lists" / "manifest.json").write_text(f'{{"items":[{items}]}}')
    source = Source("lists", "lists", masks="masks", splits=("train", "val", "test"))
    assert [s.held_out for s in read_samples(tmp_path, [source])] == [False, True, True]
    pier = next(source for source in SOURCES if source.name == "tampere_pier")
    assert pier.held_out == ("dock_image_07", "dock_image_08", "dock_image_09")
