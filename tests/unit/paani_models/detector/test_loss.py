"""Assignment and loss of the detector: who answers for an object, and where the background may be punished."""

import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from torch import Tensor  # noqa: E402

from paani_models.detector.loss import (  # noqa: E402
    assign_simota,
    box_corners,
    detector_loss,
    exhaustive_candidates,
    generalised_iou,
    iou,
    stack_truths,
)
from paani_models.detector.shipped_network import candidate_grid  # noqa: E402

pytestmark = pytest.mark.train

SIZE_HW = (64, 64)
CELLS = (8, 8)
CANDIDATES = 64 + 16 + 4
VESSEL, BUOY = 1, 3


def as_cells() -> Tensor:
    centres, strides = candidate_grid(*SIZE_HW)
    cells: Tensor = torch.cat([centres, strides[:, None].repeat(1, 2)], 1)
    return cells


def assign(*pictures: list[list[float]]) -> list[tuple[Tensor, Tensor]]:
    """Owner and IoU of each candidate, picture by picture, where every candidate predicts its own cell."""
    boxes, log_p = box_corners(as_cells()), torch.full((len(pictures), CANDIDATES, 4), -1.0)
    truth = stack_truths([torch.tensor(each).reshape(-1, 5) for each in pictures])
    owners, qualities = assign_simota(boxes.expand(len(pictures), -1, -1), log_p, truth, *candidate_grid(*SIZE_HW))
    return list(zip(owners, qualities, strict=True))


def judge(*classes: int) -> Tensor:
    judged: Tensor = torch.zeros(1, 4, *CELLS, dtype=torch.bool)
    judged[:, list(classes)] = True
    return judged


def test_iou_and_giou_by_hand() -> None:
    a, b = torch.tensor([0.0, 0.0, 2.0, 2.0]), torch.tensor([1.0, 0.0, 3.0, 2.0])
    assert float(iou(a, b)) == pytest.approx(2 / 6, abs=1e-5)
    assert float(generalised_iou(a, b)) == pytest.approx(2 / 6, abs=1e-5)
    apart = torch.tensor([3.0, 0.0, 4.0, 2.0])
    assert float(generalised_iou(a, apart)) == pytest.approx(-(8 - 6) / 8, abs=1e-5)


def test_the_cell_that_fits_the_object_answers_for_it() -> None:
    ((owner, quality),) = assign([[VESSEL, 24.0, 24.0, 32.0, 32.0]])
    assert owner.tolist().count(0) == 1
    assert int(quality.argmax()) == 3 * 8 + 3
    assert float(quality.max()) == pytest.approx(1.0)


def test_overlapping_objects_each_keep_candidates_of_their_own() -> None:
    ((owner, _),) = assign([[VESSEL, 8.0, 8.0, 40.0, 40.0], [BUOY, 24.0, 24.0, 56.0, 56.0]])
    assert {0, 1} <= set(owner.tolist())


def test_what_answers_in_a_picture_does_not_depend_on_the_others_of_its_batch() -> None:
    crowd = [[VESSEL, 4.0 * k, 4.0 * k, 4.0 * k + 16.0, 4.0 * k + 16.0] for k in range(12)]
    pictures = [[[BUOY, 24.0, 24.0, 56.0, 56.0]], [], crowd]
    together, alone = assign(*pictures), [assign(each)[0] for each in pictures]
    assert all(
        torch.equal(a, b) for one, other in zip(together, alone, strict=True) for a, b in zip(one, other, strict=True)
    )
    assert [int((owner >= 0).any()) for owner, _ in together] == [1, 0, 1]


def test_background_is_punished_only_for_judged_classes() -> None:
    logits = torch.zeros(1, CANDIDATES, 5, requires_grad=True)
    _, score_loss = detector_loss(as_cells()[None], logits, [torch.zeros(0, 5)], judge(VESSEL), SIZE_HW)
    torch.autograd.backward(score_loss)
    assert logits.grad is not None
    class_gradient = logits.grad[0, :, 1:]
    assert (class_gradient[:, VESSEL] > 0).all()
    assert (class_gradient[:, [0, 2, 3]] == 0).all()


def test_a_coarse_candidate_is_judged_only_where_every_cell_under_it_is() -> None:
    judged = torch.ones(1, 4, *CELLS, dtype=torch.bool)
    judged[0, BUOY, 0, 0] = False
    table = exhaustive_candidates(judged)[0]
    assert not table[0, BUOY]
    assert table[1, BUOY]
    assert not table[64, BUOY]
    assert not table[80, BUOY]
    assert table[81, BUOY]
    assert table[:, VESSEL].all()


def test_a_perfect_answer_costs_less_than_a_missed_object() -> None:
    truth = [torch.tensor([[VESSEL, 24.0, 24.0, 32.0, 32.0]])]
    silent = torch.full((1, CANDIDATES, 5), -6.0)
    right = silent.clone()
    right[0, 3 * 8 + 3, [0, 1 + VESSEL]] = 6.0
    judged = judge(0, 1, 2, 3)
    losses = [sum(detector_loss(as_cells()[None], logits, truth, judged, SIZE_HW)) for logits in (right, silent)]
    assert losses[0] < losses[1]


def test_loss_is_finite_for_extreme_logits() -> None:
    logits = torch.full((1, CANDIDATES, 5), 80.0, requires_grad=True)
    box_loss, score_loss = detector_loss(as_cells()[None], logits, [torch.zeros(0, 5)], judge(0, 1, 2, 3), SIZE_HW)
    torch.autograd.backward(box_loss + score_loss)
    assert torch.isfinite(score_loss)
    assert logits.grad is not None
    assert torch.isfinite(logits.grad).all()
