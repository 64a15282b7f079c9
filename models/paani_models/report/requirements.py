"""Required figures of the models, what they reach, and the measured reason where they miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from paani_models.report.box_errors import OUTCOMES, BoxErrors
from paani_models.report.mask_errors import EDGE_DISTANCES_PX, MaskErrors, edge_f1, mean_iou, water_iou
from paani_models.report.records import FaultReport, image_quality_figures

PHOTOGRAPHS = "photographs"  # every real source that boxes the class, pooled
FAR_PX = EDGE_DISTANCES_PX[-1]
SMALL_PX, NEAR_PX = 8.0, 16.0

_MASK_FIGURES = {"iou_water": water_iou, "miou": mean_iou}


@dataclass(frozen=True)
class Requirement:
    """Bound of a figure on held-out sequences of real pictures: a least value, or with `at_most` a largest."""

    net: str
    metric: str
    source: str
    bound: float
    at_most: bool = False

    def is_met_by(self, value: float) -> bool:
        """Whether a figure of this value is good enough."""
        return value <= self.bound if self.at_most else value >= self.bound


REQUIREMENTS = (
    Requirement("segmenter", "iou_water", "tbiseg_usvinland", 0.97),
    Requirement("segmenter", "iou_water", "tbiseg_dasha", 0.97),
    Requirement("segmenter", "miou", "mastr1325", 0.95),
    Requirement("segmenter", "edge_f1", "mastr1325", 0.88),
    Requirement("detector", "vessel_ap50", PHOTOGRAPHS, 0.75),
    Requirement("detector", "buoy_ap50", PHOTOGRAPHS, 0.60),
    Requirement("detector", "person_ap50", PHOTOGRAPHS, 0.50),
    Requirement("gate", "unfit_accepted_frac", "spoilt", 0.005, at_most=True),
    Requirement("gate", "fit_refused_frac", "spoilt", 0.01, at_most=True),
    Requirement("gate", "clean_refused_frac", "all", 0.002, at_most=True),
)
_WORST_CELLS = 5


@dataclass(frozen=True)
class RequirementResult:
    """A requirement and what was measured; n counts pictures, or true boxes. limit: why it is missed, else empty."""

    requirement: Requirement
    value: float
    n: int
    limit: str

    @property
    def is_met(self) -> bool:
        """Whether the figure satisfies its requirement."""
        return self.requirement.is_met_by(self.value)


def compare_with_requirements(
    masks: Sequence[MaskErrors], boxes: Sequence[BoxErrors], faults: FaultReport | None = None
) -> list[RequirementResult]:
    """Compare every requirement whose measurement is at hand."""
    check_figures = (
        {(figure.metric, figure.source): figure for figure in image_quality_figures(faults)} if faults else {}
    )
    by_source = {limits.source.name: limits for limits in masks}
    by_kind = {f"{limits.kind}_ap50": limits for limits in boxes}
    found = []
    for requirement in REQUIREMENTS:
        if requirement.net == "segmenter" and requirement.source in by_source:
            found.append(_compare_masks(requirement, by_source[requirement.source]))
        elif requirement.net == "detector" and requirement.metric in by_kind:
            found.append(_compare_boxes(requirement, by_kind[requirement.metric]))
        elif (
            requirement.net == "gate"
            and faults
            and (figure := check_figures.get((requirement.metric, requirement.source)))
        ):
            limit = "" if requirement.is_met_by(figure.value) else _describe_wrong_verdicts(requirement, faults)
            found.append(RequirementResult(requirement, figure.value, figure.n, limit))
    return found


def _describe_wrong_verdicts(requirement: Requirement, faults: FaultReport) -> str:
    """Name the fault levels or sources on which the image-quality check is wrong most often."""
    if requirement.source == "all":
        wrong = [(source.rejected, source.n, source.source) for source in faults.clean]
    else:
        verdict = "reject" if requirement.metric == "unfit_accepted_frac" else "accept"
        wrong = [
            (
                cell.n - cell.rejected if verdict == "reject" else cell.rejected,
                cell.n,
                f"{cell.fault.replace('_', ' ')} {cell.severity} (mean IoU {cell.miou:.2f})",
            )
            for cell in faults.cells
            if cell.verdict == verdict
        ]
    worst = sorted((w for w in wrong if w[0]), key=lambda w: -w[0])[:_WORST_CELLS]
    return f"Wrong most often: {'; '.join(f'{count} of {n} in {name}' for count, n, name in worst)}."


def _compare_masks(requirement: Requirement, limits: MaskErrors) -> RequirementResult:
    if requirement.metric == "edge_f1":
        value, best = edge_f1(limits.edges), edge_f1(limits.best_edges)
    else:
        value, best = (_MASK_FIGURES[requirement.metric](counts) for counts in (limits.counts, limits.best_counts))
    if requirement.is_met_by(value):
        return RequirementResult(requirement, value, limits.n, "")
    return RequirementResult(
        requirement,
        value,
        limits.n,
        f"{_describe_mask_errors(limits)} The best answer of the net's cells reaches {best:.3f}.",
    )


def _describe_mask_errors(limits: MaskErrors) -> str:
    if limits.wrong == 0:
        return "No pixel is wrong."
    wrong = limits.wrong
    far, taken = 1 - limits.near[-1] / wrong, limits.false_water.sum() / wrong
    missed = limits.missed_water.sum() / wrong
    return (
        f"Of the {wrong / limits.counts.sum():.1%} of pixels that are wrong, {taken:.0%} are something else taken for "
        f"water and {missed:.0%} are water missed; {far:.0%} lie more than {FAR_PX} px from a true edge."
    )


def _compare_boxes(requirement: Requirement, limits: BoxErrors) -> RequirementResult:
    if requirement.is_met_by(limits.ap50):
        return RequirementResult(requirement, limits.ap50, limits.n, "")
    small, small_count = limits.count_found_between(0.0, SMALL_PX)
    near, near_count = limits.count_found_between(NEAR_PX, float("inf"))
    fates = ", ".join(f"{count} {fate}" for fate, count in zip(OUTCOMES[1:], limits.outcomes[1:], strict=True))
    return RequirementResult(
        requirement,
        limits.ap50,
        limits.n,
        f"Of {small_count} objects under {SMALL_PX:g} px high {small} are found, of {near_count} of {NEAR_PX:g} px and "
        f"more {near}. What is not found: {fates}.",
    )
