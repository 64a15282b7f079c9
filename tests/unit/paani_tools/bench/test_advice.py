"""`paani bench advice`: what annotations say is ahead, how advice is counted, and the whole on a small data folder."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from paani.arrays import U8
from paani.cli import main as paani
from paani.config import Config
from paani.messages import Advisory, Direction, Reason
from paani_models.datasets.sources import Sample, Source
from paani_tools.bench.advice import command
from paani_tools.bench.advice.ahead import Ahead, annotated_ahead, not_water_share
from paani_tools.bench.advice.command import main, thin_out
from paani_tools.bench.advice.tally import Judged, advised_lane, count_advice, tabulate
from tests.pictures import river

CORRIDORS = Config().perception.corridors
PERSON, VESSEL, BUOY = 0, 1, 3


def mask_to(shore_row: int, block: tuple[slice, slice] | None = None) -> U8:
    """A 100 x 100 mask: water below a row, obstacle above, and another obstacle."""
    mask = np.ones((100, 100), np.uint8)
    mask[shore_row:] = 0
    if block is not None:
        mask[block] = 1
    return mask


@pytest.mark.parametrize(
    ("kind", "box", "person", "vessel"),
    [
        (PERSON, (0.45, 0.4, 0.55, 0.55), True, False),
        (VESSEL, (0.45, 0.4, 0.55, 0.55), False, True),
        (BUOY, (0.45, 0.4, 0.55, 0.55), False, False),
        (PERSON, (0.45, 0.4, 0.55, 0.49), False, False),  # too small
        (PERSON, (0.05, 0.4, 0.55, 0.55), False, False),  # its middle is beside the centre
        (PERSON, (0.45, 0.1, 0.55, 0.29), False, False),  # above the corridors
    ],
)
def test_who_is_ahead_stands_in_the_centre_and_is_not_small(
    kind: int, box: tuple[float, ...], person: bool, vessel: bool
) -> None:
    boxes = np.array([(kind, *box)], np.float32)
    assert annotated_ahead(boxes, None, CORRIDORS) == Ahead(person, vessel, False)


def test_open_water_is_water_to_near_the_far_shore_with_nothing_boxed_in_it() -> None:
    assert annotated_ahead(None, mask_to(50), CORRIDORS).open_water
    assert annotated_ahead(None, mask_to(50, (slice(45, 56), slice(40, 60))), CORRIDORS).open_water
    assert not annotated_ahead(None, mask_to(50, (slice(70, 80), slice(45, 55))), CORRIDORS).open_water
    assert annotated_ahead(None, mask_to(50, (slice(70, 80), slice(0, 20))), CORRIDORS).open_water
    assert not annotated_ahead(None, mask_to(80), CORRIDORS).open_water
    far_buoy = np.array([(BUOY, 0.49, 0.5, 0.51, 0.53)], np.float32)
    assert not annotated_ahead(far_buoy, mask_to(50), CORRIDORS).open_water
    undecided = mask_to(50)
    undecided[60:] = 255
    assert annotated_ahead(None, undecided, CORRIDORS).open_water


def test_share_of_a_lane_that_is_not_water_is_of_what_was_decided() -> None:
    mask = mask_to(65)
    assert not_water_share(mask, CORRIDORS.center, 0.30) == pytest.approx(0.5)
    mask[:65] = 255
    assert not_water_share(mask, CORRIDORS.center, 0.30) == 0.0


def advice(direction: Direction, reason: Reason = Reason.CENTER_CLEAR) -> Advisory:
    return Advisory(source_us=1, direction=direction, reason=reason, lifetime_s=1.0)


def test_each_figure_is_asked_of_its_own_pictures() -> None:
    everything = Ahead(person=True, vessel=True, open_water=True)
    straight = count_advice(everything, advice(Direction.STRAIGHT), 0.81, 0.5)
    assert straight == {
        "person_ahead": True, "person_refused": False, "vessel_ahead": True,
        "own_mask": True, "human_mask": False, "open_water": True,
    }  # fmt: skip
    refused = count_advice(everything, advice(Direction.STOP, Reason.UNUSABLE_IMAGE), None, None)
    assert refused == {"person_ahead": False, "person_refused": True, "vessel_ahead": False, "open_water": False}
    assert count_advice(Ahead(False, False, False), advice(Direction.STRAIGHT), None, None) == {}


def test_a_turn_is_advice_for_its_side_and_a_stop_for_none() -> None:
    lanes = {direction: advised_lane(direction) for direction in Direction}
    assert (lanes[Direction.STRAIGHT], lanes[Direction.SLIGHT_LEFT]) == ("center", "left")
    assert (lanes[Direction.RIGHT], lanes[Direction.STOP], lanes[Direction.NO_DATA]) == ("right", None, None)


def test_the_table_pools_sources_and_gives_the_interval_of_each() -> None:
    def judged(source: str, straight: bool) -> Judged:
        return Judged(picture="p", source=source, sequence="s", direction=Direction.STOP, reason="r", explanation="e",
                      counts={"person_ahead": straight})  # fmt: skip

    table = tabulate([judged("lake", True), *[judged("lake", False)] * 8, judged("sea", False)], "dev", Config())
    assert [row[1:4] for row in table.rows] == [("all", 1, 10), ("lake", 1, 9), ("sea", 0, 1)]
    assert table.rows[0][4:7] == pytest.approx((0.1, 0.0179, 0.4042), abs=1e-4)


def test_thinning_out_keeps_even_distances_in_every_source() -> None:
    def sample(source: str) -> Sample:
        return Sample(Source(source, source), "s", False, Path(source), None, None)

    pictures = [[sample("many")] for _ in range(10)] + [[sample("few")] for _ in range(2)]
    kept = {id(of_one) for of_one in thin_out(pictures, 5)}
    assert [i for i, of_one in enumerate(pictures) if id(of_one) in kept] == [0, 2, 4, 6, 8, 10, 11]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A river source of one development and one held-out sequence, with its mask, and one swimmers' picture."""
    for folder, items in {"bath_river": ["a", "b"], "lifeguard_swim": ["c"]}.items():
        for below in ("images", "masks3", "labels"):
            (tmp_path / folder / below).mkdir(parents=True)
        for name in items:
            cv2.imwrite(str(tmp_path / folder / "images" / f"{name}.png"), river())
        manifest = [{"file": f"images/{n}.png", "seq": {"a": "run1", "b": "run3", "c": "cluster2"}[n]} for n in items]
        (tmp_path / folder / "manifest.json").write_text(json.dumps({"items": manifest}))
    for name in ("a", "b"):
        coded = np.where(mask_to(50) == 0, 1, 0).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "bath_river" / "masks3" / f"{name}.png"), coded)
    (tmp_path / "lifeguard_swim" / "labels" / "c.txt").write_text("0 0.5 0.6 0.1 0.3\n")
    return tmp_path


@pytest.mark.slow
def test_a_data_folder_becomes_a_table_and_one_line_per_picture(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "advice.json"
    assert main([str(data), "--sources", "bath_river,lifeguard_swim", "--json", str(out)]) == 0
    text = capsys.readouterr().out
    assert "advice on 2 annotated pictures, development sequences" in text
    report = json.loads(out.read_bytes())
    by_picture = {Path(line["picture"]).stem: line for line in report["pictures"]}
    assert by_picture.keys() == {"a", "c"}
    assert "person_ahead" in by_picture["c"]["counts"]
    assert by_picture["a"]["counts"]["open_water"] is (by_picture["a"]["direction"] == "STRAIGHT")
    assert main([str(data), "--sources", "bath_river", "--held-out"]) == 0
    assert "advice on 1 annotated pictures, held-out sequences" in capsys.readouterr().out


@pytest.mark.slow
def test_a_centre_that_is_occupied_by_eye_is_no_open_water(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all(line.count("/") >= 2 for line in command.occupied_centres())
    monkeypatch.setattr(command, "occupied_centres", lambda: frozenset({"bath_river/images/a.png"}))
    out = tmp_path / "advice.json"
    assert main([str(data), "--sources", "bath_river", "--json", str(out)]) == 0
    assert "open_water" not in json.loads(out.read_bytes())["pictures"][0]["counts"]


@pytest.mark.slow
def test_a_mask_that_is_mistaken_by_eye_says_nothing(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all(line.count("/") >= 2 for line in command.mistaken_masks())
    monkeypatch.setattr(command, "mistaken_masks", lambda: frozenset({"bath_river/images/a.png"}))
    out = tmp_path / "advice.json"
    assert main([str(data), "--sources", "bath_river", "--json", str(out)]) == 0
    assert json.loads(out.read_bytes())["pictures"][0]["counts"].keys() <= {"own_mask"}


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["nowhere"], "nowhere: no such folder"),
        (["DATA", "--sources", "puddles"], "'puddles' is not one of"),
        (["DATA", "--most", "0"], "0 is not at least 1"),
    ],
)
@pytest.mark.slow
def test_a_mistake_is_one_line(
    words: list[str], complaint: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = paani(["bench", "advice", *[str(data) if word == "DATA" else word for word in words]])
    except SystemExit as stop:  # argparse's own
        code = int(stop.code or 0)
    assert code == 2
    assert complaint in capsys.readouterr().err
