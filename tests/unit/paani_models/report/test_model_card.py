"""The model card says what the manifest says."""

import msgspec
import pytest

from paani_models.catalogue import OTHER_SETS, load_catalogue
from paani_models.commands.models import main
from paani_models.report.model_card import render_model_card
from tests.places import ROOT

OTHERS = {name: load_catalogue(folder) for name, folder in OTHER_SETS.items()}
CARD = ROOT / "models" / "MODEL_CARD.md"


def test_the_card_is_in_step_with_the_weights() -> None:
    """After a change of the weights: `paani models card > models/MODEL_CARD.md`."""
    assert CARD.read_text(encoding="utf-8") == render_model_card(load_catalogue(), OTHERS)


def test_the_card_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["card"]) == 0
    assert capsys.readouterr().out == render_model_card(load_catalogue(), OTHERS)


def test_every_source_and_its_terms_are_named() -> None:
    text = render_model_card(load_catalogue(), OTHERS)
    for model in (*load_catalogue().values(), *(model for other in OTHERS.values() for model in other.values())):
        assert model.sha256[:16] in text
        for origin in model.origins:
            assert f"| {origin.name} | {origin.repository} | {origin.commit[:12]} | " in text
            assert origin.licence.replace("|", "/") in text


def test_a_changed_figure_changes_the_card() -> None:
    catalogue = load_catalogue()
    model = catalogue["segmenter"]
    first = msgspec.structs.replace(model.figures[0], value=0.123)
    changed = {**catalogue, "segmenter": msgspec.structs.replace(model, figures=(first, *model.figures[1:]))}
    assert render_model_card(changed, {}) != render_model_card(catalogue, {})
    assert "0.123" in render_model_card(changed, {})


@pytest.mark.parametrize(
    "heading", ["Intended use", "Models", "Figures", "Limits", "Data", "Open weights", "Paper weights"]
)
def test_the_card_has_every_part(heading: str) -> None:
    assert f"## {heading}\n" in render_model_card(load_catalogue(), OTHERS)
