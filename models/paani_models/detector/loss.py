"""Detector loss: SimOTA assignment (Ge et al. 2021, YOLOX), GIoU (Rezatofighi et al. 2019), joint cross-entropy.

Ours: the score is objectness times class, trained towards the square root of the IoU, and background is penalised for
a class only where the source boxes everything of it.

Targets of one picture are boxes float32 [n,5] (class, x1, y1, x2, y2 in input pixels) and a map `exhaustive_mask`
bool [4, H/8, W/8]: whether a stride-8 cell holds nothing unannotated of that class. A candidate without an object
is penalised for a class only where the mask holds for every cell under it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F

from paani_models.detector.shipped_network import STRIDES, candidate_grid

CENTRE_RADIUS_STRIDES = 1.5  # in strides: how near a box centre a candidate must be to be its natural choice
IOU_COST = 3.0
FAR_COST = 1e5
TOP_K = 10
BOX_GAIN, SCORE_GAIN = 5.0, 1.0
TAUGHT_BOX_MIN_SCORE = 0.3  # of a teacher's candidate whose box is learnt too


def box_corners(boxes: Tensor) -> Tensor:
    """cx, cy, w, h -> x1, y1, x2, y2, last axis."""
    half = boxes[..., 2:] / 2
    return torch.cat([boxes[..., :2] - half, boxes[..., :2] + half], -1)


def _iou_parts(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    overlap = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0).prod(-1)
    area_a = (a[..., 2:] - a[..., :2]).prod(-1)
    area_b = (b[..., 2:] - b[..., :2]).prod(-1)
    union = area_a + area_b - overlap
    hull = (torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])).prod(-1)
    return overlap / (union + 1e-7), union, hull


def iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of corner boxes, broadcasting over all axes but the last."""
    return _iou_parts(a, b)[0]


def generalised_iou(a: Tensor, b: Tensor) -> Tensor:
    """GIoU (Rezatofighi et al. 2019), broadcasting like `iou`."""
    ratio, union, hull = _iou_parts(a, b)
    return ratio - (hull - union) / (hull + 1e-7)


def log_scores(logits: Tensor) -> tuple[Tensor, Tensor]:
    """Log of the joint score and of one minus it, each [..., classes]; finite for any finite logits."""
    log_p = F.logsigmoid(logits[..., :1]) + F.logsigmoid(logits[..., 1:])
    return log_p, torch.log1p(-log_p.exp().clamp(max=1.0 - 1e-6))


@torch.no_grad()
def assign_simota(
    boxes: Tensor, log_p: Tensor, truth: Tensor, centres: Tensor, strides: Tensor
) -> tuple[Tensor, Tensor]:
    """SimOTA: which object of its picture each candidate answers for.

    boxes: [N,A,4] predicted corners. log_p: [N,A,C]. truth: [N,n,5] as `stack_truths` makes it, n >= 1. centres [A,2]
    and strides [A] of the candidates.
    Returns the object index per candidate, -1 for none (int64 [N,A]), and its IoU (float32 [N,A], 0 for none).
    """
    target, is_object = truth[:, :, 1:], (truth[:, :, 0] >= 0)[:, :, None]
    inside = ((centres > target[:, :, None, :2]) & (centres < target[:, :, None, 2:])).all(3) & is_object
    middle = (target[:, :, :2] + target[:, :, 2:]) / 2
    near = ((centres - middle[:, :, None]).abs() < CENTRE_RADIUS_STRIDES * strides[:, None]).all(3) & is_object
    is_possible = (inside | near).any(1, keepdim=True) & is_object
    overlap = torch.where(is_possible, iou(target[:, :, None], boxes[:, None]), 0.0)
    kinds = truth[:, :, :1].long().clamp(min=0).expand(-1, -1, len(centres))
    cost = -log_p.transpose(1, 2).gather(1, kinds) - IOU_COST * (overlap + 1e-8).log() + FAR_COST * ~(inside & near)
    cost = cost.masked_fill(~is_possible, torch.inf)
    wanted = overlap.topk(TOP_K, 2).values.sum(2, keepdim=True).int().clamp(min=1)
    cheapest = cost.topk(TOP_K, 2, largest=False)
    is_taken = (torch.arange(TOP_K, device=cost.device) < wanted) & cheapest.values.isfinite()
    chosen = torch.zeros_like(cost, dtype=torch.bool).scatter_(2, cheapest.indices, is_taken)
    best, owner = cost.masked_fill(~chosen, torch.inf).min(1)
    quality = overlap.gather(1, owner[:, None]).squeeze(1)
    return torch.where(best.isfinite(), owner, -1), torch.where(best.isfinite(), quality, 0.0)


def stack_truths(truths: Sequence[Tensor]) -> Tensor:
    """Boxes [n,5] of each picture -> [N,m,5], m >= 1 the most of them; class -1 where a picture has no more."""
    stacked = truths[0].new_full((len(truths), max(1, *map(len, truths)), 5), -1.0)
    for row, truth in zip(stacked, truths, strict=True):
        row[: len(truth)] = truth
    return stacked


def exhaustive_candidates(exhaustive_mask: Tensor) -> Tensor:
    """Stride-8 mask bool [N,C,h,w] -> bool [N,A,C]: true for a coarser candidate where it is for all cells under it."""
    unknown = (~exhaustive_mask).float()
    levels = [F.max_pool2d(unknown, stride // STRIDES[0]).flatten(2) for stride in STRIDES]
    return torch.cat(levels, 2).transpose(1, 2) < 0.5


@dataclass(frozen=True)
class Taught:
    """A teacher's answer: boxes cx, cy, w, h [N,A,4], joint scores [N,A,C], and which classes it knows [C]."""

    boxes: Tensor
    scores: Tensor
    known: Tensor


def detector_loss(
    boxes: Tensor,
    logits: Tensor,
    truths: list[Tensor],
    exhaustive_mask: Tensor,
    size_hw: tuple[int, int],
    taught: Taught | None = None,
) -> tuple[Tensor, Tensor]:
    """Box loss and score loss, each divided by the number of assigned candidates.

    taught: where nothing is annotated, a background candidate learns its scores, and its box as far as it is sure.

    boxes [N,A,4] and logits [N,A,5] as `Detector.raw` gives them. The score target of an assigned candidate is the
    square root of its IoU, so that a good box of a small object still scores above the 0.40 threshold (C6).
    """
    centres, strides = (t.to(boxes.device) for t in candidate_grid(*size_hw))
    corners = box_corners(boxes)
    log_p, log_not_p = log_scores(logits)
    target = torch.zeros_like(log_p)
    weight = exhaustive_candidates(exhaustive_mask).to(log_p.dtype)
    sure = torch.zeros_like(log_p[..., 0])
    if taught is not None:
        silent = (weight < 0.5) & taught.known
        target, weight = target + silent * taught.scores, weight + silent
        sure = target.amax(2)
    truth = stack_truths(truths)
    owner, quality = assign_simota(corners, log_p, truth, centres, strides)
    own = owner >= 0
    objects = truth.gather(1, owner.clamp(min=0)[..., None].expand(-1, -1, truth.shape[2]))
    answers = F.one_hot(objects[..., 0].long().clamp(min=0), target.shape[2]) * quality.sqrt()[..., None]
    target, weight = torch.where(own[..., None], answers, target), weight.masked_fill(own[..., None], 1.0)
    sure = sure.masked_fill(own, 0.0)
    box_loss = (own * (1.0 - generalised_iou(corners, objects[..., 1:]))).sum()
    assigned = own.sum()
    if taught is not None:
        sure = sure * (sure > TAUGHT_BOX_MIN_SCORE)
        box_loss = box_loss + (sure * (1.0 - generalised_iou(corners, box_corners(taught.boxes)))).sum()
        assigned = assigned + (sure > 0).sum()
    score_loss = -(weight * (target * log_p + (1.0 - target) * log_not_p)).sum()
    share = 1.0 / assigned.clamp(min=1)
    return BOX_GAIN * box_loss * share, SCORE_GAIN * score_loss * share
