"""Knowledge distillation (Hinton et al. 2015) with feature hints (Romero et al. 2015, FitNets).

The small segmenter learns the teacher's class probabilities per pixel, and its standardised features at three scales.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from paani_models.segmenter.paper_network import TAP_CHANNELS, PaperSegmenter
from paani_models.segmenter.shipped_network import TAP_CHANNELS as TEACHER_CHANNELS
from paani_models.segmenter.shipped_network import ShippedSegmenter
from paani_models.training.training_state import training_device

LOGIT_GAIN, FEATURE_GAIN = 1.0, 0.5
FIRST_TAP = 1  # features at strides 8, 16 and 32 are compared; at stride 4 both networks see edges anyway


class Distillation(nn.Module):
    """Loss between a frozen teacher and a segmenter; its adapters are trained along and then thrown away."""

    def __init__(self, teacher: ShippedSegmenter) -> None:
        super().__init__()
        self.adapters = nn.ModuleList(
            nn.Sequential(nn.Conv2d(ours, theirs, 1, bias=False), nn.BatchNorm2d(theirs, affine=False))
            for ours, theirs in zip(TAP_CHANNELS[FIRST_TAP:], TEACHER_CHANNELS[FIRST_TAP:], strict=True)
        )
        teacher.eval().requires_grad_(False)
        self.teacher = [teacher.to(training_device())]  # in a list: the teacher is no part of this module's state

    def forward(self, pictures: Tensor, student: PaperSegmenter) -> tuple[Tensor, Tensor]:
        """The student's logits for pictures [N,3,H,W], and the distillation loss (a scalar)."""
        with torch.no_grad():
            teacher_taps = self.teacher[0].taps(pictures)
            teacher_logits = self.teacher[0].decode(teacher_taps, pictures)
        taps = student.taps(pictures)
        logits = student.decode(taps)
        loss = LOGIT_GAIN * kl_divergence(logits, teacher_logits)
        for adapter, ours, theirs in zip(self.adapters, taps[FIRST_TAP:], teacher_taps[FIRST_TAP:], strict=True):
            goal = F.interpolate(
                standardise_channels(theirs), size=ours.shape[2:], mode="bilinear", align_corners=False
            )
            loss = loss + FEATURE_GAIN / len(self.adapters) * F.mse_loss(adapter(ours), goal)
        return logits, loss


def kl_divergence(logits: Tensor, teacher_logits: Tensor) -> Tensor:
    """Kullback-Leibler divergence from the teacher's class probabilities, mean over pixels."""
    ours, theirs = (torch.log_softmax(x, 1) for x in (logits, teacher_logits))
    return F.kl_div(ours, theirs, reduction="none", log_target=True).sum(1).mean()


def standardise_channels(features: Tensor) -> Tensor:
    """Zero mean and unit variance per channel over the batch."""
    mean = features.mean((0, 2, 3), keepdim=True)
    deviation = features.std((0, 2, 3), keepdim=True)
    return (features - mean) / (deviation + 1e-4)
