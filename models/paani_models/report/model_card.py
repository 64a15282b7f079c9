"""The model card, made from the manifest of a weights folder so that the two cannot differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from paani_models.catalogue import Figure, Model
from paani_models.datasets.sources import DETECTOR_CLASSES

_INTRODUCTION = """\
# Model card

Written by `paani models card` from `paani_models/weights/manifest.json`; a test keeps the two alike.

## Intended use

Seeing from a small, slow robot on rivers, canals, lakes and harbours, in daylight, with a forward camera near the
water: where there is water, and where there are people, vessels, piers and buoys. What the nets find informs an
advisory that a person can read and overrule; it stops the boat whenever the picture cannot be used.

Not for: collision avoidance without a person in charge, ranging, search and rescue or any count of people, aerial or
underwater pictures, surveillance, and ships that fall under the collision regulations.
"""

_LIMITS = """\
## Limits

* Held-out pictures come from the same cameras and places as training pictures of their source, or near them. Figures
  of a source with one held-out sequence say little about another river.
* People and buoys of a few pixels are missed; the recall of near objects and of all objects stand side by side above.
* Piers and most people were learnt from rendered pictures and from few hand-drawn boxes.
* Water that mirrors a wall, water under bridges, plants on the water and raindrops on the lens mislead the segmenter.
* Night, snow and ice hardly occur in training.
* No source was chosen for who or what it shows; people appear small and unidentifiable, as the cameras saw them.

## Data

No picture is part of the product. Terms are quoted as the sources state them; several state none, so the weights are
for research. Whoever needs other terms trains again without a source: `paani models train --sources`.
"""

_BOX_METRICS = {
    "ap50": "AP50",
    "ap50_95": "AP50:95",
    "recall_at_0.40": "recall",
    "recall_16px_at_0.40": "recall, near",
    "precision_at_0.40": "precision",
}


_OPEN = """\
## Open weights

A second set for whoever needs weights of other terms: `perception.weights = "open"`. It has learnt only from sources
that state terms under which anyone may use, change and sell what is learnt (`--sources open`), from rendered pictures,
and from starting points whose authors offer them under Apache-2.0 (YOLOX-nano and, as a teacher, NanoDet-Plus of
COCO's classes; MobileNetV2 of ImageNet). No human mask of water is among those sources: the open segmenter has never
seen a real one.

What is lost: nearly all buoys and piers, swimmers, and much of where the water ends; every figure below that is lower
than that of the set above. It is not good enough to steer by. No network says whether a picture is fit; limits on the
picture's statistics alone do. Therefore the boat says in log and on the page that it goes by the open set, advice
limits the speed to `advisor.people.uncalibrated_mps`, 0.3 m/s, whatever is seen, and a hull refuses the open segmenter.
"""


_PAPER = """\
## Paper weights

The paper's two networks by the paper's recipes, for whoever compares: `perception.weights = "paper"`. The segmenter has
learnt from what is left of the paper's own pictures, 88 of MaSTr1325, and the detector from random weights and the
sources below in 16 of its 60 epochs, where the paper's began with COCO's weights and had 10,000 pictures; so both are
worse than the paper's, and far worse than the set above. Its epoch was chosen by the pictures below. The same caution
holds as for the open set: no network says whether a picture is fit, the speed is limited, a hull refuses the segmenter.
"""

_OTHERS = {"open": _OPEN, "paper": _PAPER}


def render_model_card(catalogue: Mapping[str, Model], others: Mapping[str, Mapping[str, Model]]) -> str:
    """Markdown text; the same for the same manifests. others: the sets beside it, by name; may be empty."""
    models = [catalogue[name] for name in sorted(catalogue)]
    parts = [
        _INTRODUCTION,
        f"## Models\n\n{_render_models(models)}",
        "## Figures\n\nHeld-out sequences; n counts pictures, or true boxes.\n",
    ]
    parts += [_render_figures(model) for model in models if model.figures]
    parts += [_LIMITS, _render_origins(models)]
    for name, other in others.items():
        chosen = [other[role] for role in sorted(other)]
        parts += [_OTHERS[name], _render_models(chosen), *(_render_figures(model) for model in chosen if model.figures)]
        parts += [f"Sources of the {name} set:\n", _render_origins(chosen)]
    return "\n".join(parts)


def _render_models(models: Sequence[Model]) -> str:
    rows = [
        (
            model.name,
            model.architecture,
            f"{model.parameters:,}",
            f"{model.size_bytes:,}",
            "x".join(str(side) for side in model.input.shape),
            ", ".join(model.classes),
            f"`{model.sha256[:16]}`",
        )
        for model in models
    ]
    terms = "".join(f"* {model.name}, {model.licence}.\n" for model in models)
    head = ("model", "shape", "parameters", "bytes", "input", "classes", "SHA-256")
    return f"{_render_table(head, rows)}\nTerms of use:\n\n{terms}"


def _render_figures(model: Model) -> str:
    if model.classes == DETECTOR_CLASSES:
        return f"### {model.name}\n\n{_render_box_figures(model.figures)}"
    metrics = list(dict.fromkeys(figure.metric for figure in model.figures))
    rows = []
    for source in dict.fromkeys(figure.source for figure in model.figures):
        mine = {figure.metric: figure for figure in model.figures if figure.source == source}
        n = next(iter(mine.values())).n
        cells = [f"{mine[metric].value:.3f}" if metric in mine else "" for metric in metrics]
        rows.append((source, str(n), *cells))
    return f"### {model.name}\n\n{_render_table(('source', 'n', *metrics), rows)}"


def _render_box_figures(figures: Sequence[Figure]) -> str:
    rows, others = [], []
    for kind in DETECTOR_CLASSES:
        mine = [figure for figure in figures if figure.metric.startswith(f"{kind}_")]
        for source in dict.fromkeys(figure.source for figure in mine):
            found = {f.metric.removeprefix(f"{kind}_"): f for f in mine if f.source == source}
            cells = [f"{found[metric].value:.3f}" if metric in found else "" for metric in _BOX_METRICS]
            rows.append((kind, source, str(next(iter(found.values())).n), *cells))
    for figure in figures:
        if not figure.metric.startswith(DETECTOR_CLASSES):
            others.append((figure.metric, figure.source, f"{figure.value:.3f}", str(figure.n)))
    table = _render_table(("class", "source", "n", *_BOX_METRICS.values()), rows)
    return table + ("\n" + _render_table(("other figure", "source", "value", "n"), others) if others else "")


def _render_origins(models: Sequence[Model]) -> str:
    users: dict[tuple[str, str, str, str], list[str]] = {}
    for model in models:
        for origin in model.origins:
            key = (origin.name, origin.repository, origin.commit[:12], origin.licence)
            users.setdefault(key, []).append(model.name)
    rows = [(*key, ", ".join(names)) for key, names in users.items()]
    return _render_table(("source", "repository", "commit", "terms as stated or believed", "learnt by"), rows)


def _render_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)
