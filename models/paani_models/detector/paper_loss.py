"""Loss of the YOLO11n-shaped detector: task-aligned assignment (Feng et al. 2021, TOOD), complete IoU (Zheng et al.
2020), distribution focal loss (Li et al. 2020, GFL) and cross-entropy on the aligned scores.

Targets as in `paani_models.detector.loss`: boxes float32 [n,5] (class, corners in input pixels) per picture, and a map
of where a background candidate may be penalised for a class.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from paani_models.detector.loss import exhaustive_candidates, iou
from paani_models.detector.paper_network import BINS, STRIDES
from paani_models.detector.shipped_network import candidate_grid

TOP_K = 10
SCORE_POWER, IOU_POWER = 0.5, 6.0
BOX_GAIN, SCORE_GAIN, BINS_GAIN = 7.5, 0.5, 1.5  # S4


def complete_iou(a: Tensor, b: Tensor) -> Tensor:
    """IoU less the distance of the centres and the difference of the aspects; corner boxes, over the last axis."""
    ratio = iou(a, b)
    hull = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    apart = ((a[..., :2] + a[..., 2:] - b[..., :2] - b[..., 2:]) / 2).square().sum(-1)
    (wide_a, high_a), (wide_b, high_b) = ((x[..., 2:] - x[..., :2]).clamp(min=1e-6).unbind(-1) for x in (a, b))
    aspect = (4 / math.pi**2) * (torch.atan(wide_b / high_b) - torch.atan(wide_a / high_a)).square()
    with torch.no_grad():
        weight = aspect / (1.0 - ratio + aspect + 1e-7)
    return ratio - apart / (hull.square().sum(-1) + 1e-7) - weight * aspect


@torch.no_grad()
def assign_task_aligned(boxes: Tensor, scores: Tensor, truth: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
    """Which object each candidate answers for, and the score that it should reach.

    boxes: [A,4] predicted corners. scores: [A,C] in 0..1. truth: [n,5], n >= 1. centres: [A,2] in pixels.
    Returns the object index, -1 for none (int64 [A]), and the target score (float32 [A], 0 for none): an object's best
    candidate should reach the IoU that its best candidate has.
    """
    target = truth[:, 1:]
    middle, half = (target[:, :2] + target[:, 2:]) / 2, (target[:, 2:] - target[:, :2]) / 2
    half = half.clamp(min=STRIDES[0] / 2 + 1e-3)  # so that the smallest object holds a centre
    inside = ((centres[None] - middle[:, None]).abs() < half[:, None]).all(2)
    overlap = iou(target[:, None], boxes[None]).clamp(min=0) * inside
    aligned = scores[:, truth[:, 0].long()].T.pow(SCORE_POWER) * overlap.pow(IOU_POWER) * inside
    best = aligned.topk(min(TOP_K, aligned.shape[1]), 1).indices
    chosen = torch.zeros_like(inside).scatter_(1, best, True) & inside
    owner_overlap, owner = torch.where(chosen, overlap, -1.0).max(0)
    taken = owner_overlap >= 0.0
    mine = F.one_hot(owner, len(truth)).T.bool() & taken
    most_aligned = (aligned * mine).amax(1, keepdim=True)
    most_overlap = (overlap * mine).amax(1, keepdim=True)
    wanted = (aligned * mine / (most_aligned + 1e-9) * most_overlap).sum(0)
    return torch.where(taken, owner, -1), wanted


def bins_loss(bins: Tensor, distance: Tensor) -> Tensor:
    """Cross-entropy with the two bins beside the true distance, by nearness: [..., 4, BINS], [..., 4] -> [...].

    distance: in strides, at least 0; what lies beyond the last bin counts as the last.
    """
    distance = distance.clamp(0.0, BINS - 1 - 0.01)
    low = distance.floor()
    log_p = F.log_softmax(bins, -1)
    at_low, at_high = (log_p.gather(-1, (low.long() + step).unsqueeze(-1)).squeeze(-1) for step in (0, 1))
    return -(at_low * (low + 1.0 - distance) + at_high * (distance - low)).mean(-1)


def task_aligned_loss(
    boxes: Tensor, bins: Tensor, logits: Tensor, truths: list[Tensor], exhaustive_mask: Tensor, size_hw: tuple[int, int]
) -> tuple[Tensor, Tensor, Tensor]:
    """Box, score and distribution loss, each over the sum of the target scores and with its gain.

    boxes, bins, logits as `Yolo11n.raw` gives them. exhaustive_mask: bool [N,C,H/8,W/8].
    """
    centres, strides = (t.to(boxes.device) for t in candidate_grid(*size_hw))
    scores = logits.detach().sigmoid()
    target = torch.zeros_like(logits)
    weight = exhaustive_candidates(exhaustive_mask).to(logits.dtype)
    box_loss = bin_loss = boxes.sum() * 0.0
    for index, truth in enumerate(truths):
        if len(truth) == 0:
            continue
        owner, wanted = assign_task_aligned(boxes[index].detach(), scores[index], truth, centres)
        own = (owner >= 0).nonzero().squeeze(1)
        objects, share = truth[owner[own]], wanted[own]
        target[index, own, objects[:, 0].long()] = share.to(target.dtype)
        weight[index, own] = 1.0
        box_loss = box_loss + ((1.0 - complete_iou(boxes[index, own], objects[:, 1:])) * share).sum()
        sides = torch.cat([centres[own] - objects[:, 1:3], objects[:, 3:] - centres[own]], 1) / strides[own, None]
        bin_loss = bin_loss + (bins_loss(bins[index, own], sides) * share).sum()
    score_loss = (weight * F.binary_cross_entropy_with_logits(logits, target, reduction="none")).sum()
    total = target.sum().clamp(min=1.0)
    return BOX_GAIN * box_loss / total, SCORE_GAIN * score_loss / total, BINS_GAIN * bin_loss / total
