"""Detector loss: SimOTA assignment (Ge et al. 2021, YOLOX), GIoU (Rezatofighi et al. 2019), joint cross-entropy.

Ours: the score is objectness times class, trained towards the square root of the IoU, and background is penalised for
a class only where the source boxes everything of it.

Targets of one picture are boxes float32 [n,5] (class, x1, y1, x2, y2 in input pixels) and a map `exhaustive_mask`
bool [4, H/8, W/8]: whether a stride-8 cell holds nothing unannotated of that class. A candidate without an object
is penalised for a class only where the mask holds for every cell under it.
"""

from __future__ import annotations

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
    """SimOTA: which object each candidate answers for.

    boxes: [A,4] predicted corners. log_p: [A,C]. truth: [n,5], n >= 1. centres [A,2] and strides [A] of the candidates.
    Returns the object index per candidate, -1 for none (int64 [A]), and its IoU (float32 [A], 0 for none).
    """
    target = truth[:, 1:]
    inside = ((centres[None] > target[:, None, :2]) & (centres[None] < target[:, None, 2:])).all(2)
    middle = (target[:, :2] + target[:, 2:]) / 2
    near = ((centres[None] - middle[:, None]).abs() < CENTRE_RADIUS_STRIDES * strides[None, :, None]).all(2)
    possible = (inside | near).any(0).nonzero().squeeze(1)
    owner = torch.full((len(centres),), -1, dtype=torch.int64, device=boxes.device)
    quality = torch.zeros(len(centres), device=boxes.device)
    if len(possible) == 0:
        return owner, quality
    overlap = iou(target[:, None], boxes[None, possible])
    cost = -log_p[possible][:, truth[:, 0].long()].T - IOU_COST * (overlap + 1e-8).log()
    cost = cost + FAR_COST * (~(inside & near)[:, possible])
    chosen = torch.zeros_like(cost, dtype=torch.bool)
    wanted = overlap.topk(min(TOP_K, len(possible)), 1).values.sum(1).int().clamp(min=1)
    for row, count in enumerate(wanted.tolist()):
        chosen[row, cost[row].topk(count, largest=False).indices] = True
    cost = cost.masked_fill(~chosen, torch.inf)
    best, index = cost.min(0)
    taken = best.isfinite()
    owner[possible[taken]] = index[taken]
    quality[possible[taken]] = overlap[index[taken], taken.nonzero().squeeze(1)]
    return owner, quality


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
    box_loss = boxes.sum() * 0.0
    assigned = 0
    for index, truth in enumerate(truths):
        if len(truth) == 0:
            continue
        owner, quality = assign_simota(corners[index], log_p[index], truth, centres, strides)
        own = (owner >= 0).nonzero().squeeze(1)
        objects = truth[owner[own]]
        sure[index, own] = 0.0
        target[index, own] = 0.0
        target[index, own, objects[:, 0].long()] = quality[own].sqrt()
        weight[index, own] = 1.0
        box_loss = box_loss + (1.0 - generalised_iou(corners[index, own], objects[:, 1:])).sum()
        assigned += len(own)
    if taught is not None:
        sure = sure * (sure > TAUGHT_BOX_MIN_SCORE)
        box_loss = box_loss + (sure * (1.0 - generalised_iou(corners, box_corners(taught.boxes)))).sum()
        assigned += int((sure > 0).sum())
    score_loss = -(weight * (target * log_p + (1.0 - target) * log_not_p)).sum()
    return BOX_GAIN * box_loss / max(1, assigned), SCORE_GAIN * score_loss / max(1, assigned)
