"""The page: four classes of evidence in four sections, each on its own (U7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from string import Template

from paani.statistics.charts import Points, lines
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.metrics import RECALL_STEPS
from paani_models.report.box_errors import BoxErrors
from paani_models.report.error_tables import render_box_errors, render_mask_errors, render_requirements
from paani_models.report.estimates import ALARMS, Estimate, Evaluation
from paani_models.report.evidence import TITLES, Evidence, Finding, group_by_evidence
from paani_models.report.experiments import Experiment
from paani_models.report.mask_errors import MaskErrors
from paani_models.report.overlays import DrawnPicture, render_gallery
from paani_models.report.records import FaultReport, render_fault_charts, render_training_charts
from paani_models.report.requirements import RequirementResult
from paani_models.report.tables import (
    render_box_table,
    render_confusion_table,
    render_findings_table,
    render_mask_table,
    render_rate_table,
    render_sequence_table,
)

MASK_KEY = (
    '<p class="key"><span style="background:#0072b2"></span>water<span style="background:#e69f00"></span>obstacle'
    '<span style="background:#cc79a7"></span>sky<span style="background:#dc0000"></span>differs from the truth</p>'
)
BOX_KEY = (
    '<p class="key"><span style="background:#00c878"></span>boxed by people'
    '<span style="background:#ff8c00"></span>found at confidence 0.40; only classes that a '
    "source boxes count as mistakes</p>"
)


@dataclass(frozen=True)
class PageContent:
    """Everything that the page shows. runs: rows per epoch by run name."""

    evaluation: Evaluation
    findings: Sequence[Finding] = ()
    runs: Mapping[str, Sequence[dict[str, float]]] = field(default_factory=dict)
    faults: FaultReport | None = None
    requirements: Sequence[RequirementResult] = ()
    experiments: Sequence[Experiment] = ()
    mask_errors: Sequence[MaskErrors] = ()
    box_errors: Sequence[BoxErrors] = ()
    worst_masks: Sequence[DrawnPicture] = ()
    best_masks: Sequence[DrawnPicture] = ()
    worst_boxes: Sequence[DrawnPicture] = ()
    best_boxes: Sequence[DrawnPicture] = ()


def page(content: PageContent) -> str:
    """The HTML text. Raises ValueError where the evaluation does not call itself one of labelled models."""
    if content.evaluation.evidence is not Evidence.LABELLED:
        raise ValueError(f"the evaluation is of {content.evaluation.evidence}")
    parts = []
    for kind, found in group_by_evidence(content.findings).items():
        body = _render_labelled(content) if kind is Evidence.LABELLED else ""
        body += render_findings_table(found) if found else ""
        body = body or '<p class="faint">Nothing was given for this class.</p>'
        parts.append(f'<section id="{kind}"><h2>{TITLES[kind]}</h2>{body}</section>')
    models = "; ".join(f"{m.name} <code>{m.sha256[:16]}</code>" for m in content.evaluation.models)
    navigation = "".join(f'<a href="#{kind}">{TITLES[kind]}</a>' for kind in Evidence)
    template = Template((files("paani_models.report") / "page.html").read_text(encoding="utf-8"))
    return template.substitute(models=models, navigation=navigation, sections="\n".join(parts))


def _render_labelled(content: PageContent) -> str:
    estimates = content.evaluation.estimates
    masks = [e for e in estimates if not e.metric.startswith((*DETECTOR_CLASSES, ALARMS))]
    alarms = [e for e in estimates if e.metric == ALARMS]
    boxes = [e for e in estimates if e.metric.startswith(DETECTOR_CLASSES)]
    parts = [
        "<p>Held-out sequences only. Intervals hold 95 % and come from drawing whole sequences again, with a fixed "
        "seed; frames of one sequence count as one piece of evidence. Without at least two sequences there is none.</p>"
    ]
    if content.requirements:
        parts.append(render_requirements(content.requirements, content.experiments))
    if masks:
        parts += _render_segmenter(content, masks)
    if boxes:
        parts += _render_detector(content, boxes)
    if alarms:
        parts.append("<h3>Detector: boxes per picture on rivers that show no craft</h3>" + render_rate_table(alarms))
    if content.faults:
        parts.append("<h3>Image-quality check: pictures that cannot be used</h3>")
        parts.append(
            "<p>Share of pictures refused, and the segmenter's mean IoU on all of them, over the severity of the "
            "fault. Below 0.60 the check must refuse, above 0.75 it must not.</p>"
        )
        parts.append(render_fault_charts(content.faults))
    for name, rows in content.runs.items():
        parts.append(f'<h3>Training: {escape(name)}</h3><div class="side">{render_training_charts(rows)}</div>')
    return "".join(parts)


def _render_segmenter(content: PageContent, estimates: list[Estimate]) -> list[str]:
    tables = [t for t in content.evaluation.confusions if t.source != "all"]
    return [
        "<h3>Segmenter</h3>",
        "<p>IoU over all pixels of a source, undecided ones left out. Where people marked only water, only water is "
        "scored. Edge F1: four neighbours, 2 px.</p>",
        render_mask_table(estimates),
        *(
            f"<details><summary>{title} per sequence</summary>{render_sequence_table(estimates, metric)}</details>"
            for metric, title in (("iou_water", "Water IoU"), ("miou", "Mean IoU"), ("edge_f1", "Edge F1"))
        ),
        "<h3>Segmenter: what is taken for what</h3>",
        f'<div class="side">{"".join(render_confusion_table(table) for table in tables)}</div>',
        render_mask_errors(content.mask_errors) if content.mask_errors else "",
        "<h3>Segmenter: worst pictures</h3>" + MASK_KEY + render_gallery(content.worst_masks)
        if content.worst_masks
        else "",
        "<h3>Segmenter: best pictures</h3>" + render_gallery(content.best_masks) if content.best_masks else "",
    ]


def _render_detector(content: PageContent, estimates: list[Estimate]) -> list[str]:
    curves: dict[str, Points] = {
        f"{curve.label} ({curve.n})": list(zip(RECALL_STEPS.tolist(), curve.precision, strict=True))
        for curve in content.evaluation.curves
    }
    table = next((t for t in content.evaluation.confusions if t.source == "all"), None)
    present = [kind for kind in DETECTOR_CLASSES if any(e.metric.startswith(kind) for e in estimates)]
    return [
        "<h3>Detector</h3>",
        "<p>101-point average precision. Recall and precision at confidence 0.40, IoU 0.5; near: shorter side at "
        "least 16 px of the input. A class counts only in sources that box every instance of it.</p>",
        *(f"<h4>{kind}</h4>{render_box_table(estimates, kind)}" for kind in present),
        *(
            f"<details><summary>{kind}: AP50 per sequence</summary>"
            f"{render_sequence_table(estimates, f'{kind}_ap50')}</details>"
            for kind in present
        ),
        "<h3>Detector: precision over recall, and what is taken for what</h3>",
        '<div class="side">'
        + lines(curves, "recall at IoU 0.5 (true boxes in brackets)", "precision", (0.0, 1.0))
        + (render_confusion_table(table) if table else "")
        + "</div>",
        render_box_errors(content.box_errors) if content.box_errors else "",
        "<h3>Detector: worst pictures</h3>" + BOX_KEY + render_gallery(content.worst_boxes)
        if content.worst_boxes
        else "",
        "<h3>Detector: best pictures</h3>" + render_gallery(content.best_boxes) if content.best_boxes else "",
    ]
