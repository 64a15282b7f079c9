"""WaterScenes in its official layout: lists, selection, mapping, refusals (R1 - R8)."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.errors import UserError
from paani_models.commands.models import main
from paani_models.datasets.checked_files import Box
from paani_models.datasets.manifest import BoxCounts, count_boxes, format_counts_table, load_manifest
from paani_models.datasets.sources import DETECTOR_CLASSES, choose_sources, read_boxes, read_samples
from paani_models.datasets.waterscenes import (
    BOAT,
    BUOY,
    KAYAK,
    PIER,
    RARE,
    SAILOR,
    SEED,
    SHIP,
    TRAIN_IMAGES,
    VESSEL,
    map_classes,
    prepare_waterscenes,
    read_lists,
    select_train,
)
from tests.unit.paani_models.datasets.public_sets import scene, waterscenes, write_picture

pytestmark = pytest.mark.slow


def of(kind: int) -> Box:
    return Box(kind, 0.5, 0.5, 0.1, 0.1)


def test_the_seven_classes_map_to_four_r4() -> None:
    kinds = [box.kind for box in map_classes([of(k) for k in (PIER, BUOY, SAILOR, SHIP, BOAT, VESSEL, KAYAK)])]
    assert [DETECTOR_CLASSES[k] for k in kinds] == ["pier", "buoy", "person", "vessel", "vessel", "vessel", "vessel"]
    assert (PIER, BUOY, SAILOR, SHIP, BOAT, VESSEL, KAYAK) == (0, 1, 2, 3, 4, 5, 6), "as the label files number them"


def test_the_papers_constants_r1_r2() -> None:
    assert SEED == 42
    assert TRAIN_IMAGES == 10_000
    assert set(RARE) == {BUOY, SAILOR, KAYAK}


def test_lists_of_the_official_sizes_give_the_papers_pictures_r1(tmp_path: Path) -> None:
    """54,120 ids, of which 70, 20 and 10 % are for training, validation and test: 26,236 are prepared."""
    ids = [f"{number:06}" for number in range(1, 54_121)]
    for split, part in (("train", ids[:37_884]), ("val", ids[37_884:48_708]), ("test", ids[48_708:])):
        (tmp_path / f"{split}.txt").write_text("\n".join(part))
    lists = read_lists(tmp_path)
    boxes = {identity: [of(BUOY if number % 10 == 0 else SHIP)] for number, identity in enumerate(lists["train"])}
    chosen = select_train(boxes)
    assert (len(chosen), len(lists["val"]), len(lists["test"])) == (10_000, 10_824, 5_412)
    assert len(chosen) + len(lists["val"]) + len(lists["test"]) == 26_236
    assert sum(boxes[identity][0].kind == BUOY for identity in chosen) == 3_789


def test_a_miniature_is_counted_by_split_r1_r3_r5_r6_r7(tmp_path: Path) -> None:
    """Of six training pictures four are kept: the three rare ones and one of the others, with all of their boxes."""
    manifest, leaks = prepare_waterscenes(waterscenes(tmp_path / "raw"), tmp_path / "out", train_images=4)
    assert load_manifest(tmp_path / "out") == manifest
    assert leaks == []
    train, val, test = count_boxes(manifest)
    assert (train.split, train.images, train.person, train.buoy) == ("train", 4, 1, 1)
    assert val == BoxCounts("val", 1, person=1, vessel=1, pier=0, buoy=0)
    assert test == BoxCounts("test", 1, person=0, vessel=0, pier=1, buoy=1)
    kept = [read_boxes(tmp_path / "out" / item.label) for item in manifest.items]
    raw = (tmp_path / "raw" / "detection" / "yolo").glob("*.txt")
    rows = {path.stem: len(path.read_text().splitlines()) for path in raw}
    assert [len(boxes) for boxes in kept] == [rows[Path(item.file).stem] for item in manifest.items]


def test_r1_r2_ten_thousand_training_pictures_are_selected_with_seed_42(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, int]] = []

    def select_noting(boxes: Mapping[str, Sequence[Box]], limit: int, seed: int) -> tuple[str, ...]:
        asked.append((limit, seed))
        return select_train(boxes, limit, seed)

    monkeypatch.setattr("paani_models.datasets.waterscenes.select_train", select_noting)
    prepare_waterscenes(waterscenes(tmp_path / "raw"), tmp_path / "out")
    assert asked == [(10_000, 42)]


def test_r1_every_validation_and_test_picture_is_kept_however_few_train(tmp_path: Path) -> None:
    raw = waterscenes(tmp_path / "raw")
    (raw / "train.txt").write_text("000001\n000002\n")
    (raw / "val.txt").write_text("000003\n000004\n000007\n")
    (raw / "test.txt").write_text("000005\n000006\n000008\n")
    manifest, _ = prepare_waterscenes(raw, tmp_path / "out", train_images=1)
    assert [(count.split, count.images) for count in count_boxes(manifest)] == [("train", 1), ("val", 3), ("test", 3)]


@pytest.mark.parametrize("kind", sorted(RARE))
def test_r2_a_picture_is_rare_by_any_of_its_boxes(kind: int) -> None:
    boxes = {"a": [of(SHIP)], "b": [of(PIER), of(SHIP), of(kind)], "c": [of(BOAT), of(VESSEL)]}
    assert select_train(boxes, 1) == ("b",)


def test_r3_each_of_many_boxes_keeps_its_place_and_size(tmp_path: Path) -> None:
    raw = waterscenes(tmp_path / "raw")
    rows = [(3, 0.1 * place, 0.3, 0.04, 0.02 * place) for place in range(1, 9)]
    (raw / "detection" / "yolo" / "000004.txt").write_text("".join("{} {} {} {} {}\n".format(*row) for row in rows))
    prepare_waterscenes(raw, tmp_path / "out")
    vessel = DETECTOR_CLASSES.index("vessel")
    expected = [(vessel, x - w / 2, y - h / 2, x + w / 2, y + h / 2) for _, x, y, w, h in rows]
    np.testing.assert_allclose(read_boxes(tmp_path / "out" / "labels" / "000004.txt"), expected, atol=1e-5)


def test_u1_v2_validation_and_test_pictures_are_read_by_names_of_their_own(tmp_path: Path) -> None:
    prepare_waterscenes(waterscenes(tmp_path / "raw"), tmp_path / "waterscenes")
    held_out = {
        name: [sample.picture.stem for sample in read_samples(tmp_path, choose_sources([name])) if sample.held_out]
        for name in ("waterscenes", "waterscenes_test")
    }
    assert held_out == {"waterscenes": ["000007"], "waterscenes_test": ["000008"]}


def test_a_prepared_set_is_trained_on_by_name_and_watched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest, _ = prepare_waterscenes(waterscenes(tmp_path / "raw"), tmp_path / "waterscenes", train_images=4)
    sides = {
        name: [sample.held_out for sample in read_samples(tmp_path, choose_sources([name]))]
        for name in ("waterscenes", "waterscenes_test")
    }
    assert sides == {"waterscenes": [False] * 4 + [True], "waterscenes_test": [True]}
    command = ["prepare", "--data", str(tmp_path), "--sources", "waterscenes,waterscenes_test"]
    assert main(command) == 0
    write_picture(tmp_path / "waterscenes" / manifest.items[0].file, scene(99))
    assert main(command) == 2
    assert f"{manifest.items[0].file}: differs from its manifest" in capsys.readouterr().err


def test_the_counts_print_as_the_papers_table_r5() -> None:
    table = format_counts_table((BoxCounts("train", 10_000, 5_594, 9_484, 28_301, 11_538),))
    assert table.split() == [
        "split",
        "images",
        "person",
        "vessel",
        "pier",
        "buoy",
        "train",
        "10,000",
        "5,594",
        "9,484",
        "28,301",
        "11,538",
    ]


def test_the_same_seed_prepares_the_same_bytes_r2(tmp_path: Path) -> None:
    raw = waterscenes(tmp_path / "raw")
    for name in ("one", "two"):
        prepare_waterscenes(raw, tmp_path / name, train_images=4)
    one, two = (sorted(p for p in (tmp_path / n).rglob("*") if p.is_file()) for n in ("one", "two"))
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in two]


@given(st.lists(st.integers(0, 6), max_size=40), st.integers(0, 50), st.randoms())
def test_rare_pictures_come_first_whatever_the_order_r2(kinds: list[int], limit: int, random: object) -> None:
    boxes = {f"{index:03}": [of(kind)] for index, kind in enumerate(kinds)}
    chosen = select_train(boxes, limit)
    assert len(chosen) == min(limit, len(kinds)) == len(set(chosen))
    rare = {name for name, seen in boxes.items() if seen[0].kind in RARE}
    assert set(chosen) <= rare or rare <= set(chosen)
    assert chosen == select_train(dict(reversed(boxes.items())), limit)


def test_another_seed_fills_with_others_r2() -> None:
    boxes = {f"{index:03}": [of(SHIP)] for index in range(200)}
    assert select_train(boxes, 100, seed=42) != select_train(boxes, 100, seed=43)


def test_lists_may_hold_file_names(tmp_path: Path) -> None:
    for split, line in (("train", "./image/000001.jpg"), ("val", "000002"), ("test", "000003.jpg")):
        (tmp_path / f"{split}.txt").write_text(f"{line}\n\n")
    assert read_lists(tmp_path) == {"train": ("000001",), "val": ("000002",), "test": ("000003",)}


def _overlap(raw: Path) -> None:
    (raw / "val.txt").write_text("000007\n000001\n")


def _twice(raw: Path) -> None:
    (raw / "train.txt").write_text("000001\n000001\n")


def _no_list(raw: Path) -> None:
    (raw / "test.txt").unlink()


def _empty_list(raw: Path) -> None:
    (raw / "test.txt").write_text("\n")


def _no_folder(raw: Path) -> None:
    (raw / "image").rename(raw / "images")


def _no_picture(raw: Path) -> None:
    (raw / "image" / "000007.jpg").unlink()


def _no_label(raw: Path) -> None:
    (raw / "detection" / "yolo" / "000006.txt").unlink()


def _cut_short(raw: Path) -> None:
    path = raw / "image" / "000002.jpg"
    path.write_bytes(path.read_bytes()[:-40])


def _no_jpeg(raw: Path) -> None:
    (raw / "image" / "000002.jpg").write_bytes(b"hello")


def _one_pixel(raw: Path) -> None:
    write_picture(raw / "image" / "000002.jpg", scene(2)[:1, :1])


def _label(text: str) -> Callable[[Path], object]:
    return lambda raw: (raw / "detection" / "yolo" / "000003.txt").write_text(text)


REFUSALS: dict[str, tuple[Callable[[Path], object], str]] = {
    "an id in two lists": (_overlap, r"val\.txt: names 000001 and so does train\.txt"),
    "an id twice": (_twice, r"train\.txt: names 000001 twice"),
    "no list": (_no_list, r"test\.txt: "),
    "an empty list": (_empty_list, r"test\.txt: names no picture"),
    "no folder": (_no_folder, r"image: no such folder"),
    "no picture": (_no_picture, r"000007\.txt: has no picture"),
    "no label": (_no_label, r"000006\.txt: "),
    "a truncated picture": (_cut_short, r"000002\.jpg: cut short"),
    "no picture at all": (_no_jpeg, r"000002\.jpg: not a readable picture"),
    "one pixel": (_one_pixel, r"000002\.jpg: 1x1 is too small"),
    "an unknown class": (_label("7 .5 .5 .1 .1\n"), r"000003\.txt:1: unknown class 7"),
    "half a class": (_label("1.5 .5 .5 .1 .1\n"), r"000003\.txt:1: unknown class 1.5"),
    "outside": (_label("0 .5 .5 .1 .1\n0 .99 .5 .1 .1\n"), r"000003\.txt:2: a box outside"),
    "no area": (_label("0 .5 .5 0 .1\n"), r"000003\.txt:1: a box without area"),
    "not a number": (_label("0 nan .5 .1 .1\n"), r"000003\.txt:1: not finite"),
    "a word": (_label("0 here .5 .1 .1\n"), r"000003\.txt:1: "),
    "four fields": (_label("0 .5 .5 .1\n"), r"000003\.txt:1: "),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_what_is_wrong_is_named_and_nothing_is_half_written_r8(name: str, tmp_path: Path) -> None:
    spoil, message = REFUSALS[name]
    raw = waterscenes(tmp_path / "raw")
    spoil(raw)
    with pytest.raises(UserError, match=message) as refusal:
        prepare_waterscenes(raw, tmp_path / "out")
    assert "\n" not in str(refusal.value)
    assert [path.name for path in tmp_path.iterdir()] == ["raw"]


def test_several_mistakes_are_counted_r8(tmp_path: Path) -> None:
    raw = waterscenes(tmp_path / "raw")
    for identity in ("000001", "000004"):
        (raw / "detection" / "yolo" / f"{identity}.txt").write_text("9 .5 .5 .1 .1\n")
    with pytest.raises(UserError, match=r"000001\.txt:1: unknown class 9 \(and 1 more\)"):
        prepare_waterscenes(raw, tmp_path / "out")


def test_a_missing_label_can_be_declared_empty(tmp_path: Path) -> None:
    raw = waterscenes(tmp_path / "raw")
    _no_label(raw)
    manifest, _ = prepare_waterscenes(raw, tmp_path / "out", missing_is_empty=True)
    assert {item.file: sum(item.boxes) for item in manifest.items}["images/000006.jpg"] == 0


def test_a_view_on_both_sides_is_reported_or_refused(tmp_path: Path) -> None:
    """The official lists promise disjoint ids, no more."""
    raw = waterscenes(tmp_path / "raw")
    twin = np.clip(scene(1).astype(int) + 6, 0, 255).astype(np.uint8)
    write_picture(raw / "image" / "000007.jpg", twin)
    _, leaks = prepare_waterscenes(raw, tmp_path / "out")
    assert [(leak.cause, leak.first.identity, leak.second.identity) for leak in leaks] == [("view", "000001", "000007")]
    with pytest.raises(UserError, match=r"000001\.jpg \(train\) and .*000007\.jpg \(val\)"):
        prepare_waterscenes(raw, tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()


def test_an_existing_folder_is_never_written_into(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(UserError, match="already exists"):
        prepare_waterscenes(waterscenes(tmp_path / "raw"), tmp_path / "out")


@pytest.mark.parametrize(("one", "other"), [("train", "val"), ("train", "test"), ("val", "test")])
def test_r8_no_picture_is_in_any_two_lists(tmp_path: Path, one: str, other: str) -> None:
    for number, split in enumerate(("train", "val", "test")):
        (tmp_path / f"{split}.txt").write_text(f"{number}.jpg\n" + ("9.jpg\n" if split in {one, other} else ""))
    with pytest.raises(UserError, match=rf"{other}\.txt: names 9 and so does {one}\.txt"):
        read_lists(tmp_path)
