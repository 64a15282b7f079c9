"""What keeps the starting point's knowledge: blended weights, the teacher's loss, and its boxes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani_models.detector import distillation  # noqa: E402
from paani_models.detector import train as detector_train  # noqa: E402
from paani_models.detector.data import BoxedPicture  # noqa: E402
from paani_models.detector.distillation import Teacher, add_teachers_boxes, blend_weights  # noqa: E402
from paani_models.detector.loss import Taught, assign_simota, box_corners, detector_loss, log_scores  # noqa: E402
from paani_models.detector.metrics import Detections  # noqa: E402
from paani_models.detector.off_the_shelf import OffTheShelf  # noqa: E402
from paani_models.detector.shipped_network import Detector, candidate_grid  # noqa: E402

pytestmark = pytest.mark.train
SEEN = np.full((256, 320, 3), 90, np.uint8)


@pytest.fixture
def teacher(monkeypatch: pytest.MonkeyPatch) -> Teacher:
    """A teacher of random weights, as the file of the real one is no part of the product."""
    monkeypatch.setattr(distillation, "load_yolox_weights", lambda net, path: None)
    torch.manual_seed(1)
    return Teacher(Path("none.onnx"))


def test_weights_are_blended_by_share() -> None:
    torch.manual_seed(0)
    one, other = Detector(), Detector()
    before = one.stem.conv.weight.detach().clone()
    blend_weights(one, other, 0.25)
    torch.testing.assert_close(one.stem.conv.weight, 0.75 * before + 0.25 * other.stem.conv.weight)
    with pytest.raises(UserError, match="--blend"):
        blend_weights(one, other, 1.5)


def test_the_teacher_speaks_only_where_nothing_is_annotated_and_of_what_it_knows(teacher: Teacher) -> None:
    pictures = torch.rand(1, 3, 64, 64)
    taught = teacher.answer(teacher.first_stages(pictures))
    boxes, logits = teacher.net.raw(pictures)
    assert (taught.scores[..., 2:] == 0).all()
    silent = torch.zeros(1, 4, 8, 8, dtype=torch.bool)

    def loss(mask: Any, logits: Any, *truth: list[float], taught: Taught | None = taught) -> float:
        known = torch.tensor(truth).reshape(-1, 5)
        return float(detector_loss(boxes, logits, [known], mask, (64, 64), taught)[1])

    assert loss(~silent, logits) == loss(~silent, logits, taught=None) > 0.0
    assert loss(silent, logits, taught=None) == 0.0
    assert loss(silent, logits + 1.0) > loss(silent, logits) > 0.0
    unknown = silent.clone()
    unknown[:, :2] = True
    assert loss(unknown, logits) == loss(unknown, logits, taught=None)


def test_what_people_drew_outdoes_the_teacher() -> None:
    """A candidate on a drawn person learns that, whatever the teacher says; a sure teacher moves boxes elsewhere."""
    centres, strides = candidate_grid(64, 64)
    boxes = torch.cat([centres, strides[:, None].expand(-1, 2) * 2], 1)[None]
    logits = torch.zeros(1, len(centres), 5)
    silent = torch.zeros(1, 4, 8, 8, dtype=torch.bool)
    drawn = torch.tensor([[0.0, 8, 8, 24, 24]])
    (owner,), _ = assign_simota(box_corners(boxes), log_scores(logits)[0], drawn[None], centres, strides)
    own = owner >= 0
    known = torch.tensor([True, True, False, False])
    says_no, says_vessel = torch.zeros(1, len(centres), 4), torch.zeros(1, len(centres), 4)
    says_vessel[0, own, 1] = 0.9
    first, second = (
        detector_loss(boxes, logits, [drawn], silent, (64, 64), Taught(boxes + 3.0, says, known))
        for says in (says_no, says_vessel)
    )
    assert first == second
    elsewhere = says_no.clone()
    elsewhere[0, int((~own).nonzero()[0]), 1] = 0.9
    third = detector_loss(boxes, logits, [drawn], silent, (64, 64), Taught(boxes + 3.0, elsewhere, known))
    unsure = detector_loss(boxes, logits, [drawn], silent, (64, 64), Taught(boxes + 3.0, elsewhere / 4, known))
    assert third[0] != first[0]
    assert unsure[0] == first[0]


def test_teachers_boxes_fill_what_a_source_leaves_out_once_each_and_are_kept(tmp_path: Path) -> None:
    """Both teachers see the person that a source of vessels leaves out, one a vessel too, which is not its to say."""

    def find(picture: np.ndarray, confidence: float, limit: int) -> Detections:
        boxes = np.array([[32, 64, 96, 128], [200, 100, 300, 200]], np.float32)
        return Detections(boxes, np.array([0.9, 0.8], np.float32), np.array([0, 1]))

    item = BoxedPicture("mcoe_boats", SEEN, np.zeros((0, 5), np.float32), np.array([0, 1, 0, 1], np.uint8))
    cache = tmp_path / "run" / "boxes.json"
    (filled,) = add_teachers_boxes([item], (OffTheShelf("a", find), OffTheShelf("b", find)), cache)
    np.testing.assert_allclose(filled.boxes, [[0, 0.1, 0.25, 0.3, 0.5]])
    whole = BoxedPicture("coco_mini", SEEN, item.boxes, np.array([1, 1, 0, 0], np.uint8))
    masked = BoxedPicture("bath_river", SEEN, item.boxes, np.zeros((4, 256, 320), np.uint8))
    again = add_teachers_boxes([whole, masked, item], (OffTheShelf("a", refuse),), cache)
    assert again[0] is whole
    assert again[1] is masked
    np.testing.assert_array_equal(again[2].boxes, filled.boxes)
    with pytest.raises(AssertionError, match="asked again"):
        add_teachers_boxes([replace(item, picture=SEEN + 1)], (OffTheShelf("a", refuse),), cache)


def refuse(picture: np.ndarray, confidence: float, limit: int) -> Detections:
    raise AssertionError("asked again")


def test_loose_boxes_give_way_to_the_teachers_inside_them(tmp_path: Path) -> None:
    """A loose box holds two people, one of them unsure; an unsure one outside it is no hint, a sure one is somebody."""

    def find(picture: np.ndarray, confidence: float, limit: int) -> Detections:
        boxes = np.array([[40, 40, 60, 80], [70, 40, 90, 80], [200, 40, 220, 80], [260, 40, 280, 80]], np.float32)
        scores = np.array([0.9, 0.2, 0.2, 0.9], np.float32)
        kept = scores > confidence
        return Detections(boxes[kept], scores[kept], np.zeros(int(kept.sum()), np.int64))

    loose = np.array([[0, 32 / 320, 32 / 256, 96 / 320, 96 / 256]], np.float32)
    item = BoxedPicture("surf_people", SEEN, loose, np.array([1, 0, 0, 0], np.uint8))
    (tight,) = add_teachers_boxes([item], (OffTheShelf("a", find),), tmp_path / "boxes.json")
    assert sorted((tight.boxes[:, 1] * 320).round().tolist()) == [40, 70, 260]
    assert not tight.exhaustive_mask.any()


def test_first_stages_serve_both_only_while_they_are_the_same(teacher: Teacher) -> None:
    other = Detector()
    assert not teacher.has_first_stages_of(other)
    other.load_state_dict(teacher.net.state_dict())
    other.dark4[0][0].conv.weight.data += 1.0
    assert teacher.has_first_stages_of(other)
    x = torch.rand(1, 3, 64, 64)
    torch.testing.assert_close(other.first_stages(x), teacher.first_stages(x))
    other.dark3[0][0].conv.bias.data[0] += 1e-6
    assert not teacher.has_first_stages_of(other)


def test_frozen_parts_do_not_learn_and_the_rest_does(
    teacher: Teacher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(detector_train, "NULL_DRAWS", 1)
    box = np.array([[1, 0.3, 0.4, 0.6, 0.6]], np.float32)
    item = BoxedPicture("mcoe_boats", SEEN, box, np.array([0, 1, 0, 1], np.uint8))
    recipe = detector_train.DetectorRecipe(
        epochs=1, batch=4, warmup_steps=1, frozen=("stem", "dark2"), distilled=True, height_px=128, width_px=160
    )
    torch.manual_seed(0)
    model = Detector()
    before = {name: value.clone() for name, value in model.state_dict().items()}
    detector_train.DetectorTraining(model, recipe, tmp_path, [item] * 7, [item], teacher).run()
    moved = {name.split(".")[0] for name, value in model.state_dict().items() if not torch.equal(value, before[name])}
    assert not moved & {"stem", "dark2"}
    assert moved >= {"dark3", "dark4", "heads"}
    detector_train.DetectorTraining(Detector(), recipe, tmp_path, [item] * 7, [item], teacher).run()  # goes on
